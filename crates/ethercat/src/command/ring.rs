//! `ring`: the ring, its links and its cables. Not a command of the original tool.

use ringcat_control::message::{Answer, CableSnapshot, Query, RingSnapshot, Snapshot};
use ringcat_control::tool::{ToolAnswer, ToolQuery};

use crate::failure::{Failure, unexpected};
use crate::json;
use crate::json::ring::Ring;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "ring",
    summary: "Show the ring: slaves on each link, a break, errors of cables.",
    forms: &[""],
    help: "Cables and the place of a break are known while an application is active:
then damaged frames and lost links are counted at both ends of each cable.
Not a command of IgH.
",
    options: "",
    output: Output::Data,
    run,
};

/// The names of the links.
pub(super) const LINKS: [&str; 2] = ["MAIN", "REDUNDANT"];

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let masters = session.masters()?;
    for master in &masters {
        let number = master.master;
        let state = session.state(number);
        let Some(state) = session.if_driven(state)? else { continue };
        let (Answer::Overview(seen), _) = session.ask(number, Query::Overview, Vec::new())? else {
            return Err(unexpected());
        };
        let ToolAnswer::Master(report) = session.tool(number, ToolQuery::Master)? else { return Err(unexpected()) };
        if session.arguments.json {
            json::print(session, &Ring::new(number, &state, seen.counts, report.links.len()))?;
            continue;
        }
        if masters.len() > 1 {
            writeln!(session, "Master{number}")?;
        }
        session.write_text(&text(&state, seen.counts, report.links.len()))?;
    }
    Ok(())
}

/// The state of the ring in words.
pub(super) fn state_of(ring: &RingSnapshot, links: usize) -> &'static str {
    match (ring.closed, ring.redundant) {
        _ if links < LINKS.len() => "one link",
        (Some(true), Some(false)) => "closed, frames are lost in one direction",
        (Some(true), _) => "closed",
        (Some(false), _) => "OPEN: the next break isolates slaves",
        (None, _) => "unknown",
    }
}

fn text(state: &Snapshot, counts: [u16; 2], links: usize) -> String {
    let ring = &state.ring;
    let shown = state_of(ring, links);
    let mut text = format!("ring        {shown}\n");
    for ((name, link), count) in LINKS.iter().zip(&ring.links).zip(counts).take(links) {
        let carrier = if link.carrier == Some(false) { ", no carrier" } else { "" };
        text += &format!("{name:<11} {count} slaves{carrier}\n");
    }
    if let Some(place) = &ring.break_at {
        text += &format!("line break  {}\n", cable(place));
    }
    if !state.cables.is_empty() {
        text += "damaged frames, lost links at each cable:\n";
    }
    for at in &state.cables {
        let is_broken = ring.break_at.as_ref().is_some_and(|place| (place.near, place.far) == (at.near, at.far));
        let mark = if is_broken { "  <- line break" } else { "" };
        text += &format!("{:>6} {:>6}  {}{mark}\n", at.errors[0], at.errors[1], cable(at));
    }
    text
}

/// A cable by its two ends.
pub(super) fn cable(cable: &CableSnapshot) -> String {
    let end = |port: Option<(usize, u8)>, host: &str| match port {
        Some((position, port)) => format!("slave {position} port {port}"),
        None => format!("the {host} interface"),
    };
    format!("{} - {}", end(cable.near, LINKS[0]), end(cable.far, LINKS[1]))
}
