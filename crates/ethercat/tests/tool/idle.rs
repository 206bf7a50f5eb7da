//! All commands while the daemon drives the ring.

use std::path::Path;

use ringcat::daemon::OwnedBus;
use ringcat::eoe::{EthernetOptions, HostInterface, MakeInterface};
use ringcat::sim::segment::Segment;
use ringcat::{Limits, Options};
use ringcat_engine::mail::eoe;

use crate::bench::{Bench, LONG, directory, tool};
use crate::golden_bus::{WITH_SOE, segment};

fn bench() -> Bench {
    let directory = directory();
    let segment = segment(&directory, WITH_SOE);
    Bench::start_in(directory, vec![segment])
}

// covers: daemon
#[test]
fn lists_are_shown_and_selected() {
    let bench = bench();
    let input = "1  1000:0  PREOP  +  EL3102 2Ch. Ana. Input +/-10V\n";
    assert_eq!(bench.good(&["slaves", "-p1"]), input);
    assert_eq!(bench.good(&["-a", "1000", "-p", "0", "sl"]), input);
    assert_eq!(bench.good(&["slaves", "-p", "7-"]), "");
    assert_eq!(bench.good(&["slaves", "-m", "1-"]), "");
    assert_eq!(bench.good(&["slaves", "-a", "5"]), "");
    for nothing in ["config", "domains", "data", "eoe"] {
        assert_eq!(bench.good(&[nothing]), "", "{nothing}");
    }
    let cstruct = bench.good(&["cstruct", "-p2"]);
    assert!(cstruct.contains("{0x1600, 1, slave_2_pdo_entries + 0}, /* Channel 1 */\n"), "{cstruct}");
    assert!(bench.good(&["graph"]).ends_with("}\n") && bench.good(&["crc"]).lines().count() == 6);
    assert_eq!(bench.good(&["xml"]).matches("<EtherCATInfo>").count(), 4);
    assert!(bench.good(&["version"]).starts_with("IgH EtherCAT master 1.6.6 (RingCAT "));
}

// covers: daemon
#[test]
fn objects_are_read_and_written_with_their_types() {
    let bench = bench();
    let on = |words: &[&str]| bench.good(&[words, &["-p", "1"]].concat());
    assert_eq!(on(&["upload", "0x2000", "0"]), "0x80000005 2147483653\n");
    assert_eq!(on(&["upload", "0x2000", "0", "-t", "sm32"]), "0x80000005 -5\n");
    assert_eq!(on(&["download", "0x2003", "0", "200"]), "");
    assert_eq!(on(&["upload", "0x2003", "0"]), "0xc8 200\n");
    assert_eq!(on(&["download", "-t", "int8", "0x2003", "0", "-5"]), "");
    assert_eq!(on(&["upload", "0x2003", "0"]), "0xfb 251\n");
    let failed = |words: &[&str]| bench.bad(&[words, &["-p", "1"]].concat());
    let read_only = "SDO transfer aborted with code 0x06010002: Attempt to write a read-only object\n";
    assert_eq!(failed(&["download", "0x2004", "0", "7"]), read_only);
    let gone = "SDO transfer aborted with code 0x06020000: This object does not exist in the object directory\n";
    assert_eq!(failed(&["upload", "-t", "uint8", "0x5000", "0"]), gone);
    let unknown = "Failed to determine SDO entry data type. Please specify --type.\n";
    assert_eq!(failed(&["upload", "0x5000", "0"]), unknown);
    let size = "Data type mismatch. Expected uint8 with 1 byte, but got 4 byte.\n";
    assert_eq!(failed(&["upload", "0x2000", "0", "-t", "uint8"]), size);
    assert!(failed(&["upload", "0x10000", "0"]).starts_with("Invalid SDO index '0x10000'!\n\nethercat upload"));
    assert!(
        failed(&["download", "0x2003", "0", "300"]).starts_with("Invalid value argument '300' for type 'uint8'!\n")
    );
    assert!(
        bench.bad(&["upload", "0x2000", "0"]).starts_with("'upload' requires a single slave to be selected: 4 are!")
    );
}

