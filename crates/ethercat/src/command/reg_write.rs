//! `reg_write`: writes registers.

use ringcat_control::message::Query;
use ringcat_control::tool::ToolQuery;

use super::download::value_bytes;
use super::reg_read::register;
use crate::data_types;
use crate::failure::Failure;
use crate::inputs;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Most bytes that one question writes.
const PIECE: usize = 1024;
/// Addresses of registers and memory.
const ADDRESSES: usize = 0x1_0000;

/// The command.
pub const COMMAND: Command = Command {
    name: "reg_write",
    summary: "Write data to a slave's registers.",
    forms: &["<ADDRESS> <DATA>"],
    help: "One slave must be selected. ADDRESS is that of the first register. DATA is
the name of a file, '-' for the standard input, or with --type a value.

With --emergency the write goes before everything else and to the position
that is given, also where no slave was found.

Data types for --type:
  bool, int8, int16, int24, int32, int40, int48, int56, int64,
  uint8, uint16, uint24, uint32, uint40, uint48, uint56, uint64,
  float, double, string, octet_string, unicode_string, raw;
  sm8, sm16, sm32, sm64 (sign and magnitude).
",
    options: "  --alias     -a <alias>  Alias of the slave.
  --position  -p <pos>    Its position: in the ring, or with --alias behind
                          it. See the help of 'slaves'.
  --type      -t <type>   Data type.
  --emergency -e          Before everything else.
",
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [address, data] = session.words() else { return Err(Failure::usage("'reg_write' takes two arguments!")) };
    let (address, data) = (register(address)?, data.clone());
    let bytes = match &session.arguments.data_type {
        Some(name) => value_bytes(data_types::named(name)?, &data)?,
        None => inputs::read(&data, ADDRESSES)?,
    };
    if bytes.is_empty() {
        return Err(Failure::failed("There is no data to write!"));
    }
    if usize::from(address) + bytes.len() > ADDRESSES {
        return Err(Failure::usage("Address and size exceeding 64k!"));
    }
    let is_urgent = session.arguments.emergency;
    let (master, position) = if is_urgent { urgent(session)? } else { session.single_slave()? };
    let mut at = usize::from(address);
    for piece in bytes.chunks(PIECE) {
        let address = at as u16;
        let ask = match is_urgent {
            true => Query::Tool(ToolQuery::UrgentWrite { position, address }),
            false => Query::RegisterWrite { position, address },
        };
        session.ask(master, ask, piece.to_vec())?;
        at += piece.len();
    }
    session.say_if_verbose("Register writing finished.");
    Ok(())
}

/// Master and position of an urgent write: no SubDevice needs to be known.
fn urgent(session: &mut Session<'_>) -> Result<(u32, u16), Failure> {
    let master = session.single_master()?;
    let list = session.list(session.arguments.position.as_deref(), "position")?;
    let position = list.single().and_then(|position| u16::try_from(position).ok());
    let position = position.filter(|_| session.arguments.alias.is_none());
    let text = "'reg_write' with --emergency requires one position and no alias!";
    Ok((master, position.ok_or_else(|| Failure::usage(text))?))
}
