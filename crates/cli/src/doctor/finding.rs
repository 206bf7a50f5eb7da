//! The finding of a check, and its text for people.
//!
//! A [`Topic`] is one thing that is checked, with why it matters; its findings state how it is on this machine. Texts
//! come from files of the machine in part, so control characters and length are limited here.

use std::fmt::Display;

use super::inspect::Unseen;
use crate::json;

/// Characters of a finding; names and contents of files can be of any length.
const LONGEST: usize = 300;
/// Columns of a line.
const COLUMNS: usize = 80;
/// Where the text begins.
const INDENT: usize = 9;

/// How a thing is, the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// It disturbs the segment, prevents a MainDevice from working, or may cost whole cycles of 1 ms.
    Bad,
    /// It costs microseconds, or concerns only some ways to use this machine.
    Minor,
    /// The check was not possible.
    Unknown,
    /// As it should be.
    Good,
}

impl Level {
    /// All, the worst first.
    pub const ALL: [Level; 4] = [Level::Bad, Level::Minor, Level::Unknown, Level::Good];

    /// As in the text and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Level::Bad => "bad",
            Level::Minor => "minor",
            Level::Unknown => "unknown",
            Level::Good => "good",
        }
    }
}

/// One thing that is checked.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    /// Its name in JSON and in docs/doctor.md.
    pub id: &'static str,
    /// Why it matters.
    pub why: &'static str,
}

/// How a thing is on this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    pub id: &'static str,
    pub level: Level,
    /// The network interface, where it is about one.
    pub interface: Option<String>,
    pub what: String,
    pub why: &'static str,
    /// Commands that correct it, and steps that are no command, one per line.
    pub mend: Vec<String>,
}

impl Topic {
    /// As it should be.
    pub fn good(self, what: impl Display) -> Finding {
        self.find(Level::Good, what, &[])
    }

    /// It costs microseconds, or concerns only some uses.
    pub fn minor(self, what: impl Display, mend: &[&str]) -> Finding {
        self.find(Level::Minor, what, mend)
    }

    /// It disturbs the segment.
    pub fn bad(self, what: impl Display, mend: &[&str]) -> Finding {
        self.find(Level::Bad, what, mend)
    }

    /// The check was not possible.
    pub fn unknown(self, why_not: impl Display) -> Finding {
        self.find(Level::Unknown, why_not, &[])
    }

    /// The result of a check, or why it was not possible.
    pub fn of(self, finding: Result<Finding, Unseen>) -> Finding {
        finding.unwrap_or_else(|unseen| self.unknown(unseen))
    }

    fn find(self, level: Level, what: impl Display, mend: &[&str]) -> Finding {
        let mend = mend.iter().map(|line| (*line).to_owned()).collect();
        Finding { id: self.id, level, interface: None, what: printable(&what.to_string()), why: self.why, mend }
    }
}

/// Text without control characters, and not longer than a finding may be.
pub fn printable(text: &str) -> String {
    let visible = |c: char| if c.is_control() { '?' } else { c };
    let mut short: String = text.chars().take(LONGEST).map(visible).collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push_str("...");
    }
    short
}

impl Finding {
    /// About this interface.
    pub fn on(mut self, interface: &str) -> Finding {
        self.interface = Some(printable(interface));
        self
    }

    /// As the keys of JSON.
    pub fn json(&self) -> json::doctor::Finding {
        json::doctor::Finding {
            id: self.id,
            level: self.level.name(),
            interface: self.interface.clone(),
            what: self.what.clone(),
            why: self.why,
            mend: self.mend.clone(),
        }
    }

    fn subject(&self) -> String {
        self.interface.iter().map(String::as_str).chain([self.id]).collect::<Vec<_>>().join(" ")
    }

    /// Its lines: what, why where it is not good, and what corrects it.
    fn lines(&self) -> Vec<String> {
        let mut lines = wrapped(self.level.name(), &format!("{}: {}", self.subject(), self.what));
        if self.level != Level::Good {
            lines.extend(wrapped("", self.why));
        }
        lines.extend(self.mend.iter().flat_map(|line| command(line)));
        lines
    }
}

/// The list for people, the worst first; of the good ones only names, unless `all` are to be printed.
pub fn lines(findings: &[Finding], all: bool) -> Vec<String> {
    let of = |level: Level| findings.iter().filter(move |finding| finding.level == level);
    let shown = Level::ALL.into_iter().filter(|level| all || *level != Level::Good);
    let mut lines: Vec<String> = shown.flat_map(of).flat_map(Finding::lines).collect();
    let good: Vec<String> = of(Level::Good).map(Finding::subject).collect();
    if !all && !good.is_empty() {
        lines.extend(wrapped(Level::Good.name(), &good.join(", ")));
    }
    lines
}

