//! `debug`: the level of messages.

use ringcat_control::tool::ToolQuery;

use crate::failure::Failure;
use crate::numbers;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "debug",
    summary: "Set the master's debug level.",
    forms: &["<LEVEL>"],
    help: "LEVEL is 0: no messages, 1: steps of scans, states, mail and clocks,
or 2 and above: also the content of all acyclic frames.
",
    options: "",
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [text] = session.words() else { return Err(Failure::usage("'debug' needs one argument: the level!")) };
    let level = numbers::parse(text).ok_or_else(|| Failure::usage(format!("Invalid debug level '{text}'!")))?;
    for master in session.masters()? {
        // If no process drives the master, it keeps the level until one does.
        let done = session.done(master.master, ToolQuery::SetDebugLevel { level }, Vec::new());
        session.if_driven(done)?;
    }
    Ok(())
}
