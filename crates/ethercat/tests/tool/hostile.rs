//! Arguments at random: no panic, no other exit code than 0 and 1, nothing that lasts.

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::time::{Duration, Instant};

use crate::bench::{Bench, LONG, directory, tool_with};
use crate::golden_bus::{WITH_SOE, segment};
use crate::several::ring;
use ethercat::commands::ALL;

/// Runs of the tool as a library, with a socket in a directory of its own: a daemon of this machine is left alone.
const RUNS: u64 = 20_000;
/// Runs of the program.
const PROGRAM_RUNS: u64 = 60;
/// Runs of the program with a daemon that has two masters.
const DAEMON_RUNS: u64 = 300;

/// Numbers from a seed (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }
}

const WORDS: [&str; 39] = [
    "-",
    "--",
    "-v",
    "-f",
    "-q",
    "-e",
    "-h",
    "-p",
    "-a",
    "-m",
    "-d",
    "-t",
    "-s",
    "-o",
    "--type",
    "--type=",
    "--json",
    "--=",
    "--",
    "-p-",
    "-m0-",
    "0",
    "-1",
    "0x10000",
    "99999999999999999999",
    "00",
    "08",
    "1-0",
    "reset",
    "DC",
    "S-0-100",
    "OP",
    "uint8",
    "string",
    "addr",
    "1.2.3.4/33",
    "a:b:c",
    "",
    "\u{2193}\u{0}",
];

fn words(numbers: &mut Numbers) -> Vec<OsString> {
    let count = numbers.below(7);
    let mut words: Vec<OsString> = (0..count)
        .map(|_| match numbers.below(8) {
            0 => OsString::from_vec((0..numbers.below(6)).map(|_| numbers.next() as u8).collect()),
            1 => ALL[numbers.below(ALL.len())].name.into(),
            _ => WORDS[numbers.below(WORDS.len())].into(),
        })
        .collect();
    if numbers.below(4) != 0 {
        words.insert(0, ALL[numbers.below(ALL.len())].name.into());
    }
    // Neither files nor the standard input of the test are read, and no name is looked up.
    let reads = ["foe_write", "sii_write", "reg_write", "download", "soe_write", "ip"];
    let is_reading = |word: &OsString| word.to_str().is_some_and(|word| reads.contains(&word));
    let is_source = |word: &OsString| word.to_str().is_none_or(|word| ["-", "addr"].contains(&word));
    if words.iter().any(is_reading) && words.iter().any(is_source) { vec!["version".into()] } else { words }
}

// covers: daemon
#[test]
fn no_arguments_make_the_tool_panic_or_last() {
    let nowhere = directory();
    let mut numbers = Numbers(1);
    let begin = Instant::now();
    for run in 0..RUNS {
        let words = words(&mut numbers);
        let (mut output, mut errors) = (Vec::new(), Vec::new());
        let is_good = ethercat::run(&words, &nowhere.join("nothing"), &mut output, &mut errors);
        // Where no daemon is, only versions and help are right, and each failure says why.
        assert!(if is_good { !output.is_empty() } else { !errors.is_empty() }, "run {run}: {words:?}");
    }
    for run in 0..PROGRAM_RUNS {
        let words: Vec<OsString> =
            words(&mut numbers).into_iter().filter(|word| !word.as_encoded_bytes().contains(&0)).collect();
        let done = tool_with(&nowhere.join("nothing"), &words);
        assert!(matches!(done.code, Some(0 | 1)) && !done.err.contains("panicked"), "run {run}: {words:?} {done:?}");
    }
    assert!(begin.elapsed() < Duration::from_secs(120));
    std::fs::remove_dir(nowhere).expect("it is empty");
}

// covers: daemon
#[test]
fn no_arguments_beside_a_bus_make_the_tool_panic_or_last() {
    let samples = directory();
    let bench = Bench::start(vec![segment(&samples, WITH_SOE), ring(3, true)]);
    let mut numbers = Numbers(2);
    let mut good = 0;
    for run in 0..DAEMON_RUNS {
        let words: Vec<OsString> =
            words(&mut numbers).into_iter().filter(|word| !word.as_encoded_bytes().contains(&0)).collect();
        let begin = Instant::now();
        let done = tool_with(&bench.socket, &words);
        assert!(matches!(done.code, Some(0 | 1)) && !done.err.contains("panicked"), "run {run}: {words:?} {done:?}");
        assert!(done.code == Some(0) || !done.err.is_empty(), "run {run}: {words:?} {done:?}");
        assert!(begin.elapsed() < LONG, "run {run}: {words:?} {done:?}");
        good += u32::from(done.code == Some(0));
    }
    // A fair part reaches the bus, and the daemon serves both masters as before.
    assert!(good > 30, "{good} of {DAEMON_RUNS}");
    let listed = bench.good(&["slaves"]);
    assert_eq!(listed.lines().filter(|line| !line.starts_with("Master")).count(), 4 + 3, "{listed}");
    std::fs::remove_dir_all(samples).expect("it is there");
}
