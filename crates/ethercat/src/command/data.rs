//! `data`: process data of domains as it is.

use super::domains::selected;
use crate::failure::Failure;
use crate::json;
use crate::json::domains::Data;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "data",
    summary: "Output binary domain process data.",
    forms: &[""],
    help: "The data of the selected domains, one behind the other.\n",
    options: "  --domain -d <index>  Domains; all by default.\n",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    for master in session.masters()? {
        let selected = selected(session, master.master);
        let selected = session.if_driven(selected)?.unwrap_or_default();
        if session.arguments.json {
            json::print(session, &Data::new(master.master, &selected))?;
            continue;
        }
        for (_, _, image) in selected {
            session.write(&image)?;
        }
    }
    Ok(())
}
