//! Standard output: text for people or, with `--json`, lines of JSON and nothing else.
//!
//! A reader may close it: `ringcat demo | head` goes on to its end. A full disk is another matter: the output is
//! incomplete, so the command has failed.
//!
//! Texts of files and devices, and names of files, may contain control characters that a terminal would interpret: all
//! text for operators passes through [`visible`], all JSON through [`visible_json`].

use std::fmt::Arguments;
use std::io::{self, ErrorKind, IsTerminal, Write, stdout};
use std::sync::OnceLock;
use std::time::Duration;

use ringcat_link::print::error_line;
use ringcat_link::visible::{visible, visible_json};
use serde::Serialize;

use crate::json::line::{AnswerLine, EventLine, Head, Kind, SCHEMA_VERSION};

/// The first error other than a closed pipe.
static FAILURE: OnceLock<io::Error> = OnceLock::new();
/// The command, where the standard output is for JSON.
static JSON: OnceLock<Option<&'static str>> = OnceLock::new();
/// Set where the standard output is a file that the command makes.
static FILE: OnceLock<()> = OnceLock::new();

/// Text is suppressed from now on: the standard output is for the JSON of this command. Called once, at the start.
pub fn switch_to_json(command: Option<&'static str>) {
    // Only the first call counts.
    let _ = JSON.set(command);
}

/// Whether the standard output is for JSON.
pub fn is_json() -> bool {
    JSON.get().is_some()
}

/// Whether text that is drawn over itself can be shown.
pub fn is_terminal() -> bool {
    !is_json() && stdout().is_terminal()
}

/// Writes a file that the command makes: nothing else is printed on the standard output.
pub fn write_file(text: &str) {
    // Only the first call counts.
    let _ = FILE.set(());
    put(format_args!("{text}"));
}

/// Whether the standard output is a file that the command makes.
pub fn is_file() -> bool {
    FILE.get().is_some()
}

/// Writes text and flushes it, unless the standard output is for JSON or for a file. A closed pipe is no error.
pub fn write(text: Arguments<'_>) {
    if !is_json() && !is_file() {
        put(format_args!("{}", visible(&text.to_string())));
    }
}

/// As [`write()`], but with the control characters of this program: they move the cursor to the beginning of a line or
/// a table.
pub fn draw(text: Arguments<'_>) {
    if !is_json() && !is_file() {
        put(text);
    }
}

/// Writes a line of JSON.
pub fn write_json(line: &impl Serialize) {
    match serde_json::to_string(line) {
        Ok(text) => put(format_args!("{}\n", visible_json(&text))),
        Err(error) => note(io::Error::other(error)),
    }
}

/// An event as a line of JSON, where that is wanted; `name` is the variant of [`ringcat::Event`].
pub fn write_event(time: Duration, name: Option<String>, text: &str) {
    if is_json() {
        let time_ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        write_json(&EventLine { head: head(Kind::Event), time_ns, event: name, text });
    }
}

/// The answer to an order, with its last line `ok` or `error: ...`: text, or a line of JSON.
pub fn answer(order: &str, answer: &str) -> String {
    if !is_json() {
        return visible(answer);
    }
    let text = answer.trim_end();
    let (ok, text) = match text.strip_prefix("error: ") {
        Some(error) => (false, error),
        None => (true, text.strip_suffix("ok").unwrap_or(text).trim_end()),
    };
    let line = AnswerLine { head: head(Kind::Answer), order, ok, text };
    serde_json::to_string(&line).map_or_else(|error| error.to_string(), |line| visible_json(&line) + "\n")
}

/// What each line of this command begins with.
pub fn head(kind: Kind) -> Head {
    Head { schema_version: SCHEMA_VERSION, command: JSON.get().copied().flatten(), kind }
}

/// Why a part of the output is missing.
pub fn failure() -> Option<&'static io::Error> {
    FAILURE.get()
}

fn put(text: Arguments<'_>) {
    let mut out = stdout().lock();
    if let Err(error) = out.write_fmt(text).and_then(|()| out.flush()) {
        note(error);
    }
}

fn note(error: io::Error) {
    if error.kind() != ErrorKind::BrokenPipe {
        // Further ones are of the same kind.
        let _ = FAILURE.set(error);
    }
}

/// `1 copy`, `2 copies`.
pub fn counted(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

/// A line on the standard error output, which may have been closed.
pub fn complain(text: impl std::fmt::Display) {
    error_line(&text.to_string());
}

/// A warning on the standard error output, with the name of the program before it.
pub fn warn(text: impl std::fmt::Display) {
    complain(format_args!("ringcat: {text}"));
}

/// Like `println!`, without a panic on a closed pipe; nothing where the standard output is for JSON.
macro_rules! say {
    () => { $crate::output::write(format_args!("\n")) };
    ($($text:tt)+) => { $crate::output::write(format_args!("{}\n", format_args!($($text)+))) };
}

pub(crate) use say;
