//! The description of a command: name, help, options, and the function that runs it.

use crate::failure::Failure;
use crate::session::Session;

/// What a command prints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Output {
    /// Data, which `--json` has too.
    Data,
    /// What other commands print too, for people.
    Table,
    /// Nothing: it changes something.
    Nothing,
}

/// A command.
#[derive(Debug)]
#[non_exhaustive]
pub struct Command {
    /// Its name.
    pub name: &'static str,
    /// What it does, for the list of commands.
    pub summary: &'static str,
    /// Forms of its arguments, one for each line.
    pub forms: &'static [&'static str],
    /// Further help, in lines.
    pub help: &'static str,
    /// Its own options, as in the help.
    pub options: &'static str,
    /// What it prints.
    pub output: Output,
    /// Runs it.
    pub run: fn(&mut Session<'_>) -> Result<(), Failure>,
}
