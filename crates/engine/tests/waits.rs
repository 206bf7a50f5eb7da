//! Waits of the engine that pause for a time instead of waiting for an event: each is listed with its reason.
//!
//! Waits for states of the model, for posted words and for replies need no pause (`SharedSegment::until`,
//! `Bus::until_posted`); the model says until when such a wait lasts at most (`Segment::next_evaluation`: routine
//! rounds each second, local rings without frames every 5 ms, since silence posts nothing; the next supervision result
//! while counts settle, the end of the pause while a report is held back). `cargo test -p
//! ringcat-engine --test waits -- --nocapture` prints the list.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Why a procedure pauses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reason {
    /// Each round reads registers, memory or mail of a SubDevice, which sends no event.
    Register,
    /// A round of its own period, for the whole runtime.
    Cyclic,
    /// A frame was lost, or a step failed: it is tried again, with a limit or a growing pause.
    Retry,
    /// The segment, a controller or the wire needs this time once; nothing is polled.
    Settle,
    /// The pause keeps frames of little urgency apart.
    Pace,
    /// Another procedure or the exchange has to finish first, within a limit. No event reports its end.
    Turn,
    /// The limit of a wait for an event: what waits ends, or goes on without the event.
    Limit,
}

use Reason::{Cyclic, Limit, Pace, Register, Retry, Settle, Turn};

/// The table of docs/ARCHITECTURE.md that lists tasks with a period.
const PERIODS: &str = "<!-- polling tasks of the engine -->";
/// Files in that table without a pause of their own: when the model is evaluated (`Segment::next_evaluation`).
const EVALUATIONS: [&str; 3] = ["segment/attention.rs", "segment/idle.rs", "segment/silence.rs"];

/// The table of docs/ARCHITECTURE.md that lists pauses for another part of the engine.
const TABLE: &str = "<!-- pauses for another part of the engine -->";

/// By file or directory, each pause in its order.
const WAITS: [(&str, &[Reason]); 41] = [
    ("mail/foe.rs", &[Retry]),
    ("mail/reader.rs", &[Register]),
    ("mail/voe.rs", &[Register]),
    ("mail/writer.rs", &[Register]),
    ("procedures/al_state.rs", &[Register, Register, Register, Register]),
    ("procedures/cabling.rs", &[Settle, Register, Settle, Retry]),
    ("procedures/clocks/drift.rs", &[Retry, Pace]),
    ("procedures/clocks/slide.rs", &[Pace]),
    ("procedures/clocks/watch.rs", &[Cyclic]),
    ("procedures/command_watch.rs", &[Cyclic]),
    ("procedures/complete_siis.rs", &[Retry]),
    ("procedures/configure.rs", &[Settle, Turn]),
    ("procedures/configure/registers.rs", &[Register, Register, Register]),
    ("procedures/deactivate.rs", &[Retry]),
    ("procedures/error_watch.rs", &[Settle, Cyclic]),
    ("procedures/idle.rs", &[Cyclic]),
    ("procedures/inspect.rs", &[Pace]),
    ("procedures/junction/isolate.rs", &[Settle]),
    ("procedures/junction/refute.rs", &[Retry, Register, Retry]),
    ("procedures/loops.rs", &[Register, Register, Retry, Register]),
    ("procedures/mail_watch.rs", &[Cyclic]),
    ("procedures/mirror.rs", &[Cyclic]),
    ("procedures/presence.rs", &[Register]),
    ("procedures/recover.rs", &[Retry, Retry, Retry]),
    ("procedures/resume.rs", &[Retry]),
    ("procedures/sample.rs", &[Cyclic]),
    ("procedures/scan.rs", &[Register]),
    ("procedures/scan/count.rs", &[Register, Register, Register]),
    ("procedures/services/statistics.rs", &[Cyclic]),
    ("procedures/sii.rs", &[Turn]),
    ("procedures/sii/eeprom.rs", &[Register, Register, Register]),
    ("procedures/sii/program.rs", &[Retry, Register]),
    ("procedures/stop.rs", &[Retry, Register]),
    ("procedures/unassigned.rs", &[Retry]),
    ("procedures/unassigned/quiet.rs", &[Register]),
    ("procedures/unassigned/rescan.rs", &[Retry, Retry]),
    ("procedures/undeclared/bring.rs", &[Register, Retry, Cyclic, Cyclic]),
    ("procedures/undeclared/dictionaries.rs", &[Settle]),
    ("procedures/undeclared/mail.rs", &[Cyclic]),
    ("procedures/verify.rs", &[Cyclic]),
    ("supervisor", &[Settle, Pace]),
];

/// By file, each wait for an event with a limit (`Bus::within`), in its order. In a loop the limit is a period.
const WITHIN: [(&str, &[Reason]); 20] = [
    ("mail/conversation.rs", &[Limit, Limit, Limit]),
    ("mail/mailbox.rs", &[Limit]),
    ("mail/reader.rs", &[Register]),
    ("mail/relay/gateway_queue.rs", &[Limit]),
    ("procedures/cabling.rs", &[Limit]),
    ("procedures/clocks/drift.rs", &[Limit]),
    ("procedures/clocks/signals.rs", &[Limit, Limit, Limit]),
    ("procedures/complete_siis.rs", &[Limit]),
    ("procedures/deactivate.rs", &[Limit, Limit, Limit, Limit]),
    ("procedures/dictionary.rs", &[Limit]),
    ("procedures/idle/pause.rs", &[Limit]),
    ("procedures/idle/rescue.rs", &[Limit]),
    // What has been read so far is used in each pause.
    ("procedures/inspect.rs", &[Pace]),
    ("procedures/loops.rs", &[Limit]),
    ("procedures/recover.rs", &[Retry]),
    ("procedures/request_states.rs", &[Limit]),
    ("procedures/serve_requests.rs", &[Limit]),
    ("procedures/services/statistics.rs", &[Cyclic]),
    ("procedures/shared_segment.rs", &[Limit, Limit]),
    ("procedures/undeclared/keep.rs", &[Retry]),
];