// covers: daemon
#[test]
fn registers_are_read_and_written_also_with_emergency() {
    let bench = bench();
    let write = ["reg_write", "-p1", "0x1400", "-t", "uint32", "0x04030201"];
    assert_eq!(bench.good(&write), "");
    assert_eq!(bench.good(&["reg_read", "-p1", "0x1400", "4"]), "0x01 0x02 0x03 0x04\n");
    assert_eq!(bench.good(&["reg_read", "-p1", "0x1400", "-t", "uint16"]), "0x0201 513\n");
    assert_eq!(bench.good(&["reg_write", "-e", "-p2", "0x1400", "-t", "uint8", "9"]), "");
    assert_eq!(bench.good(&["reg_read", "-p2", "0x1400", "1"]), "0x09\n");
    let verbose = bench.tool(&[&write[..], &["-v"]].concat());
    assert_eq!((verbose.code, verbose.err.as_str()), (Some(0), "Register writing finished.\n"));
    assert!(bench.bad(&["reg_write", "-e", "-p9", "0x1400", "-t", "uint8", "9"]).contains("position 9"));
    assert!(bench.bad(&["reg_read", "-p1", "0x1400", "0"]).starts_with("Length may not be zero!"));
    assert!(bench.bad(&["reg_read", "-p1", "0xffff", "2"]).starts_with("Address and size exceeding 64k!"));
    // More than one question reads and writes.
    let file = bench.directory.join("registers");
    let bytes: Vec<u8> = (0..1500_u32).map(|at| at as u8).collect();
    std::fs::write(&file, &bytes).expect("it can be written");
    let path = file.to_str().expect("it is text");
    assert_eq!(bench.good(&["reg_write", "-p1", "0x1100", path]), "");
    let read = bench.good(&["reg_read", "-p1", "0x1100", "1500"]);
    let wanted: Vec<String> = bytes.iter().map(|byte| format!("0x{byte:02x}")).collect();
    assert_eq!(read, wanted.join(" ") + "\n");
}

// covers: daemon
#[test]
fn files_go_both_ways_also_in_several_parts() {
    let bench = bench();
    assert_eq!(bench.good(&["foe_read", "-p1", "fw.bin"]), "hello");
    let bytes: Vec<u8> = (0..150_000_u32).map(|at| (at % 251) as u8).collect();
    let file = bench.directory.join("large.bin");
    std::fs::write(&file, &bytes).expect("it can be written");
    let path = file.to_str().expect("it is text");
    let written = bench.tool(&["foe_write", "-p1", "-v", path]);
    assert_eq!((written.code, written.err.as_str()), (Some(0), "FoE writing finished.\n"), "{written:?}");
    assert_eq!(bench.tool(&["foe_read", "-p1", "large.bin"]).bytes, bytes);
    let back = bench.directory.join("back.bin");
    bench.good(&["foe_read", "-p1", "large.bin", "-o", back.to_str().expect("it is text")]);
    assert_eq!(std::fs::read(back).expect("it is there"), bytes);
    let missing = bench.bad(&["foe_read", "-p1", "nothing"]);
    assert_eq!(missing, "FoE read aborted with error code 0x00008001: Not found.\n");
    assert!(bench.bad(&["foe_write", "-p1", "-"]).starts_with("Please specify a filename for the slave side"));
    assert!(bench.bad(&["foe_write", "-p1", "/nothing"]).starts_with("Failed to open '/nothing'!"));
}

// covers: daemon
#[test]
fn idns_are_read_and_written() {
    let bench = bench();
    assert_eq!(bench.good(&["soe_read", "-p1", "P-0-100"]), "0x01 0x02 0x03 0x04\n");
    assert_eq!(bench.good(&["soe_read", "-p1", "0", "0x8064", "-t", "uint32"]), "0x04030201 67305985\n");
    assert_eq!(bench.good(&["soe_write", "-p1", "P-0-150", "-t", "uint16", "513"]), "");
    assert_eq!(bench.good(&["soe_read", "-p1", "P-0-150"]), "0x01 0x02\n");
    assert!(bench.bad(&["soe_read", "-p1", "S-7-4000"]).starts_with("SoE read command failed with code 0x"));
    assert!(bench.bad(&["soe_read", "-p1", "9", "1"]).starts_with("Invalid drive number '9'!"));
    assert!(bench.bad(&["soe_write", "-p1", "P-0-150", "1"]).starts_with("Please specify a data type."));
}

