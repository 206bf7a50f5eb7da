//! Situations in which something does not hold, and what the program says last: `result: FAILED: ...` and an exit
//! status that is not 0. Those that need no network interface; the others are in `crates/scenarios/tests/on_the_wire`.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where the standard output goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Output {
    Read,
    /// A disk without room.
    Full,
}

use Output::{Full, Read};

/// Files of the situations, by their names in the command lines.
const FILES: [(&str, &str); 9] = [
    ("empty.toml", "[segment]\nring = true\n"),
    ("line.toml", "[[device]]\ntype = \"coupler\"\n"),
    ("unknown.toml", "[[device]]\ntype = \"digital-otput-8\"\n"),
    ("kind.toml", "[[device]]\ntype = \"coupler\"\ncount = \"two\"\n"),
    ("image.toml", "[[device]]\nsii = \"no-such.bin\"\n"),
    ("network.toml", "ringcat_network = 1\n[[domain]]\nname = \"d\"\nperiod = \"1ms\"\n[[subdevice]]\nname = \"A\"\n"),
    (
        "preop.toml",
        "ringcat_network = 1\n[[domain]]\nname = \"d\"\nperiod = \"1ms\"\n\
         [[subdevice]]\nname = \"A\"\ntarget = \"PREOP\"\n",
    ),
    ("broken.xml", "<EtherCATConfig><Config>"),
    (
        "empty.xml",
        "<EtherCATConfig Version=\"1.3\"><Config><Master><Info><Name>M</Name></Info>\
         </Master></Config></EtherCATConfig>",
    ),
];

