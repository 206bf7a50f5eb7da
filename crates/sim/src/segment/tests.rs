use std::path::PathBuf;

use super::*;
use crate::cable::{DeviceIndex, Endpoint, HostLink};
use crate::description::EoeEnd;
use crate::frame::Port;
use crate::network::{Beyond, DatagramLimit, Network};

fn read(text: &str) -> Result<Segment, SegmentError> {
    Segment::from_toml(text, Path::new("nowhere"))
}

fn refused(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

fn at(device: usize, port: Port) -> Endpoint {
    Endpoint::Device(DeviceIndex(device), port)
}

fn ends(segment: &Segment) -> Vec<(Endpoint, Endpoint)> {
    segment.cables.iter().map(|cable| (cable.a, cable.b)).collect()
}

#[test]
fn devices_are_attached_in_a_line_and_the_last_closes_the_ring() {
    let segment = read(
        r#"
        [segment]
        name = "small"
        seed = 3
        ring = true
        hop_ns = 1_000
        forwarding_ns = 500
        link_down_delay_us = 2.5
        cable_ns = 7

        [[device]]
        type = "coupler"

        [[device]]
        type = "digital-output-8"
        name = "lamps"
        count = 2
        cable_ns = 9
        "#,
    )
    .unwrap();
    let names: Vec<&str> = segment.devices.iter().map(|device| device.name.as_str()).collect();
    assert_eq!((segment.name.as_str(), names), ("small", vec!["coupler-1", "lamps-1", "lamps-2"]));
    let main = Endpoint::Host(HostLink::Main);
    let redundant = Endpoint::Host(HostLink::Redundant);
    let expected = [
        (main, at(0, Port::A)),
        (at(0, Port::B), at(1, Port::A)),
        (at(1, Port::B), at(2, Port::A)),
        (at(2, Port::B), redundant),
    ];
    assert_eq!(ends(&segment), expected);
    let delays: Vec<u128> = segment.cables.iter().map(|cable| cable.delay.as_nanos()).collect();
    assert_eq!(delays, [7, 9, 9, 7]);
    let options = &segment.options;
    assert_eq!((options.seed, options.link_down_delay.as_nanos()), (3, 2_500));
    assert_eq!((options.processing_delay.as_nanos(), options.forwarding_delay.as_nanos()), (1_000, 500));
    assert!(Network::from_description(segment).is_ok());
}

// covers: sim-files
#[test]
fn branches_crossed_devices_and_listed_cables_are_plugged_in() {
    let segment = read(
        r#"
        segment = { ring = "last.1" }

        [[device]]
        type = "junction"
        name = "j"
        [[device]]
        type = "coupler"
        name = "branch"
        attach = "j.3"
        [[device]]
        type = "servo"
        name = "crossed"
        attach = "j"
        port = 1
        [[device]]
        type = "servo"
        name = "last"
        attach = "none"
        [[cable]]
        from = "last.0"
        to = "crossed.0"
        delay_ns = 1_000
        "#,
    )
    .unwrap();
    let expected = [
        (Endpoint::Host(HostLink::Main), at(0, Port::A)),
        (at(0, Port::D), at(1, Port::A)),
        (at(0, Port::B), at(2, Port::B)),
        (at(3, Port::B), Endpoint::Host(HostLink::Redundant)),
        (at(3, Port::A), at(2, Port::A)),
    ];
    assert_eq!(ends(&segment), expected);
    assert_eq!(segment.cables[4].delay.as_nanos(), 1_000);
}

#[test]
fn the_settings_of_a_device_reach_its_description() {
    let text = r#"
        [[device]]
        type = "digital-input-8"
        alias = 0x1234
        serial = 77
        drift_ppm = -12.5
        clock_start_ns = 5
        eight_byte_sii = false
        sii_busy_us = 0.5
        transition_ms = 5
        to_op_ms = 7.5
        back_ms = 0.25
        "#;
    let device = read(text).unwrap().devices.remove(0);
    assert_eq!((device.alias, device.identity.serial, device.clock_drift_ppb), (0x1234, 77, -12_500));
    assert_eq!((device.clock_start_ns, device.eight_byte_sii, device.sii_busy.as_nanos()), (5, false, 500));
    let times = device.transitions;
    assert_eq!(
        [times.to_init, times.to_safeop, times.to_op, times.back].map(|time| time.as_micros()),
        [5_000, 5_000, 7_500, 250]
    );
}

#[test]
fn clocks_start_at_values_of_the_seed() {
    let starts = |seed: u64| {
        let text = format!("segment = {{ seed = {seed} }}\n[[device]]\ntype = \"servo\"\ncount = 3");
        read(&text).unwrap().devices.iter().map(|device| device.clock_start_ns).collect::<Vec<_>>()
    };
    assert_eq!(starts(1), starts(1));
    assert_ne!(starts(1), starts(2));
    assert_ne!(starts(1)[0], starts(1)[1]);
}

#[test]
fn a_real_image_with_another_alias_has_a_valid_checksum() {
    let directory = std::env::temp_dir().join(format!("ringcat-segment-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let mut terminal = crate::catalogue::by_name("digital-input-8").unwrap();
    terminal.name = String::from("x");
    std::fs::write(directory.join("di.bin"), crate::sii_image::build(&terminal)).unwrap();
    let text = "[[device]]\nsii = \"di.bin\"\nalias = 300\nserial = 9\n";
    let mut segment = Segment::from_toml(text, &directory).unwrap();
    std::fs::remove_dir_all(&directory).unwrap();
    let device = segment.devices.remove(0);
    let again = DeviceDescription::from_sii(crate::sii_image::build(&device), "again").unwrap();
    assert_eq!((device.name.as_str(), again.alias, again.identity.serial), ("di-1", 300, 9));
}

#[test]
fn files_that_never_end_and_files_that_are_too_long_are_refused() {
    let directory = std::env::temp_dir().join(format!("ringcat-endless-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let long = std::fs::File::create(directory.join("long.bin")).unwrap();
    long.set_len((8 << 20) + 1).unwrap();
    for (text, expected) in [
        ("sii = \"/dev/zero\"", "sii: /dev/zero cannot be read: it is no regular file"),
        ("sii = \"long.bin\"", "long.bin is longer than 8388608 bytes"),
        ("type = \"servo\"\nfiles = [\"/dev/zero\"]", "files: /dev/zero: cannot be read: it is no regular file"),
        ("type = \"servo\"\nfiles = [\"long.bin\"]", "long.bin: is longer than 4194304 bytes"),
    ] {
        let error = Segment::from_toml(&format!("[[device]]\n{text}\n"), &directory).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    long.set_len(4 << 20).unwrap();
    let many = |count: u32| format!("[[device]]\ntype = \"servo\"\nfiles = [\"long.bin\"]\ncount = {count}\n");
    let error = Segment::from_toml(&many(300), &directory).unwrap_err().to_string();
    assert!(error.contains("expected objects of at most 1073741824 bytes in all devices"), "{error}");
    std::fs::remove_dir_all(&directory).unwrap();
}

/// Texts of segment files with their errors; `{known}` is the list of all devices.
const REFUSED: &[(&str, &str)] = &[
    ("[segment]\nspeed = 3", "line 2: unknown key \"speed\" in [segment]: expected one of name, seed, "),
    (
        "[[device]]\nname = \"x\"\ntyp = \"servo\"",
        "line 3: device \"x\": unknown key \"typ\" in [[device]]: expected one of name, type, ",
    ),
    (
        "[[device]]\ntype = \"servo\"\n[[device]]\nalias = 70000",
        "line 4: device \"number 2\": alias: expected a whole number from 0 to 65535, got 70000",
    ),
    (
        "[[device]]\nname = \"x\"\ntype = \"servvo\"",
        "line 3: device \"x\": type: expected one of {known}, got \"servvo\"",
    ),
    ("\n[[device]]\nname = \"x\"", "line 2: device \"x\": type: expected a key type or sii, got neither"),
    (
        "[[device]]\ntype = \"servo\"\nsii = \"a.bin\"",
        "line 3: device \"servo-1\": sii: expected either type or sii, got both",
    ),
    ("[[device]]\nsii = \"a.bin\"", "line 2: device \"a-1\": sii: nowhere/a.bin cannot be read"),
    (
        "[[device]]\ntype = \"servo\"\ncount = 0",
        "line 3: device \"servo-1\": count: expected 1 to 65535 devices in all, got 0",
    ),
    (
        "[[device]]\ntype = \"servo\"\nname = \"a.b\"",
        "line 3: device \"a.b\": name: expected one without a dot that is not one of main, redundant, \
         none, got \"a.b\"",
    ),
    (
        "[[device]]\ntype = \"servo\"\nto_op_ms = -1",
        "line 3: device \"servo-1\": to_op_ms: expected a time, not negative, got -1",
    ),
    (
        "[[device]]\ntype = \"servo\"\ndrift_ppm = inf",
        "line 3: device \"servo-1\": drift_ppm: expected -1000000 to 1000000, got inf",
    ),
    ("[segment]\nlink_up_delay_us = nan", "line 2: link_up_delay_us: expected a time, not negative, got NaN"),
    ("[segment]\nring = true", "line 2: ring: expected a device to close the ring at, there is none"),
    (
        "[segment]\nring = 7\n[[device]]\ntype = \"servo\"",
        "line 2: ring: expected true, false or \"device.port\", got 7",
    ),
    (
        "[segment]\nring = \"yes\"\n[[device]]\ntype = \"servo\"",
        "line 2: ring: expected \"main\", \"redundant\" or a device, got \"yes\"",
    ),
];

// covers: sim-files
#[test]
fn errors_name_line_and_device() {
    let known = crate::catalogue::names().collect::<Vec<_>>().join(", ");
    let coupler = "[[device]]\ntype = \"coupler\"\nname = \"head\"\n";
    for (text, expected) in REFUSED {
        let (got, expected) = (refused(text), expected.replace("{known}", &known));
        assert!(got.starts_with(&expected), "{text}\nexpected {expected}\ngot      {got}");
    }
    for (text, expected) in [
        (
            "[[device]]\ntype = \"servo\"\nname = \"head\"",
            "line 6: device \"head\": name: \"head\" is that of device 0 already",
        ),
        (
            "[[device]]\ntype = \"servo\"\nname = \"s\"\nattach = \"tail\"",
            "line 7: device \"s\": attach: expected \"main\", \"redundant\" or a device, got \"tail\"",
        ),
        (
            "[[device]]\ntype = \"servo\"\nname = \"s\"\nattach = \"head.7\"",
            "line 7: device \"s\": attach: port of \"head\": expected 0 to 3, got \"7\"",
        ),
        (
            "[[device]]\ntype = \"servo\"\nname = \"s\"\nattach = \"head.0\"",
            "line 7: device \"head\": attach: port 0 of \"head\" is joined to the main link already",
        ),
        (
            "[[device]]\ntype = \"servo\"\nname = \"s\"\nport = 3",
            "line 7: device \"s\": port: port 3 of \"s\" does not exist",
        ),
        ("[[device]]\ntype = \"servo\"\nname = \"s\"\nport = 4", "line 7: device \"s\": port: expected 0 to 3, got 4"),
        (
            "[[cable]]\nfrom = \"head.1\"\nto = \"head.1\"",
            "line 5: device \"head\": from: port 1 of \"head\" cannot be joined to itself",
        ),
        (
            "[[device]]\ntype = \"servo\"\nname = \"s\"\nattach = \"s.1\"\nport = 1",
            "line 7: device \"s\": attach: port 1 of \"s\" cannot be joined to itself",
        ),
    ] {
        let got = refused(&format!("{coupler}{text}"));
        assert_eq!(got, expected, "{text}");
    }
}

#[test]
fn a_key_of_too_many_parts_and_too_deep_a_value_have_a_line() {
    for parts in [81, 1000] {
        let key = vec!["a"; parts].join(".");
        for text in [format!("[segment]\nname = \"x\"\n{key} = 1\n"), format!("[segment]\n\n[{key}]\n")] {
            assert_eq!(refused(&text), "line 3: recursion limit", "{parts} parts");
        }
    }
    let nested = format!("\n[segment]\nname = {}{}", "[".repeat(200), "]".repeat(200));
    assert!(refused(&nested).starts_with("line 3: cannot recurse further"), "{}", refused(&nested));
}

#[test]
fn a_missing_file_is_named() {
    let error = Segment::load(Path::new("nowhere/none.toml")).unwrap_err();
    assert_eq!(error.file, Some(PathBuf::from("nowhere/none.toml")));
    assert!(error.to_string().starts_with("nowhere/none.toml: cannot be read"));
}

// covers: sim-files
#[test]
fn the_example_segments_of_this_crate_are_valid() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("segments");
    let mut files: Vec<PathBuf> = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 3);
    for file in files {
        let segment = Segment::load(&file).unwrap_or_else(|error| panic!("{error}"));
        assert!(Network::from_description(segment).is_ok(), "{}", file.display());
    }
}

mod any_text {
    use super::*;
    use proptest::prelude::*;

    const LINES: [&str; 16] = [
        "[segment]",
        "[[device]]",
        "[[cable]]",
        "ring = true",
        "type = \"coupler\"",
        "type = \"digital-input-8\"",
        "sii = \"a.bin\"",
        "name = \"a\"",
        "attach = \"a.1\"",
        "attach = \"none\"",
        "from = \"a.1\"",
        "to = \"a.2\"",
        "count = 3",
        "port = 1",
        "alias = -1",
        "name = \"\u{e4}\"",
    ];

    proptest! {
        #[test]
        fn never_panics(lines in prop::collection::vec(prop::sample::select(&LINES[..]), 0..14), noise in ".{0,20}") {
            if let Ok(segment) = read(&lines.join("\n")) {
                prop_assert!(Network::from_description(segment).is_ok());
            }
            let _ = read(&format!("{}\n{noise}", lines.join("\n")));
        }
    }
}

// covers: sim-files
#[test]
fn mailbox_keys_change_sizes_times_and_services() {
    let segment = read(
        r#"
        [[device]]
        type = "all-protocols"
        count = 2
        answer_us = 50
        mailbox_bytes = 256
        password = 7
        erase_ms = 100
        ethernet = "loop"
        ip = "10.0.0.2/24"
        gateway = "10.0.0.1"

        [[device]]
        type = "servo"
        mailbox_bytes = 64
        "#,
    )
    .unwrap();
    let device = &segment.devices[0];
    let mailbox = device.mailbox.unwrap();
    assert_eq!((mailbox.response_time.as_micros(), mailbox.standard.send_size), (50, 256));
    let starts: Vec<(u16, u16)> = device.sync_managers.iter().map(|entry| (entry.start, entry.length)).collect();
    assert_eq!(starts, [(0x1000, 256), (0x1100, 256), (0x1200, 4), (0x1300, 4)]);
    assert_eq!((device.services.foe.password, device.services.foe.erase_time.as_millis()), (7, 100));
    let ethernet = &device.services.eoe;
    assert_eq!((ethernet.end, ethernet.mask.unwrap().to_string()), (EoeEnd::Loop, "255.255.255.0".into()));
    assert_eq!(ethernet.gateway.unwrap().to_string(), "10.0.0.1");
    assert_ne!(ethernet.mac, segment.devices[1].services.eoe.mac);
    let servo: Vec<u16> = segment.devices[2].sync_managers.iter().map(|entry| entry.start).collect();
    assert_eq!(servo, [0x1000, 0x1040, 0x1080, 0x1180]);
}

// covers: sim-files
#[test]
fn invalid_mailbox_keys_are_refused_with_the_valid_values() {
    let key = |key: &str| refused(&format!("[[device]]\ntype = \"all-protocols\"\n{key}\n"));
    for (line, part) in [
        ("mailbox_bytes = 12", "3: device \"all-protocols-1\": mailbox_bytes: expected 24 to 1486, got 12"),
        ("ethernet = \"hub\"", "ethernet: expected stack, loop or nothing, got \"hub\""),
        ("ip = \"10.0.0.2\"", "ip: expected an address with its prefix as in 10.0.0.2/24, got \"10.0.0.2\""),
        ("ip = \"224.0.0.1/24\"", "expected an address"),
        ("gateway = \"10.0.0.1/24\"", "gateway: expected an address as in 10.0.0.1, got \"10.0.0.1/24\""),
        ("answer_us = -1.0", "answer_us: expected a time"),
        ("files = [\"missing.txt\"]", "files: nowhere/missing.txt"),
    ] {
        let message = key(line);
        assert!(message.contains(part), "{line}: {message}");
    }
    let without = refused("[[device]]\ntype = \"block\"\nmailbox_bytes = 128\n");
    assert!(without.contains("mailbox_bytes: expected a device of the catalogue with a mailbox"), "{without}");
}

// covers: sim-files
#[test]
fn files_are_relative_to_the_segment_file() {
    let text = "[[device]]\ntype = \"soe-drive\"\nfiles = [\"demo.toml\"]\n";
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("segments");
    let segment = Segment::from_toml(text, &beside).unwrap();
    let (name, data) = &segment.devices[0].services.foe.files[0];
    assert_eq!((name.as_str(), data), ("demo.toml", &std::fs::read(beside.join("demo.toml")).unwrap()));
}

// covers: sim-clocks
#[test]
fn clock_errors_are_read_from_the_file() {
    let text = r#"
        [[device]]
        type = "servo"
        clock_bits = 32
        drift_ppm = 50
        wander_ppm = 1.5
        wander_s = 10
        receive_jitter_ns = 40
        latches_processing_only = true
        "#;
    let device = read(text).unwrap().devices.remove(0);
    let errors = device.clock_errors();
    assert_eq!((errors.drift_ppb, errors.wander.amplitude_ppb, errors.wander.period.as_secs()), (50_000, 1_500, 10));
    assert_eq!((errors.receive_jitter.as_nanos(), device.latches_processing_only), (40, true));
    let dc = device.dc.unwrap();
    assert!(!dc.wide && !dc.modes.is_empty());
    let wrong = |line: &str| read(&format!("[[device]]\ntype = \"servo\"\n{line}")).unwrap_err().to_string();
    assert!(wrong("clock_bits = 48").contains("expected 0, 32 or 64, got 48"));
    assert!(wrong("wander_ppm = 20000").contains("wander_ppm"));
    assert!(read("[[device]]\ntype = \"servo\"\nclock_bits = 0").unwrap().devices[0].dc.is_none());
}

// covers: sim-faults
#[test]
fn the_limit_of_datagrams_is_read_from_the_file() {
    let limit = |keys: &str| {
        let text = format!("[segment]\n{keys}\n[[device]]\ntype = \"coupler\"\n");
        read(&text).map(|segment| segment.options.max_datagrams).map_err(|error| error.to_string())
    };
    let of = |datagrams, beyond| Ok(Some(DatagramLimit { datagrams, beyond }));
    assert_eq!(limit(""), Ok(None));
    assert_eq!(limit("max_datagrams = 15"), of(15, Beyond::Unprocessed));
    assert_eq!(limit("max_datagrams = 15\nmore_datagrams = \"unprocessed\""), of(15, Beyond::Unprocessed));
    assert_eq!(limit("max_datagrams = 3\nmore_datagrams = \"dropped\""), of(3, Beyond::Dropped));
    for (keys, expected) in [
        ("max_datagrams = 0", "2: max_datagrams: expected 1 or more, got 0"),
        (
            "max_datagrams = 5\nmore_datagrams = \"cut\"",
            "3: more_datagrams: expected \"unprocessed\" or \"dropped\", got",
        ),
        ("more_datagrams = \"dropped\"", "2: more_datagrams: expected max_datagrams beside it"),
    ] {
        let message = limit(keys).expect_err(keys);
        assert!(message.contains(expected), "{message}");
    }
}
