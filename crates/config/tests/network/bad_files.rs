//! Bad files: each is refused with file, line, key and reason, in bounded time and memory.

use std::time::{Duration, Instant};

use ringcat_config::network::NetworkFile;

use crate::WHOLE;

fn refusal(text: impl AsRef<[u8]>) -> String {
    let begin = Instant::now();
    let error = NetworkFile::read("bad.toml", text.as_ref()).expect_err("it is refused").to_string();
    assert!(begin.elapsed() < Duration::from_secs(20), "in bounded time");
    assert!(error.starts_with("bad.toml") && error.len() < 800, "{error}");
    error
}

/// The error of the file with a text replaced once.
fn changed(from: &str, to: &str) -> String {
    assert!(WHOLE.contains(from), "{from}");
    refusal(WHOLE.replacen(from, to, 1))
}

// covers: network-file
#[test]
fn levels_beyond_the_limit_are_refused_with_their_line() {
    let head = "ringcat_network = 1\nname = \"m\"\n";
    let (keys, lists) = (vec!["a"; 200].join("."), "[".repeat(200));
    for text in [format!("{keys} = 1\n"), format!("[{keys}]\n"), format!("x = {lists}\n")] {
        let error = refusal(format!("{head}{text}"));
        assert!(error.starts_with("bad.toml:3: "), "{error}");
    }
}

