//! The last line of every command, and the exit status that goes with it.
//!
//! `result: ok: ...` and 0, `result: FAILED: ...` and 1 if the command ran and a check failed, or 2 if the command
//! could not be carried out. With `--json` the last line of the standard output is the same as an object, and the
//! words go to the standard error output.

use std::fs::File;
use std::io::{Write, stdout};
use std::os::fd::AsFd;
use std::process::ExitCode;

use ringcat_link::visible::visible_json;

use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::line::{Ending, Kind, Outcome, ResultLine};
use crate::output::{self, complain, head, say, warn};

/// Result of the checks of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// All checks passed; the result in a few words.
    Held(String),
    /// A check failed; the reasons.
    Failed(String),
}

impl Verdict {
    /// All checks passed if there are no reasons for a failure.
    pub fn of(reasons: Vec<String>, held: impl Into<String>) -> Verdict {
        if reasons.is_empty() { Verdict::Held(held.into()) } else { Verdict::Failed(reasons.join("; ")) }
    }

    /// The same, failed where there is one more reason.
    pub fn and(self, reason: Option<String>) -> Verdict {
        match (self, reason) {
            (verdict, None) => verdict,
            (Verdict::Held(_), Some(reason)) => Verdict::Failed(reason),
            (Verdict::Failed(others), Some(reason)) => Verdict::Failed(format!("{others}; {reason}")),
        }
    }

    /// The words behind `result: `.
    fn words(&self) -> String {
        match self {
            Verdict::Held(words) => format!("ok: {words}"),
            Verdict::Failed(words) => format!("FAILED: {words}"),
        }
    }

    fn ending(&self) -> Ending {
        let (outcome, exit_code, message) = match self {
            Verdict::Held(words) => (Outcome::Ok, 0, words),
            Verdict::Failed(words) => (Outcome::Failed, FAILED, words),
        };
        Ending { outcome, exit_code, message: message.clone(), details: Vec::new() }
    }
}

/// Exit status if a check failed.
const FAILED: u8 = 1;
/// Exit status if a command could not be carried out.
const ERROR: u8 = 2;

/// What a command that ran has found.
#[derive(Debug)]
pub struct Report {
    /// Whether everything held.
    pub verdict: Verdict,
    /// The keys of its last line of JSON.
    pub data: Data,
}

/// Prints the last line; the exit status.
pub fn conclude(outcome: Result<Report, Failure>) -> ExitCode {
    match outcome {
        Ok(Report { verdict, data }) => conclude_report(&verdict, &data),
        Err(failure) => conclude_error(&failure.to_string()),
    }
}

fn conclude_report(verdict: &Verdict, data: &Data) -> ExitCode {
    let ending = verdict.ending();
    let exit_code = ending.exit_code;
    if output::is_json() {
        output::write_json(&ResultLine { head: head(Kind::Result), result: ending, data: Some(data) });
    } else {
        say!("result: {}", verdict.words());
    }
    if let Some(error) = output::failure() {
        complain(format_args!("result: FAILED: the standard output cannot be written: {error}"));
        return ExitCode::from(FAILED);
    }
    if output::is_json() || output::is_file() {
        complain(format_args!("result: {}", verdict.words()));
    }
    ExitCode::from(exit_code)
}

/// The last line of a command that could not be carried out: the first line of the text says what is wrong, further
/// ones what to do. The exit status.
pub fn conclude_error(text: &str) -> ExitCode {
    let (first, more) = text.split_once('\n').unwrap_or((text, ""));
    more.lines().for_each(warn);
    conclude_printed_error(first, more.lines().map(str::to_owned).collect())
}

/// The only line of a command that explains the program, with `--json`: help, the version.
pub fn conclude_text(message: &str, details: Vec<String>) -> ExitCode {
    output::write_json(&line_without_data(Outcome::Ok, 0, message, details));
    ExitCode::SUCCESS
}

/// As [`conclude_error`], where the details have been printed.
pub fn conclude_printed_error(message: &str, details: Vec<String>) -> ExitCode {
    if output::is_json() {
        output::write_json(&line_without_data(Outcome::Error, ERROR, message, details));
    }
    complain(format_args!("result: FAILED: {message}"));
    ExitCode::from(ERROR)
}

/// Ends the program as it is, from any thread: the threads that print may hold the standard output for ever.
pub fn end_at_once(message: &str) -> ! {
    if output::is_json()
        && let Ok(out) = stdout().as_fd().try_clone_to_owned()
    {
        let line = line_without_data(Outcome::Failed, FAILED, message, Vec::new());
        let text = serde_json::to_string(&line).unwrap_or_default();
        // The program ends with a failure in any case.
        let _ = File::from(out).write_all(format!("{}\n", visible_json(&text)).as_bytes());
    }
    complain(format_args!("result: FAILED: {message}"));
    std::process::exit(i32::from(FAILED));
}

fn line_without_data(outcome: Outcome, exit_code: u8, message: &str, details: Vec<String>) -> ResultLine<'static> {
    let result = Ending { outcome, exit_code, message: message.to_owned(), details };
    ResultLine { head: head(Kind::Result), result, data: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: verdict
    #[test]
    fn a_verdict_has_held_only_without_reasons_against_it() {
        let held = Verdict::of(Vec::new(), "3 SubDevices");
        assert_eq!((held.words().as_str(), held.ending().exit_code), ("ok: 3 SubDevices", 0));
        assert_eq!(held.clone().and(None), held);
        let failed = held.and(Some("the file is full".to_owned()));
        assert_eq!(failed.words(), "FAILED: the file is full");
        let more = Verdict::of(vec!["a".to_owned(), "b".to_owned()], "x").and(Some("c".to_owned()));
        assert_eq!((more.words().as_str(), more.ending().exit_code), ("FAILED: a; b; c", 1));
    }
}
