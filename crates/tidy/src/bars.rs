//! Figures of the source tree against their bars, with what they were before the model of the segment.
//!
//! Input: a tree. Output: [`Row`]s. [`ELSEWHERE`] names the commands that measure the other bars.

use std::collections::BTreeSet;
use std::fmt::{self, Write};

use crate::known::Counts;
use crate::tree::{File, Tree};
use crate::{Finding, circles, dependencies, handed_on, limits, words};

/// A line of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// What is measured.
    pub what: &'static str,
    /// Before the model of the segment, where it was measured.
    pub before: &'static str,
    /// Now.
    pub now: String,
    /// What it has to be.
    pub bar: &'static str,
    /// Whether it is; nothing where a figure is only printed.
    pub holds: Option<bool>,
}

/// What is counted in any state of the tree ([`Counted::of`]).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counted {
    /// Lines of the engine, and of them those outside of files of tests.
    pub engine_lines: String,
    /// Public items of `ringcat`, as the list has them.
    pub public_items: usize,
    /// Documentation examples.
    pub examples: usize,
}

/// The commit before the model of the segment.
pub const COMMIT_BEFORE: &str = "4cd9b5da";

/// What [`Counted::of`] has counted at [`COMMIT_BEFORE`].
struct Before {
    engine_lines: &'static str,
    public_items: &'static str,
    examples: &'static str,
}

/// Recorded on 2026-11-23 by `cargo run -p tidy -- figures DIRECTORY` with the files of that commit.
const BEFORE: Before = Before { engine_lines: "42982, 37632", public_items: "1530", examples: "1" };

impl Counted {
    /// Counts a tree.
    pub fn of(tree: &Tree) -> Result<Counted, Finding> {
        let (without, all) = (lines(tree, "engine", false), lines(tree, "engine", true));
        Ok(Counted {
            engine_lines: format!("{all}, {without}"),
            public_items: handed_on::items(tree)?.len(),
            examples: examples(tree),
        })
    }
}

impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "lines of the engine, and without files of tests: {}", self.engine_lines)?;
        writeln!(f, "public items of `ringcat`: {}", self.public_items)?;
        writeln!(f, "documentation examples: {}", self.examples)
    }
}

/// Above the table of tasks that poll: a comment in a page, so that its rows can be counted.
pub const POLLING: &str = "<!-- polling tasks of the engine -->";

/// Crates that are published, by directory; their documentation counts.
const PUBLISHED: [&str; 11] =
    ["cli", "config", "control", "engine", "ffi", "gateway", "link", "ringcat", "ringcatd", "sim", "wire"];
/// The pages that are documentation of `ringcat`.
const GUIDE: &str = "docs/guide/";
const EXAMPLES: usize = 20;

/// Up to which commit the language is reviewed; what is newer is `git log COMMIT..`.
const REVIEWED: &str = "up to 32bbe938, 2026-11-30: pages, comments, names of tests; messages up to a8626268";

/// Bars that are measured by running something: what, the bar, the command.
pub const ELSEWHERE: [(&str, &str, &str); 8] = [
    ("instructions of a cycle", "bars in the program", "ci/bench (cycle, socket_cycle)"),
    ("start-up in virtual time", "bars in the program", "ci/bench (figures startup, figures phases)"),
    (
        "memory, CPU per simulated second",
        "14 MiB (17 on the way); with 1,000 SubDevices 1 s, the lesser of as charged and by a fixed work",
        "ci/bench (scale)",
    ),
    (
        "the same before and after",
        "+1 %, compared in the page",
        "docs/performance.md, section \"Before and after the model of the segment\"",
    ),
    ("scenarios; random explorers", "all pass", "cargo test --workspace; ci/explore --full"),
    ("packages of all published crates", "built", "ci/package"),
    ("pages and comments reviewed by a reader that did not write them", "all", REVIEWED),
    ("tasks and pauses that poll, with reasons", "listed", "cargo test -p ringcat-engine --test waits -- --nocapture"),
];

/// All rows; `packet` is what `cargo tree` prints for an application with the feature of this name.
pub fn rows(tree: &Tree, packet: &str) -> Result<Vec<Row>, Finding> {
    let none = |what, before, counts: Counts| {
        let sum: usize = counts.values().sum();
        let now = if counts.is_empty() { "0".to_owned() } else { format!("{sum} in {}", places(&counts)) };
        Row { what, before, now, bar: "0", holds: Some(counts.is_empty()) }
    };
    let at_most = |what, before, now: usize, most: usize, bar| Row {
        what,
        before,
        now: now.to_string(),
        bar,
        holds: Some(now <= most),
    };
    let printed = |what, before, now: String| Row { what, before, now, bar: "printed", holds: None };
    let most = |row: Row, most: Option<(String, usize)>| match most {
        Some((name, lines)) => Row { now: format!("{}, the longest has {lines} ({name})", row.now), ..row },
        None => row,
    };
    let long = limits::long_functions(tree)?.into_keys().map(|name| (name, 1)).collect();
    let files = limits::long_files(tree).into_keys().map(|name| (name, 1)).collect();
    let (registry, _) = dependencies::crates_in(packet);
    let Counted { engine_lines, public_items, examples } = Counted::of(tree)?;
    Ok(vec![
        none("files in circles of a crate", "28 of 184 files", circles::sizes(tree)?),
        at_most(
            "crates of an application with `packet`",
            "not possible",
            registry.len(),
            dependencies::MAX_CRATES,
            "12",
        ),
        most(none("functions over 60 lines", "25 over 50", long), limits::longest_function(tree)?),
        most(none("files over 500 lines, tests apart", "not counted", files), limits::longest_file(tree)),
        none("lines over 120 columns", "not counted", limits::wide_lines(tree)),
        polling(tree),
        none("words for people outside of the allow-list", "1,361", words::for_people(tree)),
        printed("lines of the engine, and without files of tests", BEFORE.engine_lines, engine_lines),
        printed(
            "public items of `ringcat` (now with fields, variants and crates handed on)",
            BEFORE.public_items,
            public_items.to_string(),
        ),
        Row {
            what: "documentation examples",
            before: BEFORE.examples,
            now: examples.to_string(),
            bar: "20",
            holds: Some(examples >= EXAMPLES),
        },
    ])
}