// covers: daemon
#[test]
fn siis_and_aliases_are_written_after_a_check() {
    let bench = bench();
    let image = bench.tool(&["sii_read", "-p1"]).bytes;
    let text = bench.good(&["sii_read", "-v", "-p1"]);
    assert!(text.contains("SII Category 0x000a (STRINGS), ") && text.starts_with("SII Area:\n  05 0c 03 44"), "{text}");
    let file = bench.directory.join("sii.bin");
    let path = file.to_str().expect("it is text").to_owned();
    let mut wrong = image.clone();
    wrong[8] ^= 1;
    std::fs::write(&file, &wrong).expect("it can be written");
    assert!(bench.bad(&["sii_write", "-p1", &path]).starts_with("CRC incorrect. Must be 0x"));
    std::fs::write(&file, &image[..131]).expect("it can be written");
    assert!(bench.bad(&["sii_write", "-p1", &path]).starts_with("Invalid data size 131!"));
    let mut changed = image.clone();
    // A letter of the name.
    let place = image.windows(6).position(|it| it == b"AnaIn\x1d").expect("it is there");
    changed[place] = b'B';
    std::fs::write(&file, &changed).expect("it can be written");
    assert_eq!(bench.good(&["sii_write", "-p1", &path]), "");
    assert_eq!(bench.tool(&["sii_read", "-p1"]).bytes, changed);
    std::fs::write(&file, bench.tool(&["sii_read", "-p2"]).bytes).expect("it can be written");
    let refused = bench.bad(&["sii_write", "-p1", &path]);
    assert!(refused.contains("SII: the image is of vendor 0x"), "{refused}");
    assert!(refused.ends_with(". Use --force to write anyway.\n"), "{refused}");
    let refused = bench.bad(&["alias", "1234"]);
    let wanted = "This will write the alias addresses of 4 slaves to 1234! Please specify --force to proceed.\n";
    assert_eq!(refused, wanted);
    assert_eq!(bench.good(&["alias", "-p2", "0x4d2"]), "");
    let written = bench.tool(&["sii_read", "-p2"]).bytes;
    assert_eq!(written[8..10], 1234_u16.to_le_bytes());
    // The alias of the SII counts at once, that of the register (0x0012) from the next power-on on.
    let listed = bench.good(&["slaves", "-a1234"]);
    assert!(listed.starts_with("2  1234:0  "), "{listed}");
    assert_eq!(bench.good(&["reg_read", "-p2", "-tuint16", "0x12"]), "0x0000 0\n");
    let warned = bench.tool(&["alias", "-p", "9", "1"]);
    assert_eq!((warned.code, warned.err.as_str()), (Some(0), "Warning: Selection matches no slaves!\n"));
}

// covers: daemon
#[test]
fn states_are_requested_and_reached_later() {
    let bench = bench();
    assert_eq!(bench.good(&["states", "-p0", "safeop"]), "");
    bench.wait_until("SAFEOP", || bench.good(&["slaves", "-p0"]).contains("SAFEOP"));
    assert_eq!(bench.good(&["states", "-p", "1", "BOOT"]), "");
    bench.wait_until("BOOT", || bench.good(&["slaves", "-p1"]).contains("BOOT"));
    assert_eq!(bench.good(&["states", "-p", "-1", "PREOP"]), "");
    bench.wait_until("PREOP", || bench.good(&["slaves", "-p", "-1"]).matches("PREOP").count() == 2);
    assert!(bench.bad(&["states", "XX"]).starts_with("Invalid state 'XX'!\n\nethercat states [OPTIONS] <STATE>\n"));
    assert_eq!(bench.good(&["debug", "1"]), "");
    assert!(bench.bad(&["debug", "x"]).starts_with("Invalid debug level 'x'!"));
    assert_eq!(bench.good(&["rescan"]), "");
}

// covers: daemon
#[test]
fn counters_of_errors_are_shown_and_reset() {
    let bench = bench();
    bench.inside(0, |segment| {
        let network = segment.network_mut();
        let cable = network.cables().len() - 1;
        let cable = ringcat::sim::cable::CableId(cable);
        network.apply(ringcat::sim::fault::Fault::Corrupt { cable, direction: None, count: 1 });
    });
    bench.wait_until("an error", || {
        bench.good(&["slaves"]);
        bench.good(&["crc"]).lines().last().is_some_and(|line| line.starts_with("  3|  1 "))
    });
    assert_eq!(bench.good(&["crc", "reset"]), "");
    assert!(bench.good(&["crc"]).lines().last().is_some_and(|line| line.starts_with("  3|  0   0   0   ↑|")));
    assert!(bench.bad(&["crc", "x"]).starts_with("'crc' takes either no or 'reset' argument!\n"));
}

