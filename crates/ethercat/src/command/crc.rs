//! `crc`: error counters of all ports.

use ringcat_control::message::Query;
use ringcat_control::tool::{MOST_SUBDEVICES, Piece, PortLine, PortsLine, ToolAnswer, ToolQuery};

use crate::append::append;
use crate::failure::{Failure, Failures, unexpected};
use crate::json;
use crate::json::slaves::Crc;
use crate::selection::Slave;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Register RX_ERROR_COUNTER, where all counters begin.
const COUNTERS: u16 = 0x0300;
/// Bytes of all counters.
const COUNTER_BYTES: usize = 20;
/// Letters of a name that are shown.
const NAME: usize = 11;

/// The command.
pub const COMMAND: Command = Command {
    name: "crc",
    summary: "Show or reset the error counters of all ports.",
    forms: &["", "reset"],
    help: "For each port with a link:
  CRC  invalid frames (register 0x0300 and following),
  PHY  receive errors (0x0301),
  FWD  errors found before (0x0308),
  NXT  whether the next slave (down) or the previous one (up) is there.

With 'reset' all counters of all slaves become zero.
",
    options: "",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let is_reset = match session.words() {
        [] => false,
        [word] if word == "reset" => true,
        _ => return Err(Failure::usage("'crc' takes either no or 'reset' argument!")),
    };
    if is_reset && session.arguments.json {
        return Err(Failure::usage("'crc reset' prints no data: it has no --json!"));
    }
    let master = session.single_master()?;
    let slaves = session.all_slaves(master)?;
    if is_reset {
        let mut failures = Failures::default();
        for slave in slaves {
            let position = slave.line.position;
            let ask = Query::RegisterWrite { position, address: COUNTERS };
            let done = session.ask(master, ask, vec![0; COUNTER_BYTES]);
            failures.keep(master, position, done.map(drop))?;
        }
        return failures.all();
    }
    let ports = ports(session, master)?;
    if session.arguments.json {
        return json::print(session, &Crc::new(master, &slaves, &ports));
    }
    let text = table(&slaves, &ports);
    session.write_text(&text)
}

/// The ports of all SubDevices of a master.
pub(super) fn ports(session: &mut Session<'_>, master: u32) -> Result<Vec<PortsLine>, Failure> {
    let mut lines: Vec<PortsLine> = Vec::new();
    loop {
        let from = u16::try_from(lines.len()).unwrap_or(u16::MAX);
        let answer = session.tool(master, ToolQuery::Ports { from, most: MOST_SUBDEVICES as u16 })?;
        let ToolAnswer::Ports(Piece { total, these }) = answer else { return Err(unexpected()) };
        let is_last = these.len() < MOST_SUBDEVICES;
        lines.extend(these);
        if is_last || lines.len() >= total as usize || from == u16::MAX {
            return Ok(lines);
        }
    }
}

/// The ports of the SubDevice at a position; without links where they are not known.
pub(super) fn of_slave(ports: &[PortsLine], position: u16) -> PortsLine {
    ports.iter().find(|line| line.position == position).cloned().unwrap_or_default()
}

fn table(slaves: &[Slave], ports: &[PortsLine]) -> String {
    let mut text = "   |Port 0         |Port 1         |Port 2         |Port 3         |\n".to_owned();
    text += "   |CRC PHY FWD NXT|CRC PHY FWD NXT|CRC PHY FWD NXT|CRC PHY FWD NXT|\n";
    for slave in slaves {
        let position = slave.line.position;
        let own = of_slave(ports, position);
        let cells: String = own.ports.iter().map(|port| cell(position, port) + "|").collect();
        let name: String = slave.line.name.chars().take(NAME).collect();
        append!(text, "{position:>3}|{cells}{name}\n");
    }
    text
}

fn cell(position: u16, port: &PortLine) -> String {
    if !port.link[0] {
        return " ".repeat(15);
    }
    let [invalid, errors, forwarded, _] = port.errors;
    let next = match port.neighbour {
        Some(neighbour) if neighbour < position => '↑',
        Some(_) => '↓',
        None => ' ',
    };
    format!("{invalid:>3} {errors:>3} {forwarded:>3}   {next}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selection::counted;
    use ringcat_control::tool::SubDeviceLine;

    // covers: daemon
    #[test]
    fn counters_of_ports_with_a_link_are_shown_with_arrows() {
        let port = |errors, neighbour| PortLine { link: [true; 3], errors, neighbour, ..PortLine::default() };
        let none = PortLine::default();
        let name = "EL3102 2Ch. Ana. Input".to_owned();
        let slaves = counted(vec![SubDeviceLine { position: 1, name, ..SubDeviceLine::default() }]);
        let ports = [port([0, 1, 3, 0], Some(0)), port([2, 3, 255, 0], Some(2)), none, none];
        let text = table(&slaves, &[PortsLine { position: 1, delay_ns: 0, ports }]);
        let wanted = "  1|  0   1   3   ↑|  2   3 255   ↓|               |               |EL3102 2Ch.";
        assert_eq!(text.lines().nth(2), Some(wanted));
    }
}
