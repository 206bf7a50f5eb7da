//! `data`: process data of domains as it is.

use super::domains::selected;
use crate::failure::Failure;
use crate::hex;
use crate::json;
use crate::json::domains::{Data, Image};
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
        let selected = selected(session, master.master)?;
        if session.arguments.json {
            let image = |(domain, _, image): &(u32, _, Vec<u8>)| Image {
                domain: *domain,
                length_bytes: image.len(),
                data: hex::digits(image),
            };
            let domains = selected.iter().map(image).collect();
            json::print(session, &Data { master: master.master, domains })?;
            continue;
        }
        for (_, _, image) in selected {
            session.write(&image)?;
        }
    }
    Ok(())
}
