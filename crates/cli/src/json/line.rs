//! One line of output: what all lines have in common, and how a command ended.

use serde::Serialize;

use super::data::Data;

/// Version of all keys together.
pub const SCHEMA_VERSION: u32 = 1;

/// What every line begins with.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Head {
    /// Version of the keys on this page
    pub schema_version: u32,
    /// The command, such as `scan` or `bench cycles`; null where the command line names none
    pub command: Option<&'static str>,
    /// What the line is: `result` is the last line of every command
    #[serde(rename = "type")]
    pub kind: Kind,
}

/// What a line is.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Something happened while the command runs.
    Event,
    /// The simulator answers an order.
    Answer,
    /// The command is over.
    Result,
}

/// The last line of a command.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ResultLine<'a> {
    /// What every line begins with.
    #[serde(flatten)]
    pub head: Head,
    /// How the command ended
    pub result: Ending,
    /// The keys of the command.
    #[serde(flatten)]
    #[cfg_attr(test, schemars(skip))]
    pub data: Option<&'a Data>,
}

/// How a command ended.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Ending {
    /// `ok`: all checks passed; `failed`: the command ran and a check failed; `error`: it could not be carried out
    pub outcome: Outcome,
    /// Exit status of the program: 0, 1 or 2, in the order of the outcomes
    pub exit_code: u8,
    /// The words of the last line that people read, without `result: ok: ` or `result: FAILED: `
    pub message: String,
    /// Further lines about an error, often what to do about it
    pub details: Vec<String>,
}

/// The three ways to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// All checks passed.
    Ok,
    /// The command ran, and a check failed.
    Failed,
    /// The command could not be carried out.
    Error,
}

/// Something happened while a command runs.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct EventLine<'a> {
    /// What every line begins with.
    #[serde(flatten)]
    pub head: Head,
    /// Time since the command began to use the segment, in nanoseconds
    pub time_ns: u64,
    /// Name of the variant of `ringcat::Event`, in place of `Standby` that of `StandbyEvent`; null for what is no event
    /// of the MainDevice
    pub event: Option<String>,
    /// The event in words, for people: they may change without a new version
    pub text: &'a str,
}

/// The simulator answers an order of the standard input.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct AnswerLine<'a> {
    /// What every line begins with.
    #[serde(flatten)]
    pub head: Head,
    /// The order as it was read
    pub order: &'a str,
    /// Whether it was carried out
    pub ok: bool,
    /// The answer in words, or the error
    pub text: &'a str,
}
