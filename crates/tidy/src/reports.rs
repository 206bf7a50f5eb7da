//! Events that procedures report, and procedures that they start.
//!
//! Input: a tree. Output: findings. Events are effects of the model: only `EXECUTES` reports them, all other files of
//! the acyclic half report notices, and the list of notices is that of `docs/ARCHITECTURE.md`. What the model requests
//! is started by the reconciler: only the files of `STARTS` spawn.

use crate::Finding;
use crate::tokens::{Token, tokens};
use crate::tree::Tree;

/// Files that report notices only, by the beginning of their paths.
const REPORTING: [&str; 3] =
    ["crates/engine/src/procedures/", "crates/engine/src/main_device", "crates/engine/src/mail/"];
/// Executes the effects of the model, events among them.
const EXECUTES: &str = "crates/engine/src/procedures/shared_segment.rs";
/// The type of notices.
const NOTICES: &str = "crates/engine/src/event/notice.rs";
/// The page with the list of notices, and the mark before it.
const PAGE: (&str, &str) = ("docs/ARCHITECTURE.md", "<!-- notices of the engine -->");

/// Files of the acyclic half that start procedures, each with its reason.
const STARTS: [(&str, &str); 18] = [
    ("crates/engine/src/procedures/reconcile.rs", "starts what the model requests"),
    ("crates/engine/src/procedures/serve_requests.rs", "one procedure per request of the cyclic thread"),
    ("crates/engine/src/procedures/idle/pause.rs", "ports are opened again, also without the caller"),
    ("crates/engine/src/procedures/loops.rs", "ports are opened again where an application begins"),
    ("crates/engine/src/procedures/own_objects/detection.rs", "a detection that a gateway's client orders"),
    ("crates/engine/src/mail/reader.rs", "the reader of a mailbox, as long as it is open"),
    ("crates/engine/src/mail/writer.rs", "the writer of a mailbox, as long as it is open"),
    ("crates/engine/src/mail/eoe/port.rs", "the sender of a network interface"),
    ("crates/engine/src/mail/relay/gateway_queue.rs", "one procedure per message of a gateway's client"),
    ("crates/engine/src/main_device/activate.rs", "the reconciler of an application"),
    ("crates/engine/src/main_device/idle.rs", "a call of the application: deactivation"),
    (
        "crates/engine/src/main_device/standby/follow.rs",
        "a call of the application: the model shows states of the ACTIVE",
    ),
    ("crates/engine/src/main_device/handover.rs", "a call of the application: going on with known SubDevices"),
    ("crates/engine/src/main_device/pending.rs", "services that the application calls"),
    ("crates/engine/src/main_device/scanning.rs", "a call of the application: a scan"),
    ("crates/engine/src/main_device/services/commands.rs", "reports of commands, which the application switches"),
    ("crates/engine/src/main_device/sampling.rs", "samples that the application orders"),
    ("crates/engine/src/main_device.rs", "the reconciler; a call of the application: a stop"),
];

/// Reports past the model, and notices that the page does not list.
pub fn past_the_model(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for file in tree.rust().filter(|file| is_reporting(&file.path) && file.path != EXECUTES) {
        let calls = called(&file.text, "report").into_iter().chain(called(&file.text, "report_of"));
        for line in calls {
            let text = "an event is an effect of an observation, or a `Notice` (docs/ARCHITECTURE.md)";
            findings.push(Finding::new(&file.path, line, text));
        }
    }
    findings.extend(unlisted(tree));
    findings
}

/// Procedures that are started in other files than `STARTS`.
pub fn started_elsewhere(tree: &Tree) -> Vec<Finding> {
    let may_start = |path: &str| STARTS.iter().any(|(file, _)| *file == path);
    let mut findings = Vec::new();
    for file in tree.rust().filter(|file| is_reporting(&file.path) && !may_start(&file.path)) {
        for line in called(&file.text, "spawn") {
            let text = "the model requests procedures and the reconciler starts them; other starts are listed in \
                        crates/tidy/src/reports.rs";
            findings.push(Finding::new(&file.path, line, text));
        }
    }
    findings
}

