//! `ringcat doctor` on the machine that runs the tests, whatever it is like.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::documented::Page;

/// The longest run of a command here: a busy machine takes its time.
const LIMIT: Duration = Duration::from_secs(60);

fn ringcat(line: &str) -> Output {
    let begin = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_ringcat"));
    let output = command.args(line.split(' ')).stdin(Stdio::null()).output().expect("the program starts");
    assert!(begin.elapsed() < LIMIT, "`{line}` took {:?}", begin.elapsed());
    output
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

// covers: bench, json, verdict
#[test]
fn the_doctor_prints_the_documented_keys_and_exits_with_1_where_something_is_bad() {
    let picture = std::env::temp_dir().join(format!("ringcat-doctor-{}.svg", std::process::id()));
    let output = ringcat(&format!("--json doctor --latency 1 --main lo --svg {}", picture.display()));
    let result = Page::read().check("doctor", &text(&output.stdout));
    let findings = result["findings"].as_array().expect("findings");
    let count = |level: &str| findings.iter().filter(|finding| finding["level"] == level).count();
    for level in ["bad", "minor", "unknown", "good"] {
        assert_eq!(result[level].as_u64(), Some(count(level) as u64), "{level}");
    }
    // The loopback is no interface for EtherCAT.
    assert!(count("bad") > 0 && findings[0]["level"] == "bad");
    assert_eq!((result["result"]["outcome"].as_str(), output.status.code()), (Some("failed"), Some(1)));
    assert!(findings.iter().all(|finding| !finding["what"].as_str().unwrap_or_default().is_empty()));
    let latency = &result["latency"];
    let wake_ups = latency["delays"]["count"].as_u64().unwrap_or_default();
    assert!((1..=1_000).contains(&wake_ups) && wake_ups + latency["skipped"].as_u64().unwrap_or_default() >= 1_000);
    let counts = latency["counts"].as_array().expect("counts").iter();
    assert_eq!(counts.map(|count| count["count"].as_u64().unwrap_or_default()).sum::<u64>(), wake_ups);
    let drawn = std::fs::read_to_string(&picture).expect("it was written");
    assert!(drawn.starts_with("<svg") && drawn.ends_with("</svg>\n"));
    std::fs::remove_file(picture).expect("it is writable");
}

// covers: bench
#[test]
fn the_text_of_the_doctor_has_80_columns_the_worst_first_and_sums_up_last() {
    for line in ["doctor --latency 0", "doctor --latency 1 --all"] {
        let output = ringcat(line);
        let said = text(&output.stdout);
        // Paths of this program, in commands, may be longer.
        let wide = |line: &&str| line.chars().count() > 80 && !line.contains(env!("CARGO_BIN_EXE_ringcat"));
        let wide: Vec<&str> = said.lines().filter(wide).collect();
        assert_eq!(wide, [""; 0]);
        let order = ["bad ", "minor ", "unknown ", "good "];
        let levels: Vec<usize> =
            said.lines().filter_map(|line| order.iter().position(|level| line.starts_with(level))).collect();
        assert!(levels.is_sorted() && levels.len() > 3, "{said}");
        let last = said.lines().last().unwrap_or_default();
        let expected = if levels.contains(&0) { ("result: FAILED: ", 1) } else { ("result: ok: nothing is bad: ", 0) };
        assert!(last.starts_with(expected.0) && output.status.code() == Some(expected.1), "{said}");
        assert!(!text(&output.stderr).contains("panicked"));
    }
}

// covers: bench, verdict
#[test]
fn what_the_doctor_cannot_do_is_refused_before_it_measures() {
    for (line, expected) in [
        ("doctor --main no-such", "there is no network interface \"no-such\""),
        ("doctor --main lo --redundant lo", "--main and --redundant name one interface, lo"),
        ("doctor --redundant lo", "the following required arguments were not provided: --main <IF>"),
        ("doctor --latency 0 --svg x.svg", "--svg draws what --latency measures"),
        ("doctor --svg /no/such/x.svg", "/no/such/x.svg cannot be written: No such file or directory"),
        ("doctor --latency 1h", "invalid value '1h' for '--latency <SECONDS>': expected a number from 0 to 86400"),
    ] {
        let output = ringcat(line);
        let errors = text(&output.stderr);
        let last = errors.lines().last().unwrap_or_default();
        assert_eq!(output.status.code(), Some(2), "{line}: {errors}");
        assert!(last.starts_with(&format!("result: FAILED: {expected}")), "{line}: {errors}");
    }
}

// covers: bench
#[test]
fn the_page_of_the_doctor_explains_each_finding() {
    let page = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/doctor.md"));
    let sources = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/src/doctor"));
    let mut ids = BTreeSet::new();
    for entry in std::fs::read_dir(sources).expect("the sources are there") {
        let path = entry.expect("an entry").path();
        let text = if path.is_file() { std::fs::read_to_string(path).expect("a source") } else { continue };
        let marked = text.split("Topic {").skip(1).filter_map(|rest| rest.split("id: \"").nth(1)?.split('"').next());
        ids.extend(marked.map(str::to_owned));
    }
    assert!(ids.len() >= 30, "{ids:?}");
    let missing: Vec<&String> = ids.iter().filter(|id| !page.contains(&format!("| `{id}` |"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// Files that a command opens for writing or makes, and requests that change an interface, as recorded by strace.
fn written(trace: &str) -> Vec<&str> {
    let calls = trace.lines().filter(|line| !line.contains(" = -1 "));
    let opens = |line: &&str| {
        let opened = line.contains("open") && ["O_WRONLY", "O_RDWR", "O_CREAT"].iter().any(|flag| line.contains(flag));
        let changed = ["mkdir", "unlink", "rename", "SIOCS", "ETHTOOL_S"].iter().any(|call| line.contains(call));
        opened || changed
    };
    calls.filter(opens).collect()
}

// covers: bench
#[test]
fn the_doctor_writes_nothing_but_the_request_of_its_measurement() {
    let trace = std::env::temp_dir().join(format!("ringcat-doctor-{}.strace", std::process::id()));
    let path = trace.display().to_string();
    let calls = "trace=open,openat,creat,mkdir,mkdirat,unlink,unlinkat,rename,renameat,renameat2,ioctl";
    let line =
        ["-f", "-o", &path, "-e", calls, env!("CARGO_BIN_EXE_ringcat"), "doctor", "--latency", "1", "--main", "lo"];
    let Ok(output) = Command::new("strace").args(line).stdin(Stdio::null()).output() else {
        println!("skipped: there is no strace");
        return;
    };
    if text(&output.stderr).contains("PTRACE_") {
        println!("skipped: strace is not permitted: {}", text(&output.stderr));
        return;
    }
    // Loopback is bad.
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let trace = std::fs::read_to_string(&path).expect("strace has written it");
    std::fs::remove_file(path).expect("it is writable");
    assert!(trace.contains("/proc/self/status"), "the looks are in the trace");
    let written: Vec<&str> =
        written(&trace).into_iter().filter(|line| !line.contains("/dev/cpu_dma_latency")).collect();
    assert_eq!(written, [""; 0]);
}
