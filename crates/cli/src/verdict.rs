//! The last line of every command, and the exit status that goes with it.
//!
//! `result: ok: ...` and 0, or `result: FAILED: ...` and 1 where it ran and something did not hold, or 2 where it could
//! not do what was asked. It goes to the standard output, or beside it where that is for JSON.

use std::process::ExitCode;

use crate::failure::Failure;
use crate::output::{self, say};

/// What a command that ran has to say in the end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Everything held, in a few words.
    Held(String),
    /// What did not.
    Failed(String),
}

impl Verdict {
    /// All held, where there are no reasons against it.
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

    /// Whether everything held.
    pub fn has_held(&self) -> bool {
        matches!(self, Verdict::Held(_))
    }

    /// The words behind `result: `.
    pub fn words(&self) -> String {
        match self {
            Verdict::Held(words) => format!("ok: {words}"),
            Verdict::Failed(words) => format!("FAILED: {words}"),
        }
    }
}

/// Where the last line goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastLine {
    /// To the standard output, behind what else is there.
    StandardOutput,
    /// To the standard error output: the standard output is for JSON.
    Beside,
}

/// Prints the last line; the exit status.
pub fn conclude(outcome: Result<Verdict, Failure>, last_line: LastLine) -> ExitCode {
    let verdict = match outcome {
        Ok(verdict) => verdict,
        Err(failure) => {
            let text = failure.to_string();
            let (first, more) = text.split_once('\n').unwrap_or((&text, ""));
            more.lines().for_each(|line| eprintln!("ringcat: {line}"));
            eprintln!("result: FAILED: {first}");
            return ExitCode::from(2);
        }
    };
    match last_line {
        LastLine::StandardOutput => say!("result: {}", verdict.words()),
        LastLine::Beside => eprintln!("result: {}", verdict.words()),
    }
    match output::failure() {
        Some(error) => {
            eprintln!("result: FAILED: the standard output cannot be written: {error}");
            ExitCode::FAILURE
        }
        None if verdict.has_held() => ExitCode::SUCCESS,
        None => ExitCode::FAILURE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: verdict
    #[test]
    fn a_verdict_has_held_only_without_reasons_against_it() {
        let held = Verdict::of(Vec::new(), "3 SubDevices");
        assert_eq!((held.words().as_str(), held.has_held()), ("ok: 3 SubDevices", true));
        assert_eq!(held.clone().and(None), held);
        let failed = held.and(Some("the file is full".to_owned()));
        assert_eq!(failed.words(), "FAILED: the file is full");
        let more = Verdict::of(vec!["a".to_owned(), "b".to_owned()], "x").and(Some("c".to_owned()));
        assert_eq!((more.words().as_str(), more.has_held()), ("FAILED: a; b; c", false));
    }
}