fn is_reporting(path: &str) -> bool {
    let is_test = path.split('/').any(|part| part == "tests" || part == "tests.rs");
    !is_test && REPORTING.iter().any(|directory| path.starts_with(directory))
}

/// Lines in which a method of a bus or supervisor with this name is called, tests apart.
fn called(text: &str, name: &str) -> Vec<usize> {
    let all = tokens(text);
    let owner = |token: &Token| ["bus", "supervisor", "own_bus"].iter().any(|owner| token.is_ident(owner));
    let is_call = |at: &[Token]| {
        let direct = owner(&at[0]) && at[1].is('.') && at[2].is_ident(name) && at[3].is('(');
        direct.then_some(at[2].line)
    };
    all.windows(4).filter_map(is_call).collect()
}

/// Notices that the page does not list, and rows of the page that are no notice.
fn unlisted(tree: &Tree) -> Vec<Finding> {
    let Some(file) = tree.file(NOTICES) else { return Vec::new() };
    let body = file.text.split_once("enum Notice {").map_or("", |(_, body)| body);
    let body = body.split_once("\n}").map_or(body, |(body, _)| body);
    let is_variant = |line: &&str| line.starts_with("    ") && line[4..].starts_with(|c: char| c.is_ascii_uppercase());
    let name = |line: &str| line.trim().trim_end_matches(|c: char| !c.is_alphanumeric()).to_owned();
    let variants: Vec<String> = body.lines().filter(is_variant).map(name).collect();
    let page = tree.file(PAGE.0).and_then(|page| page.text.split_once(PAGE.1)).map_or("", |(_, table)| table);
    let rows = page.trim_start().lines().take_while(|line| line.starts_with('|')).skip(2);
    let rows: Vec<String> = rows.filter_map(|row| Some(row.split('`').nth(1)?.to_owned())).collect();
    let missing = variants.iter().filter(|variant| !rows.contains(variant));
    let missing = missing.map(|variant| Finding::new(PAGE.0, 0, format!("the notice `{variant}` is not listed")));
    let odd = rows.iter().filter(|row| !variants.contains(row));
    missing.chain(odd.map(|row| Finding::new(PAGE.0, 0, format!("`{row}` is no notice of {NOTICES}")))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    fn tree(files: &[(&str, &str)]) -> Tree {
        Tree { files: files.iter().map(|(path, text)| File::new(path, text)).collect() }
    }

    const FILE: &str = "crates/engine/src/procedures/scan.rs";

    #[test]
    fn reports_past_the_model_are_found() {
        for (text, found) in [
            ("fn f(bus: &Bus) { bus.report(Event::Counted { main: 1 }); }", 1),
            ("fn f() { self.bus.report_of(event, occupant); }", 1),
            ("fn f(bus: &Bus) { bus.notice(Notice::Counted { main: 1 }); }", 0),
            ("fn f() { words.report(station); } // bus.report(event)", 0),
        ] {
            assert_eq!(past_the_model(&tree(&[(FILE, text)])).len(), found, "{text}");
            assert!(past_the_model(&tree(&[(EXECUTES, text)])).is_empty());
        }
    }

    #[test]
    fn notices_and_their_list_agree() {
        let notices = "pub(crate) enum Notice {\n    /// A.\n    Counted {\n        main: u16,\n    },\n}\n";
        let page = |rows: &str| format!("{}\n| notice | reason |\n|---|---|\n{rows}\ntext\n", PAGE.1);
        let found = |rows: &str| past_the_model(&tree(&[(NOTICES, notices), (PAGE.0, &page(rows))])).len();
        assert_eq!(found("| `Counted` | a reason |"), 0);
        assert_eq!(found("| `Other` | a reason |"), 2);
    }

    #[test]
    fn procedures_that_are_started_elsewhere_are_found() {
        let text = "fn f(bus: &Bus) { bus.spawn(watch()); }";
        assert_eq!(started_elsewhere(&tree(&[(FILE, text)])).len(), 1);
        assert!(STARTS.iter().all(|(file, _)| started_elsewhere(&tree(&[(*file, text)])).is_empty()));
        assert!(started_elsewhere(&tree(&[(FILE, "fn f() { group.spawn(read()); }")])).is_empty(), "a part");
    }
}
