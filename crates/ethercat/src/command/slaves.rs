//! `slaves`: SubDevices on the ring.

use ringcat_control::client::ClientError;
use ringcat_control::message::Query;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::{Description, PortsLine, ToolAnswer, ToolQuery};

use super::crc::{of_slave, ports};
use super::slave_details::details;
use crate::append::append;
use crate::failure::{Failure, unexpected};
use crate::json;
use crate::json::details::Known;
use crate::json::slaves::Slaves;
use crate::selection::Slave;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Register SYSTEM_TIME.
const SYSTEM_TIME: u16 = 0x0910;
/// Its bytes.
const SYSTEM_TIME_BYTES: u16 = 8;

/// The command.
pub const COMMAND: Command = Command {
    name: "slaves",
    summary: "Display slaves on the bus.",
    forms: &[""],
    help: "One line for each slave:

1  5555:0  PREOP  +  EL3162 2C. Ana. Input 0-10V
|  |    |  |      |  \\- Name from the SII, otherwise vendor and product.
|  |    |  |      \\- '+', or 'E' after an error or without an answer.
|  |    |  \\- Application-layer state.
|  |    \\- Position behind the last slave with an alias.
|  \\- Alias of that slave.
\\- Position in the ring.

With --verbose all that is known of each slave.

Slave selection:
  Without options: all slaves.
  --position 1,3-5        positions in the ring.
  --alias 5555            the slave with this alias, and those behind it
                          up to the next alias.
  --alias 5555 -p 0-1     positions counted from this alias.
Both take comma-separated numbers and ranges, such as '1,3', '5-7', '-3'.
",
    options: crate::selection_help::SELECTION,
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let masters = session.masters()?;
    let is_several = masters.len() > 1;
    for master in masters {
        let number = master.master;
        let slaves = session.listed_slaves(number)?;
        if session.arguments.json {
            print_json(session, number, &slaves)?;
            continue;
        }
        if session.arguments.verbose {
            let ports = if slaves.is_empty() { Vec::new() } else { ports(session, number)? };
            for slave in &slaves {
                let known = known(session, number, slave, &ports)?;
                session.write_text(&details(number, slave, &known.description, known.has_clock, &known.ports))?;
            }
            continue;
        }
        if is_several && !slaves.is_empty() {
            writeln!(session, "Master{number}")?;
        }
        let indent = if is_several { "  " } else { "" };
        session.write_text(&table(indent, &slaves))?;
    }
    Ok(())
}

fn print_json(session: &mut Session<'_>, master: u32, slaves: &[Slave]) -> Result<(), Failure> {
    let mut all = Vec::new();
    if session.arguments.verbose && !slaves.is_empty() {
        let ports = ports(session, master)?;
        for slave in slaves {
            all.push(known(session, master, slave, &ports)?);
        }
    }
    json::print(session, &Slaves::new(master, slaves, &all))
}

fn known(session: &mut Session<'_>, master: u32, slave: &Slave, ports: &[PortsLine]) -> Result<Known, Failure> {
    let position = slave.line.position;
    let description = description(session, master, position)?;
    let has_clock = has_clock(session, master, position, &description)?;
    Ok(Known { description, has_clock, ports: of_slave(ports, position) })
}

/// What is known of a SubDevice.
pub(super) fn description(session: &mut Session<'_>, master: u32, position: u16) -> Result<Description, Failure> {
    match session.tool(master, ToolQuery::Description { position })? {
        ToolAnswer::Description(description) => Ok(*description),
        _ => Err(unexpected()),
    }
}

/// Whether its controller has a clock. One that only measures delays has no register of the system time.
pub(super) fn has_clock(
    session: &mut Session<'_>,
    master: u32,
    position: u16,
    details: &Description,
) -> Result<bool, Failure> {
    if !details.features.dc {
        return Ok(false);
    }
    let ask = Query::RegisterRead { position, address: SYSTEM_TIME, length: SYSTEM_TIME_BYTES };
    match session.ask(master, ask, Vec::new()) {
        Ok(_) => Ok(true),
        Err(Failure::Asked(ClientError::Refused(Refusal::Service { .. } | Refusal::Failed(_)))) => Ok(false),
        Err(failure) => Err(failure),
    }
}

fn table(indent: &str, slaves: &[Slave]) -> String {
    let row = |slave: &Slave| {
        [slave.line.position.to_string(), slave.alias.to_string(), slave.relative.to_string(), slave.state()]
    };
    let rows: Vec<[String; 4]> = slaves.iter().map(row).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].len()).max().unwrap_or(0);
    let [a, b, c, d] = [0, 1, 2, 3].map(width);
    let mut text = String::new();
    let mut last = None;
    for (slave, [position, alias, relative, state]) in slaves.iter().zip(&rows) {
        // The ring is broken between these two.
        if last.is_some_and(|last| last != slave.line.is_redundant) {
            append!(text, "{indent}xxx LINK FAILURE xxx\n");
        }
        last = Some(slave.line.is_redundant);
        let (flag, name) = (slave.flag(), slave.name());
        append!(text, "{indent}{position:>a$}  {alias:>b$}:{relative:<c$}  {state:<d$}  {flag}  {name}\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selection::counted;
    use ringcat_control::tool::SubDeviceLine;

    // covers: daemon
    #[test]
    fn a_break_of_the_ring_stands_between_the_slaves() {
        let line = |position, is_redundant, status| SubDeviceLine {
            position,
            is_redundant,
            status,
            identity: [2, 3, 0, 0],
            ..SubDeviceLine::default()
        };
        let slaves = counted(vec![line(0, false, Some(2)), line(1, true, Some(0x14)), line(2, true, None)]);
        let wanted = "0  0:0  PREOP         +  0x00000002:0x00000003\nxxx LINK FAILURE xxx\n\
                      1  0:1  SAFEOP+ERROR  E  0x00000002:0x00000003\n\
                      2  0:2  ???           E  0x00000002:0x00000003\n";
        assert_eq!(table("", &slaves), wanted);
    }
}
