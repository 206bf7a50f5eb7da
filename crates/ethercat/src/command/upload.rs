//! `upload`: reads an object.

use ringcat_control::message::Query;
use ringcat_control::refusal::ServiceFault;
use ringcat_control::tool::{ToolAnswer, ToolQuery, TransferWork};

use crate::aborts::of_sdo;
use crate::data_types::{self, DataType};
use crate::failure::Failure;
use crate::json;
use crate::json::reads::{Upload, Value};
use crate::numbers;
use crate::progress::Transfer;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Help of both commands for objects.
macro_rules! help {
    ($($more:literal),*) => {
        concat!(
            "One slave must be selected. The data type is that of the dictionary of the
slave. A slave without SDO information, or without this object in its
dictionary, needs --type.

INDEX is the index of the object, an unsigned 16 bit number; SUBINDEX that
of the entry, an unsigned 8 bit number.
",
            $($more,)*
            "
Data types for --type:
  bool, int8, int16, int24, int32, int40, int48, int56, int64,
  uint8, uint16, uint24, uint32, uint40, uint48, uint56, uint64,
  float, double, string, octet_string, unicode_string, raw;
  sm8, sm16, sm32, sm64 (sign and magnitude).
"
        )
    };
}

/// Options of both commands.
pub const OPTIONS: &str = "  --alias    -a <alias>  Alias of the slave.
  --position -p <pos>    Its position: in the ring, or with --alias behind
                         it. See the help of 'slaves'.
  --type     -t <type>   Data type of the entry.
";

/// Help of `download`.
pub const DOWNLOAD_HELP: &str = help!(
    "Without SUBINDEX the whole object is written (complete access).
VALUE is a value of the data type; '-' reads it from the standard input.
"
);

/// The command.
pub const COMMAND: Command = Command {
    name: "upload",
    summary: "Read an SDO entry from a slave.",
    forms: &["<INDEX> <SUBINDEX>"],
    help: help!(),
    options: OPTIONS,
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [index, sub_index] = session.words() else { return Err(Failure::usage("'upload' takes two arguments!")) };
    let (index, sub_index) = (sdo_index(index)?, sdo_sub_index(sub_index)?);
    let (master, position) = session.single_slave()?;
    let data_type = match &session.arguments.data_type {
        Some(name) => data_types::named(name)?,
        None => data_type(session, master, (position, index, sub_index))?,
    };
    let ask = Query::SdoUpload { position, index, sub_index: Some(sub_index) };
    let transfer = Transfer { master, position, work: TransferWork::ObjectRead };
    let (_, value) = session.ask_with_bar(transfer, ask, Vec::new()).map_err(of_sdo)?;
    if session.arguments.json {
        let Value { data_type, value, data } = Value::new(Some(data_type), &value)?;
        return json::print(session, &Upload { master, position, index, subindex: sub_index, data_type, value, data });
    }
    session.write_value(&data_type.show(&value)?)
}

/// Whether the SubDevice has answered, but does not describe the entry.
fn is_of_dictionary(failure: &Failure) -> bool {
    matches!(failure.fault(), Some(ServiceFault::Aborted(_) | ServiceFault::Other))
}

/// The index of an object.
pub(super) fn sdo_index(text: &str) -> Result<u16, Failure> {
    numbers::parse(text).ok_or_else(|| Failure::usage(format!("Invalid SDO index '{text}'!")))
}

/// The sub-index of an entry.
pub(super) fn sdo_sub_index(text: &str) -> Result<u8, Failure> {
    numbers::parse(text).ok_or_else(|| Failure::usage(format!("Invalid SDO subindex '{text}'!")))
}

/// The data type of an entry by the dictionary of the SubDevice.
pub(super) fn data_type(
    session: &mut Session<'_>,
    master: u32,
    (position, index, sub_index): (u16, u16, u8),
) -> Result<DataType, Failure> {
    let asked = session.tool(master, ToolQuery::Entry { position, index, sub_index });
    let entry = match asked {
        Ok(ToolAnswer::Entry(entry)) => entry,
        // The dictionary does not describe the object. Other failures have other reasons.
        Err(failure) if !is_of_dictionary(&failure) => return Err(failure),
        _ => return Err(Failure::failed("Failed to determine SDO entry data type. Please specify --type.")),
    };
    data_types::coded(entry.data_type).ok_or_else(|| {
        let code = entry.data_type;
        Failure::failed(format!("PDO entry has unknown data type 0x{code:04x}! Please specify --type."))
    })
}
