//! `eoe`: network interfaces of Ethernet over EtherCAT.

use ringcat_control::tool::{EthernetLine, ToolAnswer, ToolQuery};

use crate::append::append;
use crate::failure::{Failure, unexpected};
use crate::json;
use crate::json::texts::Ethernet;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "eoe",
    summary: "Display Ethernet over EtherCAT statistics.",
    forms: &[""],
    help: "One line for each network interface of a slave: state, bytes and bytes per
second of both directions (Tx: to the slave), and frames that wait to be
sent. Without interfaces there is no output.
",
    options: "",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    for master in session.masters()? {
        let answer = session.tool(master.master, ToolQuery::Ethernet);
        let lines = match session.if_driven(answer)? {
            Some(ToolAnswer::Ethernet(lines)) => lines,
            Some(_) => return Err(unexpected()),
            None => Vec::new(),
        };
        if session.arguments.json {
            json::print(session, &Ethernet::new(master.master, &lines))?;
        } else if !lines.is_empty() {
            session.write_text(&table(master.master, &lines))?;
        }
    }
    Ok(())
}

fn table(master: u32, lines: &[EthernetLine]) -> String {
    let mut text = format!("Master{master}\n  Interface  Slave  State  RxBytes  RxRate  TxBytes  TxRate  TxQueue\n");
    for line in lines {
        let (state, [queued, size]) = (if line.is_up { "up" } else { "down" }, line.queue);
        let ([rx, tx], [rx_rate, tx_rate]) = (line.bytes, line.rates);
        append!(text, "  {:>9}  {:>5}  {state:>5}  {rx:>7}  {rx_rate:>6}  ", line.name, line.position);
        append!(text, "{tx:>7}  {tx_rate:>6}  {:>7}\n", format!("{queued}/{size}"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn columns_are_right_aligned() {
        let line = EthernetLine {
            name: "eoe0s2".to_owned(),
            position: 2,
            is_up: true,
            bytes: [1, 20],
            rates: [3, 4],
            queue: [0, 32],
        };
        let header = "  Interface  Slave  State  RxBytes  RxRate  TxBytes  TxRate  TxQueue";
        let row = "     eoe0s2      2     up        1       3       20       4     0/32";
        let wanted = format!("Master0\n{header}\n{row}\n");
        assert_eq!(table(0, &[line]), wanted);
    }
}
