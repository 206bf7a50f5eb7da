//! `alias`: writes aliases into the SIIs.

use ringcat_control::tool::ToolQuery;

use crate::failure::{Failure, Failures};
use crate::numbers;
use crate::selection_help::SELECTION;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "alias",
    summary: "Write alias addresses.",
    forms: &["<ALIAS>"],
    help: "ALIAS is an unsigned 16 bit number; 0 removes the alias.

Writes the alias and the checksum into the SII of the slave. The slave uses
it from its next start on. More than one slave needs --force, and so does an
SII whose checksum was wrong before.
",
    options: SELECTION,
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [text] = session.words() else { return Err(Failure::usage("'alias' needs one argument: the alias!")) };
    let alias = numbers::parse::<u16>(text).ok_or_else(|| Failure::usage(format!("Invalid alias '{text}'!")))?;
    let master = session.single_master()?;
    let slaves = session.slaves(master)?;
    let force = session.arguments.force;
    if slaves.is_empty() {
        session.say("Warning: Selection matches no slaves!");
    }
    if slaves.len() > 1 && !force {
        let text = format!("This will write the alias addresses of {} slaves to {alias}!", slaves.len());
        return Err(Failure::failed(text + " Please specify --force to proceed."));
    }
    let mut failures = Failures::default();
    for slave in slaves {
        let position = slave.line.position;
        let done = session.done(master, ToolQuery::AliasWrite { position, alias, force }, Vec::new());
        failures.keep(master, position, done.map(drop))?;
    }
    failures.all()
}
