//! Lines for the operator of a machine: on the standard error, and in the journal of the system where there is one.
//!
//! [`OperatorLines::write`] never waits: a line that nothing takes is lost, and the next one states how many were. The
//! journal gets a datagram for each line (its native protocol); where the standard error leads to the journal already,
//! a line has its priority in front instead, and there is no datagram. Not for the cyclic path.

mod journal;
mod priority;
mod standard_error;

use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use journal::Journal;
pub use priority::Priority;

use crate::visible::visible;

/// Where the system's journal listens.
pub const JOURNAL: &str = "/run/systemd/journal/socket";
/// Names another socket; empty: none.
pub const JOURNAL_VARIABLE: &str = "RINGCAT_JOURNAL";
/// What the service manager sets where the standard error leads to the journal: its device and inode.
const STREAM_VARIABLE: &str = "JOURNAL_STREAM";
/// Longest line with its end: a pipe takes it whole or not at all (`PIPE_BUF`).
const LONGEST: usize = 4096;

/// Where lines for the operator go.
#[derive(Debug)]
pub struct OperatorLines {
    /// Name of the program in the journal.
    identifier: String,
    journal: Option<Journal>,
    /// The standard error leads to the journal.
    is_stream: bool,
    /// The standard error, but in tests.
    descriptor: libc::c_int,
    /// Lines that the standard error did not take.
    lost: AtomicU64,
}

impl OperatorLines {
    /// Lines of a program, with the variables of its environment.
    pub fn new(identifier: &str, variable: impl Fn(&str) -> Option<String>) -> OperatorLines {
        let is_stream = variable(STREAM_VARIABLE).is_some_and(|named| standard_error::is_at(&named));
        let path = variable(JOURNAL_VARIABLE).map_or_else(|| PathBuf::from(JOURNAL), PathBuf::from);
        let journal = if is_stream || path.as_os_str().is_empty() { None } else { Journal::at(&path) };
        let (identifier, descriptor, lost) = (identifier.to_owned(), libc::STDERR_FILENO, AtomicU64::new(0));
        OperatorLines { identifier, journal, is_stream, descriptor, lost }
    }

    /// Writes a line at once, or loses it.
    pub fn write(&self, priority: Priority, text: &str) {
        let text = &shown(text)[..];
        self.to_the_journal(priority, text);
        let lost = self.lost.swap(0, Ordering::AcqRel);
        let is_written = lost == 0 || self.write_now(&self.line(Priority::Warning, &lost_lines(lost)));
        if !is_written || !self.write_now(&self.line(priority, text)) {
            let more = if is_written { 1 } else { lost + 1 };
            self.lost.fetch_add(more, Ordering::AcqRel);
        }
    }

    /// Writes a line to the journal, and to `out`, whose other end it may wait for.
    pub fn write_and_wait(&self, priority: Priority, text: &str, out: &mut impl Write) {
        let text = &shown(text)[..];
        self.to_the_journal(priority, text);
        // Where nothing takes it, it is lost: a program goes on without a terminal.
        let _ = out.write_all(&self.line(priority, text));
    }

    fn write_now(&self, line: &[u8]) -> bool {
        standard_error::write_now(self.descriptor, line)
    }

    fn to_the_journal(&self, priority: Priority, text: &str) {
        if let Some(journal) = &self.journal {
            journal.send(priority, &self.identifier, text);
        }
    }

    /// A line for the standard error.
    fn line(&self, priority: Priority, text: &str) -> Vec<u8> {
        let number = if self.is_stream { format!("<{}>", priority.number()) } else { String::new() };
        let mut line = number + text;
        line.truncate(line.floor_char_boundary(LONGEST - 1));
        line.push('\n');
        line.into_bytes()
    }
}

/// A text on one line, as a terminal may show it.
fn shown(text: &str) -> String {
    visible(text).replace(['\n', '\t'], " ")
}

/// The line about lines that were lost.
pub fn lost_lines(count: u64) -> String {
    match count {
        1 => "1 line was lost: nothing took it".to_owned(),
        _ => format!("{count} lines were lost: nothing took them"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn none(_: &str) -> Option<String> {
        None
    }

    // covers: links
    #[test]
    fn a_line_is_one_line_of_at_most_4096_bytes() {
        let lines = OperatorLines::new("test", |name| (name == JOURNAL_VARIABLE).then(String::new));
        let text = shown("two\nlines\t\u{1b}[31m\u{202e}\u{2028}");
        assert_eq!(lines.line(Priority::Info, &text), b"two lines \\u{1b}[31m\\u{202e}\\u{2028}\n");
        assert_eq!(lines.line(Priority::Info, &"\u{e9}".repeat(4096)).len(), 4095);
        assert_eq!(lost_lines(1), "1 line was lost: nothing took it");
        assert_eq!(lost_lines(2), "2 lines were lost: nothing took them");
    }

    // covers: links
    #[test]
    fn lines_that_nothing_took_are_counted_when_there_is_room_again() {
        use std::io::{BufRead, BufReader};
        use std::os::fd::AsRawFd;
        let (reader, writer) = std::io::pipe().expect("a pipe");
        let mut lines = OperatorLines::new("test", |name| (name == JOURNAL_VARIABLE).then(String::new));
        lines.descriptor = writer.as_raw_fd();
        let long = "x".repeat(4000);
        let mut written = 0;
        while lines.lost.load(Ordering::Relaxed) < 3 {
            lines.write(Priority::Info, &long);
            written += 1;
        }
        let mut reader = BufReader::new(reader).lines().map(|line| line.expect("it is text"));
        let taken = reader.by_ref().take(written - 3).filter(|line| *line == long).count();
        assert_eq!(taken, written - 3);
        lines.write(Priority::Info, "again");
        assert_eq!(reader.next().as_deref(), Some("3 lines were lost: nothing took them"));
        assert_eq!(reader.next().as_deref(), Some("again"));
    }

    // covers: links
    #[test]
    fn a_standard_error_that_is_the_journal_gets_priorities_and_no_datagram_follows() {
        use std::os::unix::fs::MetadataExt;
        let own = std::fs::metadata("/dev/stderr").expect("it is there");
        let stream = format!("{}:{}", own.dev(), own.ino());
        let lines = OperatorLines::new("test", |name| (name == STREAM_VARIABLE).then(|| stream.clone()));
        assert!(lines.is_stream && lines.journal.is_none());
        assert_eq!(lines.line(Priority::Error, "it failed"), b"<3>it failed\n");
        for other in ["", "1", "1:x", "0:0", &format!("{stream}0")] {
            let lines = OperatorLines::new("test", |name| (name == STREAM_VARIABLE).then(|| other.to_owned()));
            assert!(!lines.is_stream, "{other}");
        }
        assert!(!OperatorLines::new("test", none).is_stream);
    }
}
