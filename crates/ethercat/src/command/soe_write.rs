//! `soe_write`: writes an IDN.

use ringcat_control::message::Query;

use super::download::value_bytes;
use super::soe_read::{parse_drive, parse_idn};
use crate::aborts::of_soe;
use crate::data_types;
use crate::failure::Failure;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "soe_write",
    summary: "Write an SoE IDN to a slave.",
    forms: &["<IDN> <VALUE>", "<DRIVE> <IDN> <VALUE>"],
    help: super::soe_read::WRITE_HELP,
    options: super::reg_read::TYPED,
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let (drive, idn, value) = match session.words() {
        [idn, value] => (0, parse_idn(idn)?, value.clone()),
        [drive, idn, value] => (parse_drive(drive)?, parse_idn(idn)?, value.clone()),
        _ => return Err(Failure::usage("'soe_write' takes two or three arguments!")),
    };
    let data_type = session.arguments.data_type.as_deref().map(data_types::named).transpose()?;
    let data_type = data_type.ok_or_else(|| Failure::usage("Please specify a data type."))?;
    let bytes = value_bytes(data_type, &value)?;
    let (master, position) = session.single_slave()?;
    let asked = session.ask(master, Query::IdnWrite { position, drive, idn }, bytes);
    asked.map_err(|failure| of_soe(failure, "write"))?;
    Ok(())
}
