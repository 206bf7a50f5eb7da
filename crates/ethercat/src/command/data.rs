//! `data`: process data of domains as it is.

use super::domains::selected;
use crate::failure::Failure;
use crate::session::Session;
use crate::shape::Command;

/// The command.
pub const COMMAND: Command = Command {
    name: "data",
    summary: "Output binary domain process data.",
    forms: &[""],
    help: "The data of the selected domains, one behind the other.\n",
    options: "  --domain -d <index>  Domains; all by default.\n",
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    for master in session.masters()? {
        for (_, _, image) in selected(session, master.master)? {
            session.write(&image)?;
        }
    }
    Ok(())
}
