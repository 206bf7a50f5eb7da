//! Outputs of the original tool, compared byte for byte with ours on the same ring.
//!
//! They lie beside the repository; without them the test says so. Where the ring of a case cannot be had in a
//! simulation, or where ours is different on purpose, the case has a reason, and what still has to be the same.

use std::fs;
use std::path::{Path, PathBuf};

use ringcat::sim::cable::DeviceIndex;
use ringcat::{AlState, AlStatus, AlStatusCode};

use crate::bench::{Bench, Done, Driver, directory};
use crate::golden_bus::{COE_FOE, WITH_SOE, segment};
use crate::operation::declare;

const PLACE: &str = "../../../shared/data/cli_golden";

/// What may differ from the original.
#[derive(Clone, Copy)]
enum Allowed {
    /// Nothing on the standard output; on the standard error the words of the help.
    Nothing,
    /// Numbers, for this reason.
    Numbers(&'static str),
    /// So many lines of the original are not in ours, for this reason.
    Lines(usize, &'static str),
}

use Allowed::{Lines, Nothing, Numbers};

struct Case(&'static str, &'static [&'static str], Allowed);

const IDLE: &[Case] = &[
    Case("alias_all", &["alias", "1234"], Nothing),
    Case("config_none", &["config"], Nothing),
    Case("crc", &["crc"], Lines(4, "the original's ring had errors, and two slaves without links")),
    Case("cstruct", &["cstruct"], Nothing),
    Case("debug_bad", &["debug", "5"], Nothing),
    Case("domains_none", &["domains"], Nothing),
    Case("download_abort", &["download", "-p1", "0x2004", "0", "1"], Nothing),
    Case("download_range", &["download", "-p1", "-t", "uint8", "0x2003", "0", "300"], Nothing),
    Case("eoe", &["eoe"], Nothing),
    Case("foe_read", &["foe_read", "-p1", "fw.bin"], Nothing),
    Case("graph", &["graph"], Lines(0, "the last two slaves of ours have a cable")),
    Case("graph_dc", &["graph", "DC"], Lines(3, "delays of the simulation; all its clocks have a time")),
    Case("m0", &["slaves", "-m0"], Nothing),
    Case("master", &["master"], Numbers("frames of this simulation")),
    Case("pdos", &["pdos"], Nothing),
    Case("pdos_etherlab", &["pdos", "-p1", "-s", "etherlab"], Nothing),
    Case("reg_read_noarg", &["reg_read", "-p1", "0x10"], Nothing),
    Case("sdos", &["sdos", "-p1"], Lines(4, "another dictionary")),
    Case("sdos_q", &["sdos", "-q", "-p1"], Lines(1, "another dictionary")),
    Case(
        "sii_read_v",
        &["sii_read", "-v", "-p1"],
        Lines(12, "the original's SII did not hold what it showed elsewhere"),
    ),
    Case("slaves", &["slaves"], Nothing),
    Case("slaves_a1000", &["slaves", "-a1000"], Nothing),
    Case("slaves_v", &["slaves", "-v"], Lines(17, "times of this ring, links of the last slaves, bit 0 of FEATURES")),
    Case("states_bad", &["states", "XX"], Nothing),
    Case("upload_abort", &["upload", "-p1", "-t", "uint32", "0x5000", "0"], Nothing),
    Case("upload_bool", &["upload", "-p1", "-t", "bool", "0x2000", "0"], Nothing),
    Case("upload_float", &["upload", "-p1", "0x2001", "0"], Nothing),
    Case("upload_notype", &["upload", "-p1", "0x5000", "0"], Nothing),
    Case("upload_octet", &["upload", "-p1", "-t", "octet_string", "0x2002", "0"], Nothing),
    Case("upload_sm", &["upload", "-p1", "-t", "sm32", "0x2000", "0"], Nothing),
    Case("upload_str", &["upload", "-p1", "0x2002", "0"], Nothing),
    Case("upload_t", &["upload", "-p1", "-t", "int32", "0x2000", "0"], Nothing),
    Case("upload_u8", &["upload", "-p1", "-t", "uint8", "0x2000", "0"], Nothing),
    Case("xml_p1", &["xml", "-p1"], Nothing),
];

/// Cases with an application, and with what the standard ring does not have.
const OPERATION: &[Case] = &[
    Case("config", &["config"], Nothing),
    Case("config_v", &["config", "-v"], Nothing),
    Case("domains", &["domains"], Lines(1, "logical addresses are those on the wire")),
    Case("domains_v", &["domains", "-v"], Lines(5, "logical addresses and process data of this ring")),
    Case("master_op", &["master"], Numbers("frames and times of this simulation")),
    Case("slaves_op", &["slaves"], Lines(4, "slaves without a configuration stay in PREOP")),
    Case("soe_read_t", &["soe_read", "-p1", "-t", "uint32", "P-0-100"], Nothing),
];

fn place() -> Option<PathBuf> {
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join(PLACE);
    place.is_dir().then_some(place)
}

fn expected(place: &Path, name: &str) -> Done {
    let read = |suffix: &str| fs::read(place.join(format!("{name}.{suffix}"))).unwrap_or_default();
    let bytes = read("out");
    let errors = String::from_utf8_lossy(&read("err")).into_owned();
    // The original ran with a substitute for its kernel module, which reported each request.
    let err = errors.lines().filter(|line| !line.starts_with("[shim]")).map(|line| format!("{line}\n")).collect();
    let code = String::from_utf8_lossy(&read("rc")).trim().parse().ok();
    Done { out: String::from_utf8_lossy(&bytes).into_owned(), bytes, err, code }
}

/// Digits as one mark, and blanks before them as one: a number's width is that of its value.
fn masked(text: &str) -> String {
    let mut masked = String::new();
    for word in text.split_inclusive(char::is_whitespace) {
        let has_digits = word.chars().any(|it| it.is_ascii_digit());
        match (has_digits, word.trim()) {
            (true, _) => masked.push_str("N "),
            (false, "") => {}
            (false, word) => masked.push_str(&format!("{word} ")),
        }
    }
    masked
}

/// Lines of the original that are not in ours, in this order.
fn missing(wanted: &str, got: &str) -> usize {
    let (wanted, got): (Vec<&str>, Vec<&str>) = (wanted.lines().collect(), got.lines().collect());
    // Longest common subsequences of the beginnings.
    let mut common = vec![0_usize; got.len() + 1];
    for line in &wanted {
        let mut diagonal = 0;
        for (at, other) in got.iter().enumerate() {
            let above = common[at + 1];
            common[at + 1] = if line == other { diagonal + 1 } else { above.max(common[at]) };
            diagonal = above;
        }
    }
    wanted.len() - common[got.len()]
}

/// What differs between the original and ours; nothing if only the allowed does.
fn difference(case: &Case, wanted: &Done, got: &Done) -> Option<String> {
    let Case(name, words, allowed) = case;
    let first = |text: &str| text.lines().next().unwrap_or_default().to_owned();
    let is_error_same = first(&wanted.err) == first(&got.err);
    let is_output_same = match allowed {
        Nothing => wanted.bytes == got.bytes,
        Numbers(_) => masked(&wanted.out) == masked(&got.out) && wanted.bytes != got.bytes,
        Lines(lines, _) => missing(&wanted.out, &got.out) == *lines && wanted.bytes != got.bytes,
    };
    let reason = match allowed {
        Nothing => "",
        Numbers(reason) | Lines(_, reason) => reason,
    };
    if wanted.code == got.code && is_error_same && is_output_same {
        return None;
    }
    let missing = missing(&wanted.out, &got.out);
    let shown = |done: &Done| format!("{:?}\n{}{}", done.code, done.out, first(&done.err));
    Some(format!("##### {name} {words:?} ({reason}): {missing}\n{}\n--- got {}", shown(wanted), shown(got)))
}

fn compare(bench: &Bench, cases: &[Case], place: &Path) {
    let differences: Vec<String> =
        cases.iter().filter_map(|case| difference(case, &expected(place, case.0), &bench.tool(case.1))).collect();
    assert!(differences.is_empty(), "{} of {}:\n{}", differences.len(), cases.len(), differences.join("\n"));
}

/// The last SubDevice refuses PREOP, and its application stops before the error is acknowledged.
fn refuse(bench: &Bench) {
    const SILENT: DeviceIndex = DeviceIndex(3);
    bench.inside(0, |segment| {
        segment.network_mut().device_mut(SILENT).refuse_transition(AlState::PreOp, AlStatusCode(1), u32::MAX);
    });
    let stop = || {
        bench.inside(0, |segment| {
            let now = segment.network_mut().now();
            let silent = segment.network_mut().device_mut(SILENT);
            let is_refusing = silent.al_status() == AlStatus { error: true, ..AlStatus::new(AlState::Init) };
            if is_refusing {
                silent.hang(true, now);
            }
            is_refusing
        })
    };
    // The acknowledgement may be faster than this check.
    bench.wait_until("refused", || {
        bench.good(&["states", "-p3", "INIT"]);
        bench.good(&["states", "-p3", "PREOP"]);
        (0..2000).any(|_| stop())
    });
}

// covers: daemon
#[test]
fn outputs_of_an_idle_ring_are_those_of_the_original() {
    let Some(place) = place() else { return println!("skipped: no {PLACE}") };
    let directory = directory();
    let segment = segment(&directory, COE_FOE);
    let bench = Bench::start_in(directory, vec![segment]);
    refuse(&bench);
    compare(&bench, IDLE, &place);
    bench.good(&["reg_write", "-p1", "0x1400", "-t", "uint16", "0x2211"]);
    let mut image = bench.tool(&["sii_read", "-p1"]).bytes;
    image[14] ^= 1;
    let file = bench.directory.join("wrong.bin");
    fs::write(&file, image).expect("it can be written");
    let file = file.to_str().expect("it is text");
    for (name, words) in [
        ("reg_read", &["reg_read", "-p1", "0x1400", "2"][..]),
        ("reg_read_t", &["reg_read", "-p1", "-t", "uint16", "0x1400"]),
        ("sii_write_bad", &["sii_write", "-p1", file]),
    ] {
        let found = difference(&Case(name, &[], Nothing), &expected(&place, name), &bench.tool(words));
        assert_eq!(found, None);
    }
    let covered = IDLE.len() + OPERATION.len() + 3;
    let all = fs::read_dir(&place).expect("it is a directory").flatten();
    let all = all.filter(|entry| entry.path().extension().is_some_and(|it| it == "rc")).count();
    assert_eq!(covered, all, "cases of the original without one here");
}

// covers: daemon
#[test]
fn outputs_beside_an_application_are_those_of_the_original() {
    let Some(place) = place() else { return println!("skipped: no {PLACE}") };
    let directory = directory();
    let segment = segment(&directory, WITH_SOE);
    let bench = Bench::start_in(directory, vec![segment]);
    refuse(&bench);
    let _driver = Driver::start(&bench, declare);
    bench.wait_until("OP", || bench.good(&["slaves", "-p", "1,2"]).matches("  OP").count() == 2);
    bench.wait_until("a full working counter", || bench.good(&["domains"]).contains("WorkingCounter 3/3\n"));
    compare(&bench, OPERATION, &place);
}
