//! Commands that change something, and those that print files for other programs, in each situation of a bus: idle and
//! beside an application in OP, with a whole and a broken ring, and while a SubDevice is in BOOT.

use ringcat::sim::application::foe::firmware::image;
use ringcat::sim::cable::CableId;
use ringcat::sim::fault::Fault;

use crate::bench::{Bench, Driver, directory};
use crate::golden_bus::{WITH_SOE, ring};
use crate::operation::declare;

/// The state of the bus around the commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Situation {
    Whole,
    Broken,
    /// SubDevice 1, which the commands are for, is in BOOT.
    Boot,
}

/// Where a command works. A mailbox in BOOT has FoE only, and only for the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Where {
    Anywhere,
    NotInBoot,
    InBoot,
}

use Where::{Anywhere, InBoot, NotInBoot};

/// A command, and what is seen after it. `F` in the words is a file, `W` the firmware, `V` a value that is new in each
/// situation.
struct Check(&'static str, Where, fn(&Bench, &str) -> bool);

const CHECKS: [Check; 15] = [
    Check("alias -f -p2 V", Anywhere, |bench, value| {
        let value: u16 = value.parse().expect("a number");
        bench.tool(&["sii_read", "-p2"]).bytes[8..10] == value.to_le_bytes()
    }),
    Check("sii_write -p2 F", Anywhere, |bench, _| bench.tool(&["sii_read", "-p2"]).bytes == file(bench)),
    Check("reg_write -p1 0x0F80 -t uint16 V", Anywhere, |bench, value| {
        bench.good(&["reg_read", "-p1", "0x0F80", "-t", "uint16"]).ends_with(&format!(" {value}\n"))
    }),
    Check("reg_write -e -p2 0x0F80 -t uint16 V", Anywhere, |bench, value| {
        bench.good(&["reg_read", "-p2", "0x0F80", "-t", "uint16"]).ends_with(&format!(" {value}\n"))
    }),
    Check("download -p1 0x2003 0 V", NotInBoot, |bench, value| {
        bench.good(&["upload", "-p1", "0x2003", "0"]).ends_with(&format!(" {value}\n"))
    }),
    Check("soe_write -p1 P-0-150 -t uint16 V", NotInBoot, |bench, value| {
        bench.good(&["soe_read", "-p1", "P-0-150", "-t", "uint16"]).ends_with(&format!(" {value}\n"))
    }),
    Check("foe_write -p1 -o V.bin F", NotInBoot, |bench, value| {
        bench.tool(&["foe_read", "-p1", &format!("{value}.bin")]).bytes == file(bench)
    }),
    Check("foe_write -p1 W", InBoot, |bench, _| bench.tool(&["foe_read", "-p1", FIRMWARE]).bytes == firmware()),
    Check("ip -p4 addr 10.0.0.V", Anywhere, |_, _| true),
    Check("debug 1", Anywhere, |bench, _| bench.good(&["debug", "0"]).is_empty()),
    Check("rescan", Anywhere, |bench, _| {
        // On a busy machine frames are lost now and then: a slave without an answer is shown until the next one.
        bench.wait_until("all answer", || bench.good(&["slaves"]).matches("  +  ").count() >= 4);
        true
    }),
    Check("crc reset", Anywhere, |bench, _| bench.good(&["crc"]).lines().count() >= 7),
    Check("eoe", Anywhere, |bench, _| bench.good(&["eoe", "--json"]).contains("\"interfaces\":[]")),
    Check("xml -p1", Anywhere, |bench, _| {
        let text = bench.good(&["xml", "-p1"]);
        roxmltree::Document::parse(&text).is_ok_and(|xml| xml.descendants().any(|it| it.has_tag_name("TxPdo")))
    }),
    Check("cstruct -p1", Anywhere, |bench, _| bench.good(&["cstruct", "-p1"]).contains("{0x1a00, 2, slave_1_pdo")),
];

/// The name of the firmware.
const FIRMWARE: &str = "firmware.bin";

fn firmware() -> Vec<u8> {
    image("2.0", &[0x55; 5_000])
}

/// The file of the commands: an SII of SubDevice 2.
fn file(bench: &Bench) -> Vec<u8> {
    std::fs::read(bench.directory.join("file")).expect("it is there")
}

fn words(bench: &Bench, check: &Check, value: &str) -> Vec<String> {
    let file = bench.directory.join("file");
    let word = |word: &str| match word {
        "F" => file.to_str().expect("it is text").to_owned(),
        "W" => bench.directory.join(FIRMWARE).to_str().expect("it is text").to_owned(),
        word => word.replace('V', value),
    };
    check.0.split(' ').map(word).collect()
}

/// All commands in a situation. The state of SubDevice 1 and of the ring outlast each.
fn all(bench: &Bench, situation: Situation, state: &str, first: u16) {
    for (check, value) in CHECKS.iter().zip(first..) {
        let value = value.to_string();
        let words = words(bench, check, &value);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        if matches!((situation == Situation::Boot, check.1), (true, NotInBoot) | (false, InBoot)) {
            assert!(!bench.bad(&words).is_empty(), "{situation:?} {words:?}");
        } else {
            let done = bench.tool(&words);
            assert!(done.code == Some(0) && done.err.is_empty(), "{situation:?} {words:?}: {done:?}");
            assert!((check.2)(bench, &value), "{situation:?} {words:?}");
        }
        let listed = bench.good(&["slaves"]);
        assert_eq!(listed.contains("xxx LINK FAILURE xxx"), situation == Situation::Broken, "{words:?}: {listed}");
        assert!(bench.good(&["slaves", "-p1"]).contains(state), "{situation:?} {words:?}: {listed}");
    }
}

// covers: daemon, foe
#[test]
fn commands_work_in_every_situation_of_a_bus() {
    let directory = directory();
    let segment = ring(&directory, WITH_SOE);
    let bench = Bench::start_in(directory, vec![segment]);
    std::fs::write(bench.directory.join("file"), bench.tool(&["sii_read", "-p2"]).bytes).expect("it can be written");
    std::fs::write(bench.directory.join(FIRMWARE), firmware()).expect("it can be written");
    let cut = |is_cut: bool| {
        let fault = if is_cut { Fault::Cut(CableId(2)) } else { Fault::Heal(CableId(2)) };
        bench.inside(0, move |segment| segment.network_mut().apply(fault));
        bench.wait_until("the ring", || bench.good(&["slaves"]).contains("xxx LINK FAILURE") == is_cut);
    };
    let mut value = 10;
    for usual in ["  PREOP  ", "  OP  "] {
        let driver = (usual == "  OP  ").then(|| Driver::start(&bench, declare));
        let is_in = |state: &str| bench.good(&["slaves", "-p1"]).contains(state);
        for situation in [Situation::Whole, Situation::Broken, Situation::Boot] {
            bench.wait_until(usual, || is_in(usual));
            let state = if situation == Situation::Boot { "  BOOT  " } else { usual };
            match situation {
                Situation::Whole => {}
                Situation::Broken => cut(true),
                Situation::Boot => {
                    assert_eq!(bench.good(&["states", "-p1", "BOOT"]), "");
                    bench.wait_until("BOOT", || is_in(state));
                }
            }
            all(&bench, situation, state, value);
            value += CHECKS.len() as u16;
            match situation {
                Situation::Whole => {}
                Situation::Broken => cut(false),
                Situation::Boot => assert_eq!(bench.good(&["states", "-p1", usual.trim()]), ""),
            }
        }
        bench.wait_until(usual, || is_in(usual));
        drop(driver);
    }
}