/// Command line, with `DIR` for the files; where its output goes; exit status; beginning of the last line behind
/// `result: FAILED: `.
const SITUATIONS: [(&str, Output, i32, &str); 56] = [
    // The command line.
    ("nonsense", Read, 2, "unrecognized subcommand 'nonsense'"),
    ("scan", Read, 2, "the following required arguments were not provided: --main <IF>"),
    (
        "compare --main lo",
        Read,
        2,
        "the following required arguments were not provided: <--eni <FILE>|--network <FILE.toml>>",
    ),
    ("run --main lo --cycle 1us", Read, 2, "invalid value '1us' for '--cycle <TIME>': expected 10us to 1s"),
    ("run --main lo --cycle 100s", Read, 2, "invalid value '100s' for '--cycle <TIME>': expected 10us to 1s"),
    ("run --main lo --cycle 0ms", Read, 2, "invalid value '0ms' for '--cycle <TIME>': expected more than zero"),
    ("clocks --main lo --cycle 2s", Read, 2, "invalid value '2s' for '--cycle <TIME>': expected 10us to 1s"),
    ("run --main lo --for 0s", Read, 2, "invalid value '0s' for '--for <TIME>': expected more than zero"),
    (
        "run --main lo --priority 99",
        Read,
        2,
        "invalid value '99' for '--priority <1-98>': expected a number from 1 to 98, as in 80",
    ),
    (
        "run --main lo --under-way 0",
        Read,
        2,
        "invalid value '0' for '--under-way <CYCLES>': expected a number from 1 to 4, as in 2",
    ),
    (
        "run --main lo --gateway nowhere",
        Read,
        2,
        "invalid value 'nowhere' for '--gateway [<ADDR[:PORT]>]': expected an address",
    ),
    ("clocks --main lo --sync 3", Read, 2, "invalid value '3' for '--sync <SIGNALS>': expected auto or POSITION:SYNC0"),
    (
        "clocks --main lo --reference last",
        Read,
        2,
        "invalid value 'last' for '--reference <CLOCK>': expected first, sync or",
    ),
    (
        "demo --cycle-us 10",
        Read,
        2,
        "invalid value '10' for '--cycle-us <US>': expected a number from 50 to 1000000, as in 1000",
    ),
    ("sim --main lo", Read, 2, "the following required arguments were not provided: --segment <FILE.toml>"),
    // One interface given twice.
    ("run --main lo --redundant lo", Read, 2, "--main and --redundant name one interface, lo"),
    ("scan --main lo --redundant lo", Read, 2, "--main and --redundant name one interface, lo"),
    ("ring --main lo --redundant lo", Read, 2, "--main and --redundant name one interface, lo"),
    ("clocks --main lo --redundant lo", Read, 2, "--main and --redundant name one interface, lo"),
    ("capture --main lo --redundant lo --out DIR/x", Read, 2, "--main and --redundant name one interface, lo"),
    ("sim --main lo --redundant lo --segment DIR/line.toml", Read, 2, "--main and --redundant name one interface, lo"),
    // Interfaces that are not there, or none for EtherCAT.
    ("scan --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("run --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("ring --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("clocks --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("capture --main no-such --out DIR/x", Read, 2, "there is no network interface \"no-such\""),
    ("sim --main no-such --segment DIR/line.toml", Read, 2, "there is no network interface \"no-such\""),
    ("bench cycles --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("bench rate --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("bench round-trip --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("bench echo --main no-such", Read, 2, "there is no network interface \"no-such\""),
    ("scan --main lo", Read, 2, "lo is not an Ethernet interface"),
    // Files.
    ("demo --segment DIR/missing.toml", Read, 2, "DIR/missing.toml: cannot be read: No such file or directory"),
    ("demo --segment DIR/unknown.toml", Read, 2, "DIR/unknown.toml:2: "),
    (
        "demo --segment DIR/kind.toml",
        Read,
        2,
        "DIR/kind.toml:3: device \"coupler\": count: expected a whole number, not negative, got the text \"two\"",
    ),
    ("demo --segment DIR/image.toml", Read, 2, "DIR/image.toml:"),
    ("demo --segment DIR/empty.toml", Read, 2, "DIR/empty.toml:2: ring: expected a device to close"),
    ("sim --main lo --segment DIR/empty.toml", Read, 2, "DIR/empty.toml:2: ring: expected a device to close"),
    (
        "sim --main lo --redundant eth9 --segment DIR/line.toml",
        Read,
        2,
        "DIR/line.toml is no ring, so nothing can be plugged into eth9",
    ),
    ("eni DIR/missing.xml", Read, 2, "DIR/missing.xml: cannot be read: No such file or directory"),
    ("eni DIR/broken.xml", Read, 2, "DIR/broken.xml: "),
    ("eni DIR/empty.xml", Read, 1, "the file describes no SubDevice"),
    ("run --main lo --eni DIR/empty.xml", Read, 2, "DIR/empty.xml: the file describes no SubDevice"),
    (
        "clocks --main lo --plot DIR/missing/x.svg",
        Read,
        2,
        "DIR/missing/x.svg cannot be written: No such file or directory",
    ),
    (
        "eni export --network DIR/preop.toml",
        Read,
        2,
        "DIR/preop.toml:7: SubDevice \"A\": subdevice[0].target: PREOP: an ENI describes a network in OP",
    ),
    // Options about clocks that a file decides: before anything is sent.
    (
        "run --main no-such --eni EXAMPLES/machine.eni.xml --reference first",
        Read,
        2,
        "--reference: with --eni or --network the reference clock is that of the file",
    ),
    (
        "run --main no-such --eni EXAMPLES/machine.eni.xml --sync auto",
        Read,
        2,
        "--sync: with --eni or --network the SYNC signals are those of the file",
    ),
    (
        "run --main no-such --network DIR/network.toml --reference first",
        Read,
        2,
        "--reference: with --eni or --network the reference clock is that of the file",
    ),
    (
        "run --main no-such --network DIR/network.toml --sync auto",
        Read,
        2,
        "--sync: with --eni or --network the SYNC signals are those of the file",
    ),
    (
        "standby --main no-such --redundant no-other --eni EXAMPLES/machine.eni.xml --reference first",
        Read,
        2,
        "--reference: with --eni or --network the reference clock is that of the file",
    ),
    (
        "standby --main no-such --redundant no-other --eni EXAMPLES/machine.eni.xml --sync auto",
        Read,
        2,
        "--sync: with --eni or --network the SYNC signals are those of the file",
    ),
    (
        "standby --main no-such --redundant no-other --network DIR/network.toml --reference first",
        Read,
        2,
        "--reference: with --eni or --network the reference clock is that of the file",
    ),
    (
        "standby --main no-such --redundant no-other --network DIR/network.toml --sync auto",
        Read,
        2,
        "--sync: with --eni or --network the SYNC signals are those of the file",
    ),
    // A standard output that takes nothing.
    ("demo --fast", Full, 1, "the standard output cannot be written: No space left on device"),
    ("eni EXAMPLES/machine.eni.xml", Full, 1, "the standard output cannot be written: No space left on device"),
    ("eni --json EXAMPLES/machine.eni.xml", Full, 1, "the standard output cannot be written: No space left on device"),
];

/// Runs a command line; its exit status, and the last line of all that it says.
fn run(line: &str, output: Output) -> (Option<i32>, String) {
    let stdout = match output {
        Read => Stdio::piped(),
        Full => File::options().write(true).open("/dev/full").expect("a system with /dev/full").into(),
    };
    let mut command = Command::new(env!("CARGO_BIN_EXE_ringcat"));
    let output =
        command.args(line.split(' ')).stdin(Stdio::null()).stdout(stdout).output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_end().to_owned();
    let (said, errors) = (text(&output.stdout), text(&output.stderr));
    // The result is the last line of one of the two.
    let last = |text: &str| text.lines().last().unwrap_or_default().to_owned();
    let lasts = [last(&errors), last(&said)];
    let result = lasts.iter().find(|line| line.starts_with("result: ")).cloned();
    let results = [&said, &errors].map(|text| text.matches("result: FAILED").count()).iter().sum::<usize>();
    assert!(results <= 1, "`{line}` says more than once what did not hold:\n{said}\n{errors}");
    (output.status.code(), result.unwrap_or_else(|| format!("no result, but:\n{said}\n{errors}")))
}

fn files() -> PathBuf {
    let directory = std::env::temp_dir().join(format!("ringcat-exit-codes-{}", std::process::id()));
    fs::create_dir_all(&directory).expect("the temporary directory is writable");
    for (name, text) in FILES {
        fs::write(directory.join(name), text).expect("it is writable");
    }
    directory
}

// covers: verdict
#[test]
fn what_does_not_hold_is_said_last_and_none_of_it_exits_with_0() {
    let directory = files();
    let here = |path: &Path| path.display().to_string();
    let examples = format!("{}/../ringcat/examples", env!("CARGO_MANIFEST_DIR"));
    let mut wrong = Vec::new();
    for (line, output, status, expected) in SITUATIONS {
        let line = line.replace("DIR", &here(&directory)).replace("EXAMPLES", &examples);
        let expected = expected.replace("DIR", &here(&directory));
        let expected = format!("result: FAILED: {expected}");
        let (code, said) = run(&line, output);
        if code != Some(status) || !said.starts_with(&expected) {
            wrong.push(format!("`{line}` -> {code:?}, expected {status}\n  {said}\n  expected {expected}"));
        }
    }
    fs::remove_dir_all(&directory).expect("it is writable");
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), SITUATIONS.len(), wrong.join("\n"));
}

// covers: verdict
#[test]
fn what_holds_is_said_last_too() {
    let examples = format!("{}/../ringcat/examples", env!("CARGO_MANIFEST_DIR"));
    for (line, expected) in [
        ("demo --fast".to_owned(), "result: ok: everything held"),
        (format!("eni {examples}/machine.eni.xml"), "result: ok: "),
        (format!("eni --json {examples}/machine.eni.xml"), "result: ok: "),
    ] {
        let (code, said) = run(&line, Read);
        assert!(code == Some(0) && said.starts_with(expected), "`{line}` -> {code:?}: {said}");
    }
    let help = Command::new(env!("CARGO_BIN_EXE_ringcat")).arg("--help").output().expect("the program starts");
    assert!(help.status.success() && !String::from_utf8_lossy(&help.stdout).contains("\nresult: "));
}