/// A text of the file, what takes its place, and a part of the error.
const CHANGES: &[(&str, &str, &str)] = &[
    ("ringcat_network = 1", "ringcat_network = 2", "bad.toml:1: ringcat_network: expected version 1 of the format"),
    ("ringcat_network = 1\n", "", "bad.toml: expected a network file of RingCAT"),
    (
        "position = 1\n",
        "positon = 1\n",
        "bad.toml:49: SubDevice \"Drive\": subdevice[1].positon: unknown key `positon`",
    ),
    (
        "product = 0x1b960402",
        "product = -1",
        "SubDevice \"Drive\": subdevice[1].product: got the number `-1`, expected a whole number from 0",
    ),
    (
        "number = 2\n",
        "number = 300\n",
        "subdevice[1].sync_manager[0].number: got the number `300`, expected a whole number from 0 to 255",
    ),
    (
        "period = \"250us\"",
        "period = \"250\"",
        "bad.toml:27: domain[0].period: expected a time with ns, us, ms, s or min",
    ),
    ("data = \"e8 03\"", "data = \"e8 0\"", "subdevice[1].startup[0].sdo.data: expected pairs of hexadecimal digits"),
    ("target = \"SAFEOP\"", "target = \"safeop\"", "subdevice[1].target: unknown word `safeop`, expected one of"),
    ("optional = true", "optional = 1", "subdevice[1].optional: got the number `1`, expected true or false"),
    ("name = \"Tool 2\"", "name = \"Tool\"", "subdevice[3].name: the name is also that of subdevice[2]"),
    (
        "reference = \"Drive\"",
        "reference = \"drive\"",
        "clocks.reference: expected the name of a SubDevice of the file, got \"drive\"",
    ),
    (
        "domain = \"fast\"",
        "domain = \"quick\"",
        "subdevice[1].domain: expected a domain of the file (\"fast\", \"slow\"), got \"quick\"",
    ),
    ("number = 3\n", "number = 2\n", "subdevice[1].sync_manager[1].number: 2 is also the number of sync_manager[0]"),
    ("number = 3\n", "number = 16\n", "subdevice[1].sync_manager[1].number: expected 0 to 15, got 16"),
    (
        "index = 0x1a01",
        "index = 0x1a00",
        "subdevice[1].sync_manager[1].pdo[1].index: 0x1a00 is also the index of pdo[0]",
    ),
    (
        "{ bits = 8 }",
        "{ bits = 0 }",
        "subdevice[1].sync_manager[0].pdo[0].entries[2].bits: expected 1 to 255 bits, got 0",
    ),
    ("under_way = 2", "under_way = 5", "domain[0].under_way: expected 1 to 4, got 5"),
    (
        "identification = 9\nidentification_word = 0x1000\noffset = 2\n",
        "alias = 5\noffset = 1\n",
        "SubDevice \"Switch\": subdevice[4].alias: alias 5 offset 1 is also the place of subdevice[3]",
    ),
    ("alias = 5\n", "", "subdevice[2].group: the head of group \"tool 1\" needs an alias or an identification"),
    ("identification = 9\n", "alias = 9\n", "subdevice[4].identification_word: expected a key identification"),
    ("identification_word = 0x1000", "identification_word = 0x0e00", "expected an address from 0x0F00 to 0xFFFE"),
    ("offset = 2", "position = 4", "subdevice[4].position: expected one of position, alias and identification"),
    ("port = 2 }", "port = 4 }", "subdevice[1].plugged_into.port: expected a port from 0 to 3, got 4"),
    (
        "plugged_into = { subdevice = \"Coupler\"",
        "plugged_into = { subdevice = \"Tool\"",
        "expected a SubDevice that is listed before",
    ),
    (
        "junctions = \"strict\"",
        "junctions = \"automatic\"",
        "redundancy.connection: expected connections with junctions = \"strict\"",
    ),
    ("idn = { drive = 1", "idn = { drive = 8", "subdevice[1].startup[3].idn.drive: expected 0 to 7, got 8"),
    ("mask = \"0f 00\"", "mask = \"0f\"", "subdevice[1].startup[6].check.mask: expected 2 bytes as in data, got 1"),
    (
        "at = \"SO\"\n",
        "at = \"SO\"\nsdo = { index = 1, data = \"\" }\n",
        "expected one of sdo, upload, idn, read_idn, ip, aoe, voe, write_file, read_file, write and check, got 2 of \
         them",
    ),
    (
        "at = \"SO\"\n",
        "at = \"SO\"\nafter_pdos = true\n",
        "subdevice[1].startup[3].after_pdos: PDOs are written at PS: expected no `at`, or \"PS\"",
    ),
    ("at = \"SO\"\n", "at = \"II\"\n", "subdevice[1].startup[3].at: II is in INIT, which has no mailbox"),
    (
        "read_idn = { drive = 2",
        "read_idn = { drive = 8",
        "subdevice[1].startup[8].read_idn.drive: expected 0 to 7, got 8",
    ),
    ("elements = 0x48", "elements = 0", "subdevice[1].startup[8].read_idn.elements: expected at least one bit, got 0"),
    ("aoe = \"05 06", "aoe = \"06", "subdevice[1].startup[9].aoe: expected an AMS header with a request"),
    ("voe = \"47 0c 00 00", "voe = \"47 0c", "subdevice[1].startup[10].voe: expected vendor, type and data"),
    (
        "position = 1\n",
        "position = 0\n",
        "SubDevice \"Drive\": subdevice[1].position: 0 is also the position of subdevice[0]",
    ),
    (
        "sync1_cycle = \"1ms\"",
        "sync1_cycle = \"1100us\"",
        "subdevice[1].sync.sync1_cycle: expected 0 or a multiple of sync0_cycle, 250us, got 1100us",
    ),
    ("name = \"gains.txt\"", "name = \"\"", "subdevice[1].startup[13].write_file.name: expected the name of a file"),
    (
        "name = \"log.txt\"",
        "name = \"\\u0000\"",
        "subdevice[1].startup[14].read_file.name: expected the name of a file",
    ),
    (
        "index = 0x8020, complete = true",
        "index = 0x8020, sub = 2, complete = true",
        "complete access begins at subindex 0 or 1, got 2",
    ),
    (
        "sync0_cycle = \"250us\"",
        "sync0_cycle = \"-1us\"",
        "subdevice[1].sync.sync0_cycle: expected 0ns to 2147483647ns, got -1us",
    ),
    (
        "read = { start = 0x1080, length = 128 }",
        "read = { start = 0xffff, length = 128 }",
        "subdevice[1].mailbox.read: expected an end within 64 KiB",
    ),
    ("[clocks]\n", "[clock]\n", "unknown key `clock`"),
    (
        "passage = { processing_ns = 300, forwarding_ns = 10 }",
        "passage = [300, 10]",
        "subdevice[1].passage: expected a table, got an array",
    ),
    (
        "{ index = 0x6041, bits = 16 }",
        "[0x6041, 0, 16]",
        "subdevice[1].sync_manager[1].pdo[0].entries[0]: expected a table, got an array",
    ),
    ("data = \"e8 03\"", "data = \"e8 0 3\"", "subdevice[1].startup[0].sdo.data: expected pairs of hexadecimal digits"),
    ("name = \"Drive\"\n", "name = \"Drive\"\nname = \"Drive\"\n", "duplicate key"),
];