/// How many there are of each level, without those that there are none of.
pub fn counted(findings: &[Finding]) -> String {
    let count = |level: Level| findings.iter().filter(|finding| finding.level == level).count();
    let words = Level::ALL.into_iter().map(|level| (count(level), level.name()));
    words.filter(|(count, _)| *count > 0).map(|(count, name)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
}

/// Text in lines of 80 columns behind a word. What is longer than a line without a space is broken.
fn wrapped(word: &str, text: &str) -> Vec<String> {
    let room = COLUMNS - INDENT;
    let mut lines: Vec<String> = vec![String::new()];
    for part in text.split(' ').filter(|part| !part.is_empty()) {
        for piece in part.chars().collect::<Vec<_>>().chunks(room) {
            let used = lines.last().map_or(0, |line| line.chars().count());
            if used > 0 && used + 1 + piece.len() > room {
                lines.push(String::new());
            }
            if let Some(line) = lines.last_mut() {
                line.push_str(if line.is_empty() { "" } else { " " });
                line.extend(piece);
            }
        }
    }
    let head = |number| if number == 0 { word } else { "" };
    lines.iter().enumerate().map(|(number, line)| format!("{:<INDENT$}{line}", head(number))).collect()
}

/// A command in lines of 80 columns that a shell takes as one. A word that is longer than a line stays whole.
fn command(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() + " \\".len() <= COLUMNS => {
                line.push(' ');
                line.push_str(word);
            }
            Some(line) => {
                line.push_str(" \\");
                lines.push(format!("{:<1$}{word}", "", INDENT + 4));
            }
            None => lines.push(format!("{:<INDENT$}{word}", "   mend")),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOPIC: Topic = Topic { id: "kernel", why: "it delays cycles" };

    // covers: bench
    #[test]
    fn the_worst_is_first_and_what_is_good_takes_one_line() {
        let findings =
            [TOPIC.good("a"), TOPIC.unknown("b"), TOPIC.minor("c", &["x"]), TOPIC.bad("d", &["y", "z"]).on("eth1")];
        let expected = [
            "bad      eth1 kernel: d",
            "         it delays cycles",
            "   mend  y",
            "   mend  z",
            "minor    kernel: c",
            "         it delays cycles",
            "   mend  x",
            "unknown  kernel: b",
            "         it delays cycles",
            "good     kernel",
        ];
        assert_eq!(lines(&findings, false), expected);
        assert_eq!(lines(&findings, true).last().map(String::as_str), Some("good     kernel: a"));
        assert_eq!(counted(&findings), "1 bad, 1 minor, 1 unknown, 1 good");
        assert_eq!(counted(&findings[..1]), "1 good");
    }

    // covers: bench
    #[test]
    fn any_text_is_short_printable_and_within_80_columns() {
        let wild = ["\u{1b}[2Jred\0\n\r\t", &"x".repeat(100_000), &"words ".repeat(5_000), &"ä\u{2028}".repeat(900)];
        for text in wild {
            let finding = TOPIC.bad(text, &[]).on(text);
            assert!(finding.what.chars().count() <= LONGEST + 3 && !finding.what.contains(char::is_control));
            let lines = lines(&[finding], true);
            assert!(lines.len() < 12 && lines.iter().all(|line| line.chars().count() <= COLUMNS), "{lines:?}");
        }
    }

    // covers: bench
    #[test]
    fn a_command_of_two_lines_is_one_for_a_shell() {
        let long =
            format!("sudo setcap cap_net_raw,cap_net_admin,cap_ipc_lock,cap_sys_nice=ep /opt/{}", "x".repeat(50));
        let lines = command(&long);
        let together: String = lines.iter().map(|line| line.trim_end_matches('\\')).collect();
        let words: Vec<&str> = together.split_whitespace().skip(1).collect();
        assert_eq!((lines.len(), words), (2, long.split(' ').collect()));
        assert!(lines[0].ends_with(" \\") && lines.iter().all(|line| line.chars().count() <= COLUMNS), "{lines:?}");
        assert_eq!(command("sudo ip link set eth1 up"), ["   mend  sudo ip link set eth1 up"]);
    }
}
