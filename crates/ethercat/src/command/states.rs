//! `states`: requests states.

use ringcat_control::client::ClientError;
use ringcat_control::message::Query;
use ringcat_control::tool::ToolQuery;

use crate::failure::Failure;
use crate::selection_help::SELECTION;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Names of the states, and their numbers in AL control.
pub const STATES: [(&str, u8); 5] = [("INIT", 1), ("PREOP", 2), ("BOOT", 3), ("SAFEOP", 4), ("OP", 8)];

/// The command.
pub const COMMAND: Command = Command {
    name: "states",
    summary: "Request application-layer states.",
    forms: &["<STATE>"],
    help: "STATE is INIT, PREOP, BOOT, SAFEOP or OP. The command does not wait until
the slaves have reached it; with --main or --sim it does, since nothing
brings them to it after its end.
",
    options: SELECTION,
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [text] = session.words() else { return Err(Failure::usage("'states' takes one argument: the state!")) };
    let found = STATES.into_iter().find(|(name, _)| name.eq_ignore_ascii_case(text));
    let (_, state) = found.ok_or_else(|| Failure::usage(format!("Invalid state '{text}'!")))?;
    let mut failed = Vec::new();
    for master in session.masters()? {
        for slave in session.listed_slaves(master.master)? {
            let position = slave.line.position;
            if !session.is_standalone() {
                session.done(master.master, ToolQuery::StartState { position, state }, Vec::new())?;
                continue;
            }
            match session.ask(master.master, Query::RequestState { position, state }, Vec::new()) {
                Ok(_) => {}
                // The others may reach it.
                Err(Failure::Asked(ClientError::Refused(refusal))) => {
                    failed.push(format!("Slave {position}: {refusal}"))
                }
                Err(failure) => return Err(failure),
            }
        }
    }
    if failed.is_empty() { Ok(()) } else { Err(Failure::failed(failed.join("\n"))) }
}