// covers: network-file
#[test]
fn errors_name_line_key_subdevice_and_what_was_expected() {
    for (from, to, expected) in CHANGES.iter().copied() {
        let error = changed(from, to);
        assert!(error.contains(expected), "{from} -> {to}: {error}");
        let line = error.split(':').nth(1).and_then(|line| line.parse::<usize>().ok());
        assert!(line.is_some() || error.contains("expected a network file"), "{error}");
    }
    let (before, rest) = WHOLE.split_once("[clocks]\n").expect("a table");
    let (_, after) = rest.split_once("\n\n").expect("a further table");
    let without_clocks = format!("{before}{after}");
    assert!(refusal(without_clocks).contains("subdevice[1].sync: SYNC signals need distributed clocks"));
}

// covers: network-file
#[test]
fn a_truncated_file_is_valid_or_refused_at_every_length() {
    for length in 0..WHOLE.len() {
        let Some(text) = WHOLE.get(..length) else { continue };
        if let Err(error) = NetworkFile::read("bad.toml", text.as_bytes()) {
            assert!(error.to_string().starts_with("bad.toml:"), "{error}");
        }
    }
    assert!(NetworkFile::read("bad.toml", &WHOLE.as_bytes()[..300]).is_err());
}

// covers: network-file
#[test]
fn deep_large_and_binary_files_are_refused_in_bounded_time() {
    refusal(format!("ringcat_network = 1\nname = {}", "[".repeat(1_000_000)));
    refusal(format!("ringcat_network = 1\nname = {}", "{a=".repeat(1_000_000)));
    refusal(format!("ringcat_network = 1\n[{}]\n", vec!["a"; 200_000].join(".")));
    let long = refusal(vec![b' '; (8 << 20) + 1]);
    assert_eq!(long, "bad.toml: expected at most 8388608 bytes, got 8388609");
    assert_eq!(refusal(b"ringcat_network = 1\nname = \"\xff\"\n"), "bad.toml:2: expected UTF-8 text");
    refusal([0u8; 4096]);
    refusal("<EtherCATConfig/>");
    let many: String = (0..70_000).map(|n| format!("[[subdevice]]\nname = \"{n}\"\n")).collect();
    let many = format!("ringcat_network = 1\n[[domain]]\nname = \"d\"\nperiod = \"1ms\"\n{many}");
    assert!(refusal(many).contains("expected at most 65534 SubDevices, got 70000"));
    let bits: String = "{ bits = 255 }, ".repeat(3_000);
    let long = WHOLE.replacen("index = 0x1a01\n", &format!("index = 0x1a01\nentries = [{bits}]\n"), 1);
    assert!(refusal(long).contains("subdevice[1].sync_manager[1].pdo: expected at most 65535 bytes, got 95627"));
}