fn places(counts: &Counts) -> String {
    let most = 3;
    let mut named: Vec<&str> = counts.keys().take(most).map(String::as_str).collect();
    if counts.len() > most {
        named.push("...");
    }
    format!("{} places ({})", counts.len(), named.join(", "))
}

/// Lines of a crate's sources, with or without files of tests.
fn lines(tree: &Tree, directory: &str, with_tests: bool) -> usize {
    let below = format!("crates/{directory}/src/");
    let counts = |file: &&File| file.path.starts_with(&below) && (with_tests || !limits::is_test(&file.path));
    tree.rust().filter(counts).map(|file| file.text.lines().count()).sum()
}

/// Tasks that poll, in the table behind [`POLLING`].
fn polling(tree: &Tree) -> Row {
    let what = "polling tasks of the engine without an event";
    let before = "not listed";
    let page = tree.files.iter().find(|file| file.path.ends_with(".md") && file.text.contains(POLLING));
    let bar = "0 or listed with the reason";
    let Some(page) = page else {
        return Row { what, before, now: "no list".to_owned(), bar, holds: Some(false) };
    };
    let table = page.text.split_once(POLLING).map_or("", |(_, after)| after).trim_start();
    let rows: Vec<&str> = table.lines().take_while(|line| line.starts_with('|')).skip(2).collect();
    let reasons =
        rows.iter().all(|row| row.trim_matches('|').rsplit('|').next().is_some_and(|it| !it.trim().is_empty()));
    Row { what, before, now: format!("{} in {}", rows.len(), page.path), bar, holds: Some(reasons) }
}

/// Programs in documentation that `cargo test` compiles.
fn examples(tree: &Tree) -> usize {
    let sources: BTreeSet<String> = PUBLISHED.iter().map(|name| format!("crates/{name}/src/")).collect();
    let is_source = |file: &&File| sources.iter().any(|below| file.path.starts_with(below.as_str()));
    let in_comments = tree.rust().filter(is_source).map(|file| {
        let comment = |line: &str| {
            let line = line.trim_start();
            line.strip_prefix("///").or(line.strip_prefix("//!")).map(str::to_owned)
        };
        programs(file.text.lines().filter_map(comment))
    });
    let pages = tree.files.iter().filter(|file| file.path.starts_with(GUIDE) && !file.path.ends_with("README.md"));
    let in_pages = pages.map(|file| programs(file.text.lines().map(str::to_owned)));
    in_comments.chain(in_pages).sum()
}

/// Fenced blocks that rustdoc takes for Rust to compile.
fn programs(lines: impl Iterator<Item = String>) -> usize {
    let (mut inside, mut count) = (false, 0);
    for line in lines {
        let Some(words) = line.trim_start().strip_prefix("```") else { continue };
        let compiled = ["should_panic", "no_run", "rust", "edition2024"];
        let is_program = words.split(',').all(|word| word.trim().is_empty() || compiled.contains(&word.trim()));
        count += usize::from(!inside && is_program);
        inside = !inside;
    }
    count
}

/// The table as text, and whether all bars hold.
pub fn text(rows: &[Row]) -> (String, bool) {
    let mut text = String::new();
    for Row { what, before, now, bar, holds } in rows {
        let verdict = match holds {
            None => "",
            Some(true) => "holds",
            Some(false) => "MISSED",
        };
        let _ = writeln!(text, "{verdict:<7} {what}: {now} (bar: {bar}; before: {before})");
    }
    (text, rows.iter().all(|row| row.holds != Some(false)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(files: &[(&str, &str)]) -> Tree {
        Tree { files: files.iter().map(|(path, text)| File::new(path, text)).collect() }
    }

    #[test]
    fn programs_in_comments_and_in_the_guide_are_counted() {
        let source = "//! ```\n//! a();\n//! ```\n//! ```text\n//! no\n//! ```\n/// ```no_run\n/// b();\n/// ```\n";
        let guide = "```rust\nc();\n```\n```toml\nd = 1\n```\n";
        let tree =
            tree(&[("crates/wire/src/a.rs", source), ("crates/tidy/src/a.rs", source), ("docs/guide/a.md", guide)]);
        assert_eq!(examples(&tree), 3);
    }

    #[test]
    fn tasks_that_poll_have_a_reason_each() {
        let page =
            |reason: &str| format!("{POLLING}\n\n| task | period | reason |\n|---|---|---|\n| a | 1 ms | {reason} |\n");
        assert_eq!(polling(&tree(&[])).holds, Some(false));
        let good = polling(&tree(&[("docs/a.md", &page("silence posts nothing"))]));
        assert_eq!((good.now.as_str(), good.holds), ("1 in docs/a.md", Some(true)));
        assert_eq!(polling(&tree(&[("docs/a.md", &page(""))])).holds, Some(false));
    }

    #[test]
    fn a_bar_that_is_missed_is_said_to_be() {
        let row = |holds| Row { what: "a", before: "2", now: "1".to_owned(), bar: "0", holds };
        assert!(text(&[row(None), row(Some(true))]).1);
        assert_eq!(text(&[row(Some(false))]), ("MISSED  a: 1 (bar: 0; before: 2)\n".to_owned(), false));
    }
}