#[test]
fn each_wait_that_pauses_for_a_time_has_a_reason() {
    let mut wrong = without_reason(&WAITS, &CALLS);
    let table = table(TABLE);
    let is_internal = |reasons: &[Reason]| reasons.iter().any(|reason| matches!(reason, Turn | Pace));
    let unnamed = WAITS.iter().filter(|(group, reasons)| is_internal(reasons) && !table.contains(group));
    wrong.extend(unnamed.map(|(group, _)| format!("{group}: not in the table of docs/ARCHITECTURE.md")));
    assert!(wrong.is_empty(), "each pause needs its reason in WAITS: {wrong:#?}");
}

#[test]
fn each_wait_for_an_event_has_a_limit_or_a_period_with_a_reason() {
    let wrong = without_reason(&WITHIN, &[".within("]);
    assert!(wrong.is_empty(), "each limit needs its reason in WITHIN: {wrong:#?}");
}

#[test]
fn tasks_with_a_period_are_those_of_the_page() {
    let cyclic = |(_, reasons): &&(&'static str, &[Reason])| reasons.contains(&Cyclic);
    let with_pause = WAITS.iter().chain(&WITHIN).filter(cyclic).map(|(file, _)| *file);
    let expected: BTreeSet<&str> = with_pause.chain(EVALUATIONS).collect();
    let table = table(PERIODS);
    let rows = table.lines().filter(|line| line.starts_with("| ")).skip(1);
    let named: BTreeSet<&str> = rows
        .flat_map(|row| row.split('|').nth(1).unwrap_or_default().split('`').skip(1).step_by(2))
        .filter(|name| name.ends_with(".rs"))
        .collect();
    assert_eq!(named, expected, "the table {PERIODS} of docs/ARCHITECTURE.md");
}

/// The table behind a mark in docs/ARCHITECTURE.md.
fn table(mark: &str) -> String {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/ARCHITECTURE.md");
    let page = fs::read_to_string(page).expect("the map of the engine");
    let behind = page.split_once(mark).expect("the mark of the table").1.trim_start();
    behind.split("\n\n").next().unwrap_or_default().to_owned()
}

/// Calls in the sources without a reason in a list, and files in the list without such a call.
fn without_reason(list: &[(&'static str, &[Reason])], calls: &[&str]) -> Vec<String> {
    let found = calls_by_file(calls);
    let listed: BTreeMap<&str, &[Reason]> = list.iter().copied().collect();
    let mut wrong = Vec::new();
    for (group, pauses) in &found {
        let reasons = listed.get(group.as_str()).copied().unwrap_or_default();
        for (at, pause) in pauses.iter().enumerate() {
            let reason = reasons.get(at).map_or("-".into(), |reason| format!("{reason:?}"));
            println!("{reason:8} {pause}");
        }
        if reasons.len() != pauses.len() {
            wrong.push(format!("{group}: {} waits, {} reasons", pauses.len(), reasons.len()));
        }
    }
    wrong.extend(listed.keys().filter(|group| !found.contains_key(**group)).map(|group| format!("{group}: none left")));
    wrong
}

/// Lines of the sources with one of these calls, by file; those of the supervisor together.
fn calls_by_file(calls: &[&str]) -> BTreeMap<String, Vec<String>> {
    let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for path in sources(&src) {
        let name = path.strip_prefix(&src).expect("below src").to_string_lossy().replace('\\', "/");
        let group = if name.starts_with("supervisor/") { "supervisor".to_string() } else { name.clone() };
        let text = fs::read_to_string(&path).expect("a source");
        let has_call = |line: &str| calls.iter().any(|call| line.contains(call));
        let is_code = |line: &str| !line.trim_start().starts_with("//") && has_call(line);
        let lines = text.lines().enumerate().filter(|(_, line)| is_code(line));
        let lines: Vec<String> = lines.map(|(at, line)| format!("{name}:{}: {}", at + 1, line.trim())).collect();
        if !lines.is_empty() {
            found.entry(group).or_default().extend(lines);
        }
    }
    found
}

/// Calls that return after a time although nothing has changed.
const CALLS: [&str; 5] = [".sleep(", ".sleep_until(", "conversation.pause(", ".unsolicited_within(", ".until_period("];

/// All sources below a directory, without tests.
fn sources(directory: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(directory).expect("a directory");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    let mut all = Vec::new();
    for path in paths {
        let is_test = path.file_stem().is_some_and(|stem| stem == "tests");
        if path.is_dir() && !is_test {
            all.extend(sources(&path));
        } else if !is_test && path.extension().is_some_and(|extension| extension == "rs") {
            all.push(path);
        }
    }
    all
}