// covers: network-file
#[test]
fn two_subdevices_at_one_port_are_refused_unless_they_take_turns() {
    let subdevice = |name: &str, more: &str| format!("[[subdevice]]\nname = \"{name}\"\n{more}\n");
    let cable = "plugged_into = { subdevice = \"A\", port = 1 }\n";
    let file = |more: &str| {
        let parts = [subdevice("A", ""), subdevice("B", cable), subdevice("C", &format!("{cable}{more}"))];
        format!("ringcat_network = 1\nname = \"m\"\n[[domain]]\nname = \"d\"\nperiod = \"1ms\"\n{}", parts.concat())
    };
    let error = refusal(file(""));
    assert!(error.contains("subdevice[2].plugged_into: subdevice[1] is plugged into this port too"), "{error}");
    NetworkFile::read("turns.toml", file("optional = true").as_bytes()).expect("one of them may be absent");
}

/// A file of SubDevices with these keys, each key in a line of its own.
fn marked(subdevices: &[&str]) -> String {
    let head = "ringcat_network = 1\n[[domain]]\nname = \"d\"\nperiod = \"1ms\"\n";
    let subdevices = subdevices.iter().enumerate();
    let tables = subdevices.map(|(at, keys)| format!("[[subdevice]]\nname = \"{at}\"\n{}\n", keys.replace("; ", "\n")));
    format!("{head}{}", tables.collect::<String>())
}

// covers: network-file
#[test]
fn two_subdevices_with_one_identifier_are_refused_with_the_line() {
    let word = "identification = 7; identification_word = 0x1000";
    for (mark, shown, key) in [
        ("alias = 7", "alias 7", "alias"),
        ("identification = 7", "identification 7", "identification"),
        (word, "data word 7 at 0x1000", "identification"),
        ("alias = 0; offset = 7", "alias 0", "alias"),
    ] {
        let offset = if mark.contains("offset") { 7 } else { 0 };
        let text = marked(&[mark, "vendor = 2", mark]);
        let line = 13 + mark.matches(';').count();
        let expected = format!(
            "bad.toml:{line}: SubDevice \"2\": subdevice[2].{key}: {shown} offset {offset} is also the place of \
             subdevice[0]"
        );
        assert_eq!(refusal(text), expected);
        if offset > 0 {
            continue;
        }
        let [one, two] = ["a", "b"].map(|name| format!("{mark}; group = \"{name}\""));
        assert!(refusal(marked(&[&one, &two])).contains("is also the place of subdevice[0]"), "{mark}");
        // Behind the head of a group.
        let behind = format!("{mark}; offset = 1");
        assert!(
            refusal(marked(&[&one, "group = \"a\"", &behind])).contains("is also the place of subdevice[1]"),
            "{mark}"
        );
        let accepted =
            |text: String| NetworkFile::read("good.toml", text.as_bytes()).map_err(|error| error.to_string());
        assert!(accepted(marked(&[mark, &behind])).is_ok(), "{mark}");
        // They take turns: no SubDevice can be both.
        let [two, three] =
            ["product = 2; group = \"b\"", "product = 3; group = \"c\""].map(|it| format!("{mark}; {it}"));
        accepted(marked(&[&two, &three])).unwrap_or_else(|error| panic!("{error}"));
        let [two, three] = [2, 3].map(|product| format!("{mark}; product = {product}"));
        assert!(accepted(marked(&[&two, &three])).is_err(), "both are mandatory");
        let nothing = marked(&[&two, &three]).replacen("= 1\n", "= 1\nrequired = \"nothing\"\n", 1);
        assert!(accepted(nothing).is_ok(), "{mark}");
    }
    let twice = refusal(marked(&["alias = 7; group = \"a\"", "alias = 8; group = \"b\"", "alias = 9; group = \"a\""]));
    assert_eq!(
        twice,
        "bad.toml:16: SubDevice \"2\": subdevice[2].group: the members of group \"a\" must follow each other"
    );
}
