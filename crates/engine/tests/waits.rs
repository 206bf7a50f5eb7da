//! Waits of the engine that pause for a time instead of waiting for an event: each is listed with its reason.
//!
//! Waits for states of the model, for posted words and for replies need no pause (`SharedSegment::until`,
//! `Bus::until_posted`); the model says until when such a wait lasts at most (`Segment::next_evaluation`: routine
//! rounds each second, local rings without frames every 5 ms, since silence posts nothing; the next supervision result
//! while counts settle, the end of the pause while a report is held back). `cargo test -p
//! ringcat-engine --test waits -- --nocapture` prints the list.

use std::collections::BTreeMap;
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
}

use Reason::{Cyclic, Pace, Register, Retry, Settle, Turn};

/// The table of docs/ARCHITECTURE.md that lists pauses for another part of the engine.
const TABLE: &str = "<!-- pauses for another part of the engine -->";

/// By file or directory, each pause in its order.
const WAITS: [(&str, &[Reason]); 41] = [
    ("mail/foe.rs", &[Retry]),
    ("mail/reader.rs", &[Register]),
    ("mail/voe.rs", &[Register]),
    ("mail/writer.rs", &[Register]),
    ("procedures/al_state.rs", &[Register, Register, Register]),
    ("procedures/cabling.rs", &[Settle, Register, Settle, Retry]),
    ("procedures/clocks/drift.rs", &[Retry, Pace]),
    ("procedures/clocks/measure.rs", &[Register]),
    ("procedures/clocks/slide.rs", &[Pace]),
    ("procedures/clocks/watch.rs", &[Register]),
    ("procedures/command_watch.rs", &[Cyclic]),
    ("procedures/complete_siis.rs", &[Retry]),
    ("procedures/configure.rs", &[Settle, Turn]),
    ("procedures/configure/registers.rs", &[Register, Register, Register]),
    ("procedures/deactivate.rs", &[Retry]),
    ("procedures/error_watch.rs", &[Settle, Cyclic]),
    ("procedures/idle.rs", &[Cyclic]),
    ("procedures/inspect.rs", &[Pace]),
    ("procedures/junction/isolate.rs", &[Settle]),
    ("procedures/junction/learn.rs", &[Settle]),
    ("procedures/junction/refute.rs", &[Retry]),
    ("procedures/loops.rs", &[Register]),
    ("procedures/mail_watch.rs", &[Cyclic]),
    ("procedures/presence.rs", &[Register]),
    ("procedures/recover.rs", &[Retry, Retry]),
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
    ("procedures/undeclared/mail.rs", &[Cyclic]),
    ("procedures/verify.rs", &[Cyclic]),
    ("supervisor", &[Settle, Pace]),
];

#[test]
fn each_wait_that_pauses_for_a_time_has_a_reason() {
    let mut found: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for path in sources(&src) {
        let name = path.strip_prefix(&src).expect("below src").to_string_lossy().replace('\\', "/");
        let group = if name.starts_with("supervisor/") { "supervisor".to_string() } else { name.clone() };
        let text = fs::read_to_string(&path).expect("a source");
        let pauses = text.lines().enumerate().filter(|(_, line)| is_pause(line));
        let pauses: Vec<String> = pauses.map(|(at, line)| format!("{name}:{}: {}", at + 1, line.trim())).collect();
        if !pauses.is_empty() {
            found.entry(group).or_default().extend(pauses);
        }
    }
    let listed: BTreeMap<&str, &[Reason]> = WAITS.into_iter().collect();
    let mut wrong = Vec::new();
    for (group, pauses) in &found {
        let reasons = listed.get(group.as_str()).copied().unwrap_or_default();
        for (at, pause) in pauses.iter().enumerate() {
            let reason = reasons.get(at).map_or("-".into(), |reason| format!("{reason:?}"));
            println!("{reason:8} {pause}");
        }
        if reasons.len() != pauses.len() {
            wrong.push(format!("{group}: {} pauses, {} reasons", pauses.len(), reasons.len()));
        }
    }
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/ARCHITECTURE.md");
    let page = fs::read_to_string(page).expect("the map of the engine");
    let table = page.split_once(TABLE).map_or("", |(_, table)| table.trim_start().split("\n\n").next().unwrap_or(""));
    let is_internal = |reasons: &[Reason]| reasons.iter().any(|reason| matches!(reason, Turn | Pace));
    let unnamed = WAITS.iter().filter(|(group, reasons)| is_internal(reasons) && !table.contains(group));
    wrong.extend(unnamed.map(|(group, _)| format!("{group}: not in the table of docs/ARCHITECTURE.md")));
    wrong.extend(listed.keys().filter(|group| !found.contains_key(**group)).map(|group| format!("{group}: none left")));
    assert!(wrong.is_empty(), "each pause needs its reason in WAITS: {wrong:#?}");
}

/// Calls that return after a time although nothing has changed.
const CALLS: [&str; 5] = [".sleep(", ".sleep_until(", "conversation.pause(", ".unsolicited_within(", ".until_period("];

fn is_pause(line: &str) -> bool {
    let is_comment = line.trim_start().starts_with("//");
    !is_comment && CALLS.iter().any(|call| line.contains(call))
}

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
