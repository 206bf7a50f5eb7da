//! `reg_read`: reads registers.

use ringcat_control::message::Query;

use crate::data_types;
use crate::failure::Failure;
use crate::hex;
use crate::json;
use crate::json::reads::{Registers, Value};
use crate::numbers;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Bytes that one question reads.
const PIECE: u32 = 1024;
/// First address behind all registers and memory.
const END: u32 = 0x1_0000;

/// Options that select one SubDevice.
pub const SINGLE: &str = "  --alias    -a <alias>  Alias of the slave.
  --position -p <pos>    Its position: in the ring, or with --alias behind
                         it. See the help of 'slaves'.
";

/// The command.
pub const COMMAND: Command = Command {
    name: "reg_read",
    summary: "Output a slave's register contents.",
    forms: &["<ADDRESS> [SIZE]"],
    help: "One slave must be selected. ADDRESS is that of the first register, SIZE
the number of bytes; both are unsigned 16 bit numbers. A data type with a
size makes SIZE unnecessary.

Data types for --type:
  bool, int8, int16, int24, int32, int40, int48, int56, int64,
  uint8, uint16, uint24, uint32, uint40, uint48, uint56, uint64,
  float, double, string, octet_string, unicode_string, raw;
  sm8, sm16, sm32, sm64 (sign and magnitude).
",
    options: TYPED,
    output: Output::Data,
    run,
};

/// Options of commands with a data type for one SubDevice.
pub const TYPED: &str = "  --alias    -a <alias>  Alias of the slave.
  --position -p <pos>    Its position: in the ring, or with --alias behind
                         it. See the help of 'slaves'.
  --type     -t <type>   Data type.
";

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let (address, size) = match session.words() {
        [address] => (register(address)?, None),
        [address, size] => (register(address)?, Some(length(size)?)),
        _ => return Err(Failure::usage("'reg_read' takes one or two arguments!")),
    };
    let data_type = session.arguments.data_type.as_deref().map(data_types::named).transpose()?;
    let implied = data_type.map(|data_type| data_type.bytes as u16).filter(|bytes| *bytes != 0);
    let Some(size) = implied.or(size) else {
        let text =
            "The size argument is mandatory, if no datatype is \nspecified, or the datatype does not imply a size!";
        return Err(Failure::usage(text));
    };
    if u32::from(address) + u32::from(size) > END {
        return Err(Failure::usage("Address and size exceeding 64k!"));
    }
    let (master, position) = session.single_slave()?;
    let mut bytes = Vec::new();
    let (mut at, end) = (u32::from(address), u32::from(address) + u32::from(size));
    while at < end {
        let piece = (end - at).min(PIECE);
        let ask = Query::RegisterRead { position, address: at as u16, length: piece as u16 };
        bytes.extend(session.ask(master, ask, Vec::new())?.1);
        at += piece;
    }
    if session.arguments.json {
        let Value { data_type, value, data } = Value::new(data_type, &bytes)?;
        return json::print(session, &Registers { master, position, address, data_type, value, data });
    }
    match data_type {
        Some(data_type) => session.write_value(&data_type.show(&bytes)?),
        None => writeln!(session, "{}", hex::listed(&bytes)),
    }
}

/// The address of a register.
pub(super) fn register(text: &str) -> Result<u16, Failure> {
    numbers::parse(text).ok_or_else(|| Failure::usage(format!("Invalid address '{text}'!")))
}

fn length(text: &str) -> Result<u16, Failure> {
    match numbers::parse::<u16>(text) {
        Some(0) => Err(Failure::usage("Length may not be zero!")),
        Some(length) => Ok(length),
        None => Err(Failure::usage(format!("Invalid length '{text}'!"))),
    }
}
