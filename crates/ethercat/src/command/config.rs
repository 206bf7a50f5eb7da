//! `config`: what the application has declared.

use ringcat_control::tool::{DeclaredLine, MOST_DECLARED, Piece, ToolAnswer, ToolQuery};

use super::config_details::details;
use crate::failure::{Failure, unexpected};
use crate::json;
use crate::json::config::Config;
use crate::selection::{self, Slave};
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "config",
    summary: "Show slave configurations.",
    forms: &[""],
    help: "One line for each slave that the active application has configured:

1001:0  0x0000003b/0x02010000  3  OP
|       |                      |  \\- Application-layer state, '-' if none.
|       |                      \\- Position of the slave, '-' if none.
|       \\- Expected vendor id and product code.
\\- Alias and relative position.

With --verbose everything that is configured.
",
    options: "  --alias    -a <alias>  Aliases of configurations.
  --position -p <pos>    Their positions; alone: those with alias 0.
",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let masters = session.masters()?;
    let (is_several, is_verbose) = (masters.len() > 1, session.arguments.verbose);
    let aliases = session.arguments.alias.as_deref().map(|text| session.list(Some(text), "alias")).transpose()?;
    let positions = session.arguments.position.as_deref().map(|text| session.list(Some(text), "position"));
    let positions = positions.transpose()?;
    for master in masters {
        let number = master.master;
        let all = declared(session, number);
        let all = session.if_driven(all)?.unwrap_or_default();
        let lines = selection::declared(all, aliases.as_ref(), positions.as_ref());
        let slaves = if lines.is_empty() { Vec::new() } else { session.all_slaves(number)? };
        if session.arguments.json {
            json::print(session, &Config::new(number, &lines, &slaves))?;
            continue;
        }
        if lines.is_empty() {
            continue;
        }
        if is_several {
            writeln!(session, "Master{number}")?;
        }
        let indent = if is_several { "  " } else { "" };
        let text = if is_verbose {
            lines.iter().map(|line| details(indent, line, &attached(line, &slaves))).collect()
        } else {
            table(indent, &lines, &slaves)
        };
        session.write_text(&text)?;
    }
    Ok(())
}

/// All declared SubDevices of a master.
pub(super) fn declared(session: &mut Session<'_>, master: u32) -> Result<Vec<DeclaredLine>, Failure> {
    let mut lines: Vec<DeclaredLine> = Vec::new();
    loop {
        let from = u16::try_from(lines.len()).unwrap_or(u16::MAX);
        let answer = session.tool(master, ToolQuery::Declared { from })?;
        let ToolAnswer::Declared(Piece { total, these }) = answer else { return Err(unexpected()) };
        let is_last = these.len() < MOST_DECLARED;
        lines.extend(these);
        if is_last || lines.len() >= total as usize || from == u16::MAX {
            return Ok(lines);
        }
    }
}

/// Position and AL state of the SubDevice that is the declared one; empty where there is none.
fn attached(line: &DeclaredLine, slaves: &[Slave]) -> Option<(u16, String)> {
    let position = line.found?;
    let slave = slaves.iter().find(|slave| slave.line.position == position);
    Some((position, slave.map_or_else(|| "???".to_owned(), Slave::state)))
}

fn table(indent: &str, lines: &[DeclaredLine], slaves: &[Slave]) -> String {
    let row = |line: &DeclaredLine| {
        let attached = attached(line, slaves);
        let (position, state) =
            attached.map_or(("-".to_owned(), "-".to_owned()), |(position, state)| (position.to_string(), state));
        let [vendor, product] = line.identity;
        [line.alias.to_string(), line.position.to_string(), format!("0x{vendor:08x}/0x{product:08x}"), position, state]
    };
    let rows: Vec<[String; 5]> = lines.iter().map(row).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].len()).max().unwrap_or(0);
    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(width);
    let format = |[alias, place, identity, position, state]: &[String; 5]| {
        format!("{indent}{alias:>a$}:{place:<b$}  {identity:<c$}  {position:>d$}  {state:<e$}  \n")
    };
    rows.iter().map(format).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_control::tool::SubDeviceLine;

    // covers: daemon
    #[test]
    fn columns_are_as_wide_as_the_widest_entry() {
        let line = |alias, position, found| DeclaredLine {
            alias,
            position,
            identity: [2, 0x0C1E_3052],
            found,
            ..DeclaredLine::default()
        };
        let status = SubDeviceLine { position: 1, status: Some(8), ..SubDeviceLine::default() };
        let slaves = selection::counted(vec![status]);
        let text = table("", &[line(0, 7, None), line(1000, 0, Some(1))], &slaves);
        let wanted = "   0:7  0x00000002/0x0c1e3052  -  -   \n1000:0  0x00000002/0x0c1e3052  1  OP  \n";
        assert_eq!(text, wanted);
    }
}
