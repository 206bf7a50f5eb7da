//! `pdos`: SyncManagers, PDOs and entries.

use ringcat_control::tool::{Description, SyncManagerLine};

use super::matlab;
use super::slaves::description;
use crate::append::append;
use crate::failure::Failure;
use crate::json;
use crate::json::pdos::Pdos;
use crate::selection::Slave;
use crate::session::Session;
use crate::shape::{Command, Output};

const PLAIN: &str = "default";
const MATLAB: &str = "etherlab";
/// Forms of the output.
pub const SKINS: [&str; 2] = [PLAIN, MATLAB];

/// The command.
pub const COMMAND: Command = Command {
    name: "pdos",
    summary: "List sync managers, PDO assignment and mapping.",
    forms: &[""],
    help: "For each sync manager its registers, the PDOs that are assigned to it and
their entries. Skin 'etherlab' prints a MATLAB function instead.
",
    options: "  --alias    -a <alias>  Aliases of slaves.
  --position -p <pos>    Their positions. See the help of 'slaves'.
  --skin     -s <skin>   'default' or 'etherlab'.
",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let is_matlab = match session.arguments.skin.as_deref() {
        None | Some(PLAIN) => false,
        Some(MATLAB) => true,
        Some(other) => return Err(Failure::usage(format!("Invalid skin '{other}'!"))),
    };
    if is_matlab && session.arguments.json {
        return Err(Failure::usage("Skin 'etherlab' has no --json!"));
    }
    let masters = session.masters()?;
    let is_several = masters.len() > 1;
    for master in masters {
        let number = master.master;
        let slaves = session.listed_slaves(number)?;
        if session.arguments.json {
            print_json(session, number, &slaves)?;
            continue;
        }
        let has_header = is_several || slaves.len() > 1;
        for slave in slaves {
            let details = description(session, number, slave.line.position)?;
            if details.sync_managers.is_empty() {
                continue;
            }
            if is_matlab {
                session.write_text(&matlab::function(number, &slave, &details))?;
                continue;
            }
            if has_header {
                writeln!(session, "=== Master {number}, Slave {} ===", slave.line.position)?;
            }
            session.write_text(&listed(&details))?;
        }
    }
    Ok(())
}

fn print_json(session: &mut Session<'_>, master: u32, slaves: &[Slave]) -> Result<(), Failure> {
    let mut all = Vec::new();
    for slave in slaves {
        let position = slave.line.position;
        all.push((position, description(session, master, position)?));
    }
    all.retain(|(_, details)| !details.sync_managers.is_empty());
    json::print(session, &Pdos::new(master, &all))
}

fn listed(details: &Description) -> String {
    (0..).zip(&details.sync_managers).map(sync_manager).collect()
}

fn sync_manager((number, own): (u8, &SyncManagerLine)) -> String {
    let SyncManagerLine { start, length, control, enable, .. } = own;
    let mut text = format!("SM{number}: PhysAddr 0x{start:04x}, DefaultSize {length:>4}, ");
    append!(text, "ControlRegister 0x{control:02x}, Enable {enable}\n");
    let kind = if own.is_output { "RxPDO" } else { "TxPDO" };
    for pdo in &own.pdos {
        append!(text, "  {kind} 0x{:04x} \"{}\"\n", pdo.index, pdo.name);
        for entry in &pdo.entries {
            let (index, sub_index, bits) = (entry.index, entry.sub_index, entry.bits);
            append!(text, "    PDO entry 0x{index:04x}:{sub_index:02x}, {bits:>2} bit, \"{}\"\n", entry.name);
        }
    }
    text
}
