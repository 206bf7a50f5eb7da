//! `rescan`: scans the ring again.

use ringcat_control::message::Query;

use crate::failure::Failure;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "rescan",
    summary: "Rescan the bus.",
    forms: &[""],
    help: "Slaves that did not change keep their states. Ends when the scan has ended.\n",
    options: "",
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    for master in session.masters()? {
        // If no process drives the master, it is scanned as soon as one does.
        let scanned = session.ask(master.master, Query::Rescan, Vec::new());
        session.if_driven(scanned)?;
    }
    Ok(())
}
