//! `soe_read`: reads an IDN.

use ringcat_control::message::Query;

use crate::aborts::of_soe;
use crate::data_types;
use crate::failure::Failure;
use crate::hex;
use crate::json;
use crate::json::reads::{Idn, Value};
use crate::numbers;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Drives behind a SubDevice.
const DRIVES: u8 = 8;

/// Help of both commands for IDNs.
macro_rules! help {
    ($($more:literal),*) => {
        concat!(
            "One slave must be selected. DRIVE is the number of the drive behind it,
0 to 7, by default 0. IDN is a number, or in the form S-0-100 or P-0-150.
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

/// Help of `soe_write`.
pub const WRITE_HELP: &str = help!("VALUE is a value of the data type, which must be given.\n");

/// The command.
pub const COMMAND: Command = Command {
    name: "soe_read",
    summary: "Read an SoE IDN from a slave.",
    forms: &["<IDN>", "<DRIVE> <IDN>"],
    help: help!("Without a data type the bytes are printed.\n"),
    options: super::reg_read::TYPED,
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let (drive, idn) = match session.words() {
        [idn] => (0, parse_idn(idn)?),
        [drive, idn] => (parse_drive(drive)?, parse_idn(idn)?),
        _ => return Err(Failure::usage("'soe_read' takes one or two arguments!")),
    };
    let data_type = session.arguments.data_type.as_deref().map(data_types::named).transpose()?;
    let (master, position) = session.single_slave()?;
    let asked = session.ask(master, Query::IdnRead { position, drive, idn }, Vec::new());
    let (_, bytes) = asked.map_err(|failure| of_soe(failure, "read"))?;
    if session.arguments.json {
        let Value { data_type, value, data } = Value::new(data_type, &bytes)?;
        return json::print(session, &Idn { master, position, drive, idn, data_type, value, data });
    }
    match data_type {
        Some(data_type) => session.write_value(&data_type.show(&bytes)?),
        None => writeln!(session, "{}", hex::listed(&bytes)),
    }
}

/// The number of a drive.
pub(super) fn parse_drive(text: &str) -> Result<u8, Failure> {
    let drive = numbers::parse(text).filter(|drive| *drive < DRIVES);
    drive.ok_or_else(|| Failure::usage(format!("Invalid drive number '{text}'!")))
}

/// An IDN: a number, or kind, set and block.
pub(super) fn parse_idn(text: &str) -> Result<u16, Failure> {
    let parts: Vec<&str> = text.split('-').collect();
    let idn = match parts[..] {
        [kind, set, block] => {
            let kind = match kind {
                "S" | "s" => Some(0),
                "P" | "p" => Some(0x8000),
                _ => None,
            };
            let set = set.parse::<u16>().ok().filter(|set| *set <= 7);
            let block = block.parse::<u16>().ok().filter(|block| *block <= 4095);
            kind.zip(set).zip(block).map(|((kind, set), block)| kind | set << 12 | block)
        }
        _ => numbers::parse(text),
    };
    idn.ok_or_else(|| Failure::usage(format!("Invalid IDN '{text}'!")))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn idns_are_numbers_or_have_kind_set_and_block() {
        let idns = ["100", "0x8096", "S-0-100", "P-0-150", "p-7-4095", "S-0-0100"].map(|text| parse_idn(text).ok());
        assert_eq!(idns, [Some(100), Some(0x8096), Some(100), Some(0x8096), Some(0xFFFF), Some(100)]);
        for text in ["", "S-8-1", "S-0-4096", "X-0-1", "S-0", "S-0-1-2", "65536", "-1"] {
            assert!(parse_idn(text).is_err(), "{text}");
        }
        assert_eq!(parse_drive("7").ok(), Some(7));
        assert_eq!(parse_drive("9").expect_err("it is too large").text(), "Invalid drive number '9'!\n");
    }
}
