//! `download`: writes an object.

use ringcat_control::message::Query;
use ringcat_control::tool::TransferWork;

use super::upload::{data_type, sdo_index, sdo_sub_index};
use crate::aborts::of_sdo;
use crate::data_types::{self, DataType};
use crate::failure::Failure;
use crate::inputs;
use crate::progress::Transfer;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Most bytes of an object that is written.
const MOST: usize = 64 << 10;

/// The command.
pub const COMMAND: Command = Command {
    name: "download",
    summary: "Write an SDO entry to a slave.",
    forms: &["<INDEX> <SUBINDEX> <VALUE>", "<INDEX> <VALUE>"],
    help: super::upload::DOWNLOAD_HELP,
    options: super::upload::OPTIONS,
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let words = session.words().to_vec();
    let (index, sub_index, value) = match &words[..] {
        [index, sub_index, value] => (sdo_index(index)?, Some(sdo_sub_index(sub_index)?), value),
        [index, value] => (sdo_index(index)?, None, value),
        _ => return Err(Failure::usage("'download' takes two or three arguments!")),
    };
    let (master, position) = session.single_slave()?;
    let data_type = match (sub_index, &session.arguments.data_type) {
        (_, Some(name)) => data_types::named(name)?,
        (Some(sub_index), None) => data_type(session, master, (position, index, sub_index))?,
        (None, None) => data_types::named("octet_string")?,
    };
    let bytes = value_bytes(data_type, value)?;
    let ask = Query::SdoDownload { position, index, sub_index };
    let transfer = Transfer { master, position, work: TransferWork::ObjectWrite };
    session.ask_with_bar(transfer, ask, bytes).map_err(of_sdo)?;
    Ok(())
}

/// A value that stands in the arguments, or comes from the standard input.
pub(super) fn value_bytes(data_type: DataType, value: &str) -> Result<Vec<u8>, Failure> {
    if value != "-" {
        return data_type.read(value);
    }
    let bytes = inputs::read("-", MOST)?;
    if data_type.is_text() {
        return Ok(bytes);
    }
    data_type.read(String::from_utf8_lossy(&bytes).trim())
}