// covers: daemon
#[test]
fn a_master_lists_its_frames_and_dictionaries_their_objects() {
    let bench = bench();
    let master = bench.good(&["master"]);
    assert!(master.starts_with("Master0\n  Phase: Idle\n  Active: no\n  Slaves: 4\n  Ethernet devices:\n    Main: "));
    let sent = |text: &str| {
        let line = text.lines().find_map(|line| line.trim().strip_prefix("Tx frames:"));
        line.and_then(|text| text.trim().parse::<u64>().ok()).expect("it is a number")
    };
    let before = sent(&master);
    bench.wait_until("rates", || {
        let now = bench.good(&["master"]);
        let rate = now.lines().find_map(|line| line.trim().strip_prefix("Tx frame rate [1/s]:"));
        sent(&now) > before && rate.is_some_and(|rates| rates.split_whitespace().next() != Some("0"))
    });
    let dictionary = bench.good(&["sdos", "-p1"]);
    for line in [
        "SDO 0x2003, \"Byte\"\n  0x2003:00, rwrwrw, uint8, 8 bit, \"Byte\"\n",
        "SDO 0x8000, \"Settings\"\n  0x8000:00, r-r-r-, uint8, 8 bit, ",
        "  0x8000:06, rwrwrw, uint16, 16 bit, ",
    ] {
        assert!(dictionary.contains(line), "{line}\n{dictionary}");
    }
    let objects = bench.good(&["sdos", "-q", "-p1"]);
    assert!(objects.contains("SDO 0x8000, \"Settings\"\n") && !objects.contains("8000:"), "{objects}");
    assert_eq!(bench.good(&["sdos", "-p", "0,2"]), "=== Master 0, Slave 0 ===\n=== Master 0, Slave 2 ===\n");
}

// covers: daemon
#[test]
fn without_a_daemon_the_message_says_what_to_start() {
    let nowhere = directory().join("nothing");
    let done = tool(&nowhere, &["slaves"]);
    assert_eq!((done.code, done.out.as_str()), (Some(1), ""));
    assert!(done.err.starts_with("Failed to obtain number of masters: no daemon answers at "), "{done:?}");
    assert!(done.err.contains("does ringcatd run? Start it with 'ethercatctl start'"), "{done:?}");
    let done = tool(&nowhere, &["-m", "3", "slaves"]);
    assert!(done.err.starts_with("Failed to open master 3: no daemon answers at "), "{done:?}");
    let good = tool(&nowhere, &["version"]);
    assert_eq!(good.code, Some(0));
    std::fs::remove_dir(nowhere.parent().expect("it has one")).expect("it is empty");
}

// covers: daemon
#[test]
fn ip_parameters_are_set_where_the_slave_supports_ethernet() {
    let text = "[segment]\n[[device]]\ntype = \"ethernet-terminal\"\n[[device]]\ntype = \"digital-input-8\"\n";
    let segment = Segment::from_toml(text, Path::new(".")).expect("it is right");
    let bench = Bench::start(vec![segment]);
    let set = ["ip", "-p0", "ip_address", "10.0.0.7/24", "mac_address", "02:00:00:00:00:07", "hostname", "axis"];
    assert_eq!(bench.good(&set), "");
    assert!(!bench.bad(&["ip", "-p1", "addr", "10.0.0.7"]).is_empty());
    assert!(bench.bad(&["ip", "-p0", "addr"]).starts_with("'ip' needs an even number of arguments!"));
    let bus = OwnedBus::take(&bench.socket, 0, "test", &Options::default(), || ()).expect("it is free");
    let read = bus.supervisor().run(|engine| {
        let mailbox = engine.mailbox(ringcat::wire::address::Position(0)).expect("it has one");
        async move { eoe::read_ip(&mailbox, 0, Limits::new(LONG, LONG)).await }
    });
    let ip = read.expect("it runs").expect("it is reported");
    assert_eq!((ip.address, ip.mask), (Some([10, 0, 0, 7].into()), Some([255, 255, 255, 0].into())));
    assert_eq!(ip.mac, Some([2, 0, 0, 0, 0, 7]));
    // Interfaces are those of the application; these lead nowhere.
    let make: MakeInterface = Box::new(|_, _| Ok(Box::new(Nowhere)));
    let started = bus.supervisor().start_ethernet_on(EthernetOptions::new(0, [2, 0, 0, 0, 0, 1]), make);
    let ethernet = started.expect("it runs");
    bench.wait_until("an interface", || bench.good(&["eoe"]).contains("\n     eoe0s0      0     up  "));
    assert_eq!(bench.good(&["eoe"]).lines().count(), 3);
    let interface = &bench.one(&["eoe"])["interfaces"][0];
    assert!(interface["interface"] == "eoe0s0" && interface["position"] == 0 && interface["up"] == true, "{interface}");
    drop(ethernet);
    bench.wait_until("no interface", || bench.good(&["eoe"]).is_empty());
}

/// A network interface without traffic.
struct Nowhere;

impl HostInterface for Nowhere {
    fn receive(&mut self, _room: &mut [u8]) -> Option<usize> {
        None
    }

    fn send(&mut self, _frame: &[u8]) -> bool {
        true
    }

    fn set_carrier(&mut self, _carrier: bool) {}
}
