//! What the lines of the engine consist of: code, comments and tests by module, and the capabilities since
//! [`COMMIT_BEFORE`](crate::bars::COMMIT_BEFORE) that have files of their own.
//!
//! Input: a tree. Output: [`Lines`] and their text. Lines of inline tests (`#[cfg(test)] mod ... {`) count as tests.

use std::collections::BTreeMap;
use std::fmt::{self, Write};
use std::ops::AddAssign;

use crate::Finding;
use crate::limits;
use crate::tree::{File, Tree};

/// The engine's sources.
const SOURCES: &str = "crates/engine/src/";

/// Lines by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kinds {
    /// Neither comments nor blank, outside of tests.
    pub code: usize,
    /// Lines with nothing but a comment.
    pub comments: usize,
    /// Blank lines.
    pub blank: usize,
    /// All lines of tests.
    pub tests: usize,
}

impl Kinds {
    const fn sum(self) -> usize {
        self.code + self.comments + self.blank + self.tests
    }

    fn of(file: &File) -> Kinds {
        let mut kinds = Kinds::default();
        if limits::is_test(&file.path) {
            return Kinds { tests: file.text.lines().count(), ..kinds };
        }
        let mut lines = file.text.lines().peekable();
        let mut in_tests = false;
        while let Some(line) = lines.next() {
            let begins = |next: &&str| next.starts_with("mod ") && next.ends_with('{');
            in_tests |= line == "#[cfg(test)]" && lines.peek().is_some_and(begins);
            match line.trim_start() {
                _ if in_tests => kinds.tests += 1,
                "" => kinds.blank += 1,
                text if text.starts_with("//") => kinds.comments += 1,
                _ => kinds.code += 1,
            }
            in_tests &= line != "}";
        }
        kinds
    }
}

impl AddAssign for Kinds {
    fn add_assign(&mut self, other: Kinds) {
        self.code += other.code;
        self.comments += other.comments;
        self.blank += other.blank;
        self.tests += other.tests;
    }
}

impl fmt::Display for Kinds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Kinds { code, comments, blank, tests } = self;
        write!(f, "{} (code {code}, comments {comments}, blank {blank}, tests {tests})", self.sum())
    }
}

/// Lines of the engine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lines {
    /// All lines.
    pub all: Kinds,
    /// Lines by module.
    pub modules: BTreeMap<String, Kinds>,
}

/// Lines before the model of the segment, by module; `cargo run -p tidy -- figures DIRECTORY` prints them for the files
/// of that commit.
const BEFORE: [(&str, usize); 24] = [
    ("board", 618),
    ("clocks", 1440),
    ("config", 1726),
    ("direction", 30),
    ("domain", 61),
    ("event", 827),
    ("exchange", 4122),
    ("info", 1307),
    ("junction", 203),
    ("layout", 874),
    ("lib", 42),
    ("link", 64),
    ("mail", 7900),
    ("main_device", 2428),
    ("plan", 1656),
    ("procedures", 12652),
    ("queue", 125),
    ("request", 687),
    ("ring", 591),
    ("ring_status", 352),
    ("supervisor", 3488),
    ("time", 40),
    ("topology", 1749),
    ("segment", 0),
];
/// All of them by kind.
const ALL_BEFORE: Kinds = Kinds { code: 26618, comments: 5525, blank: 3286, tests: 7553 };

/// Capabilities since then, with the files that exist for them alone: beginnings of paths below the sources. A file
/// belongs to the first one that names it.
const CAPABILITIES: [(&str, &[&str]); 7] = [
    (
        "two MainDevices in a ring (standby)",
        &[
            "role",
            "standby.rs",
            "exchange/standby",
            "exchange/no_standby",
            "exchange/following",
            "exchange/master_frames",
            "layout/master_frames",
            "main_device/standby/take_over",
            "main_device/standby/listen",
            "main_device/standby/follow",
            "main_device/standby",
            "main_device/standby/redundancy",
            "main_device/standby/identity",
            "config/digest",
            "event/standby",
            "board/standby",
            "segment/rules/roles",
            "procedures/mirror",
        ],
    ),
    (
        "lost frames sent again within their cycle, fast paths of undisturbed cycles",
        &[
            "exchange/again",
            "exchange/tries",
            "exchange/round_trip",
            "exchange/proved",
            "exchange/outcome",
            "exchange/flight/tries",
            "exchange/flight/only_copy",
            "exchange/place/tries",
            "exchange/usual",
            "exchange/only_frame",
            "exchange/template",
            "exchange/leaving",
            "layout/repeat",
            "main_device/activate/repeats",
            "main_device/activate/sent_once",
            "config/repetition",
            "supervisor/shared_cell",
        ],
    ),
    (
        "life without an application: idle operation, undeclared SubDevices",
        &[
            "procedures/idle",
            "procedures/undeclared",
            "procedures/deactivate",
            "segment/idle",
            "segment/undeclared",
            "segment/rules/idle",
            "segment/rules/undeclared",
            "segment/words/broadcasts",
            "main_device/idle",
        ],
    ),
    (
        "knowledge for another process: hand-over, crash, resumption",
        &[
            "knowledge",
            "mail/handover",
            "main_device/handover",
            "procedures/resume",
            "procedures/sii/cache/handover",
            "segment/knowledge",
            "segment/rules/clocks/adopt",
            "procedures/clocks/adopt",
            "clocks/known_cable",
        ],
    ),
    (
        "tools and clients: snapshots, events and messages per client, reports of ports and counters",
        &[
            "main_device/snapshot",
            "main_device/services/tool",
            "main_device/clients",
            "main_device/services/messages",
            "main_device/live_status",
            "main_device/services/commands",
            "main_device/sampling",
            "event/clients",
            "event/messages",
            "event/subject",
            "board/live",
            "board/sheet",
            "board/commands",
            "exchange/shares",
            "supervisor/command_reports",
            "supervisor/debug_message",
            "procedures/command_watch",
            "procedures/error_statistics",
            "procedures/sample",
            "procedures/inspect_ring",
            "procedures/request_states",
            "procedures/services/eeprom_owner",
            "procedures/services/forced_state",
            "procedures/services/port_report",
            "mail/emergencies",
        ],
    ),
    (
        "clocks: the application's time, hidden delays, their state in the model",
        &[
            "segment/clocks",
            "segment/rules/clocks",
            "clocks/branches",
            "clocks/sums",
            "clocks/places",
            "clocks/delay_range",
            "procedures/clocks/slide",
            "procedures/clocks/offsets",
            "procedures/clocks/not_locked",
            "exchange/clocks/calls",
            "exchange/clocks/gap",
            "exchange/clocks/slide",
            "board/clock_times",
        ],
    ),
    (
        "configuration: places before activation, PDOs of dictionaries, starts with parts of an SII",
        &[
            "main_device/declaration/registration",
            "main_device/declaration/registered",
            "main_device/declaration/register_error",
            "main_device/declaration/memories",
            "main_device/declaration/image_memory",
            "exchange/image/bytes",
            "config/dictionary",
            "config/matching",
            "config/resolution",
            "config/pdo.rs",
            "config/refused_pdos",
            "plan/pdos",
            "procedures/assign_pdos",
            "procedures/configure/pdos",
            "procedures/configure/register_error",
            "procedures/complete_siis",
            "procedures/sii/shared_words",
            "procedures/sii/turns",
            "procedures/sii/extents",
            "info/extend",
            "info/extent",
            "info/pdo_source",
        ],
    ),
];

