//! `sdos`: the dictionaries of SubDevices.

use ringcat_control::tool::{EntryLine, ObjectLine, ToolAnswer, ToolQuery};
use ringcat_wire::sii::MailboxProtocols;

use super::slaves::description;
use crate::data_types;
use crate::failure::{Failure, Failures, unexpected};
use crate::json;
use crate::json::sdos::Sdos;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Bit of CoE details: SDO information.
const INFORMATION: u8 = 2;

/// The command.
pub const COMMAND: Command = Command {
    name: "sdos",
    summary: "List SDO dictionaries.",
    forms: &[""],
    help: "For each object its index and name, for each entry index and subindex,
access rights, data type, length and name:

SDO 0x1018, \"Identity object\"
  0x1018:01, rwrwr-, uint32, 32 bit, \"Vendor id\"

Access rights are read and write in PREOP, in SAFEOP, and in OP. With --quiet
only the objects. Slaves without SDO information have no lines.
",
    options: "  --alias    -a <alias>  Aliases of slaves.
  --position -p <pos>    Their positions. See the help of 'slaves'.
  --quiet    -q          Objects only.
",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let masters = session.masters()?;
    let is_several = masters.len() > 1;
    let mut failures = Failures::default();
    for master in masters {
        let number = master.master;
        let slaves = session.listed_slaves(number)?;
        let has_header = is_several || slaves.len() > 1;
        for slave in slaves {
            let position = slave.line.position;
            if session.arguments.json {
                let printed = print_json(session, number, position);
                failures.keep(number, position, printed)?;
                continue;
            }
            if has_header {
                writeln!(session, "=== Master {number}, Slave {position} ===")?;
            }
            let listed =
                for_each(session, number, position, &mut |session, index, object| text(session, index, &object));
            failures.keep(number, position, listed)?;
        }
    }
    failures.all()
}

/// What is done with an object and its index.
type Act<'f, 's> = dyn FnMut(&mut Session<'s>, u16, ObjectLine) -> Result<(), Failure> + 'f;

fn for_each<'s>(session: &mut Session<'s>, master: u32, position: u16, act: &mut Act<'_, 's>) -> Result<(), Failure> {
    let details = description(session, master, position)?;
    let has_objects = details.protocols & MailboxProtocols::COE != 0 && details.coe & INFORMATION != 0;
    if !has_objects {
        return Ok(());
    }
    let ToolAnswer::Objects(indices) = session.tool(master, ToolQuery::Objects { position })? else {
        return Err(unexpected());
    };
    for index in indices {
        // An object in the list that the SubDevice does not describe is left out.
        let object = match session.tool(master, ToolQuery::Object { position, index }) {
            Ok(ToolAnswer::Object(object)) => object,
            Ok(_) => return Err(unexpected()),
            Err(failure) if failure.aborted().is_some() => continue,
            Err(failure) => return Err(failure),
        };
        act(session, index, object)?;
    }
    Ok(())
}

fn text(session: &mut Session<'_>, index: u16, object: &ObjectLine) -> Result<(), Failure> {
    writeln!(session, "SDO 0x{index:04x}, \"{}\"", printable(&object.name))?;
    if session.arguments.quiet {
        return Ok(());
    }
    object.entries.iter().try_for_each(|entry| session.write_text(&line(index, entry)))
}

fn print_json(session: &mut Session<'_>, master: u32, position: u16) -> Result<(), Failure> {
    let mut all: Vec<(u16, ObjectLine)> = Vec::new();
    for_each(session, master, position, &mut |_, index, object| {
        all.push((index, object));
        Ok(())
    })?;
    let has_entries = !session.arguments.quiet;
    json::print(session, &Sdos::new(master, position, &all, has_entries))
}

/// A name of a dictionary, which holds what the SubDevice sends: one line without control characters.
fn printable(name: &str) -> String {
    name.chars().map(|it| if it.is_control() { ' ' } else { it }).collect()
}

fn line(index: u16, entry: &EntryLine) -> String {
    let data_type = data_types::coded(entry.data_type);
    let data_type = data_type.map_or_else(|| format!("type {:04x}", entry.data_type), |it| it.name.to_owned());
    let right = |bit: u16, letter: char| if entry.access >> bit & 1 != 0 { letter } else { '-' };
    // Read in bits 0 to 2, write in bits 3 to 5: PREOP, SAFEOP, OP.
    let rights: String = (0..3).flat_map(|state| [right(state, 'r'), right(state + 3, 'w')]).collect();
    let EntryLine { sub_index, bits, .. } = entry;
    let name = printable(&entry.name);
    format!("  0x{index:04x}:{sub_index:02x}, {rights}, {data_type}, {bits} bit, \"{name}\"\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn rights_and_types_of_entries_are_listed() {
        let entry = |data_type, access| EntryLine { sub_index: 1, data_type, bits: 32, access, name: "x".to_owned() };
        assert_eq!(line(0x1018, &entry(7, 0b001_111)), "  0x1018:01, rwr-r-, uint32, 32 bit, \"x\"\n");
        assert_eq!(line(0x1018, &entry(0x800, 0b110_000)), "  0x1018:01, ---w-w, type 0800, 32 bit, \"x\"\n");
    }
}