impl Lines {
    /// Counts the engine of a tree.
    pub fn of(tree: &Tree) -> Lines {
        let mut lines = Lines::default();
        for (path, file) in sources(tree) {
            let kinds = Kinds::of(file);
            let module = path.split('/').next().unwrap_or_default().trim_end_matches(".rs");
            *lines.modules.entry(module.to_owned()).or_default() += kinds;
            lines.all += kinds;
        }
        lines
    }
}

impl fmt::Display for Lines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "lines of the engine: {}", self.all)?;
        self.modules.iter().try_for_each(|(module, kinds)| writeln!(f, "    {module}: {kinds}"))
    }
}

fn sources(tree: &Tree) -> impl Iterator<Item = (&str, &File)> {
    tree.rust().filter_map(|file| Some((file.path.strip_prefix(SOURCES)?, file)))
}

/// Lines of each capability outside of files of tests, in the order of the table, and those of all other files.
fn by_capability(tree: &Tree) -> ([usize; CAPABILITIES.len()], usize) {
    let (mut counts, mut rest) = ([0; CAPABILITIES.len()], 0);
    for (path, file) in sources(tree).filter(|(_, file)| !limits::is_test(&file.path)) {
        let owner = CAPABILITIES.iter().position(|(_, files)| files.iter().any(|begin| path.starts_with(begin)));
        *owner.map_or(&mut rest, |at| &mut counts[at]) += file.text.lines().count();
    }
    (counts, rest)
}

/// Entries of the table without a file.
pub fn stale(tree: &Tree) -> Vec<Finding> {
    let entries = CAPABILITIES.iter().flat_map(|(_, files)| *files);
    let is_stale = |begin: &&&str| !sources(tree).any(|(path, _)| path.starts_with(**begin));
    let finding = |begin: &&str| Finding::new("crates/tidy/src/engine_lines.rs", 0, format!("no file: {begin}"));
    entries.filter(is_stale).map(finding).collect()
}

/// The lines by module and by capability, against those before.
pub fn text(tree: &Tree) -> String {
    let lines = Lines::of(tree);
    let mut text = format!("        lines of the engine: {}; before: {ALL_BEFORE}\n", lines.all);
    for (module, kinds) in &lines.modules {
        let before = BEFORE.iter().find(|(name, _)| name == module).map_or(0, |(_, before)| *before);
        let _ = writeln!(text, "            {module}: {kinds}; before: {before}");
    }
    let (counts, rest) = by_capability(tree);
    text += "        of these, outside of files of tests, files that exist for one capability alone:\n";
    for ((name, _), count) in CAPABILITIES.iter().zip(counts) {
        let _ = writeln!(text, "            {name}: {count}");
    }
    let _ = writeln!(text, "            all other files: {rest}");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_code_comments_blank_or_tests() {
        let source =
            "//! A.\n\nfn a() {\n    // b\n}\n\n#[cfg(test)]\nmod tests {\n    // c\n\n    fn d() {}\n}\nfn e() {}\n";
        let file = |path: &str, text: &str| File::new(&format!("{SOURCES}{path}"), text);
        let tree = Tree {
            files: vec![
                file("a.rs", source),
                file("a/tests.rs", "fn f() {}\n\n"),
                file("role.rs", "#[cfg(test)]\nmod b;\n"),
            ],
        };
        let lines = Lines::of(&tree);
        assert_eq!(lines.modules["a"], Kinds { code: 3, comments: 2, blank: 2, tests: 8 });
        assert_eq!(lines.modules["role"], Kinds { code: 2, ..Kinds::default() });
        assert_eq!(lines.all.sum(), 17);
        assert_eq!(by_capability(&tree), ([2, 0, 0, 0, 0, 0, 0], 13));
        assert!(!stale(&tree).is_empty());
    }

    #[test]
    fn what_was_counted_before_adds_up() {
        assert_eq!(BEFORE.iter().map(|(_, lines)| lines).sum::<usize>(), ALL_BEFORE.sum());
    }
}
