//! `clocks`: the distributed clocks. Not a command of the original tool.

use ringcat_control::message::ClockSnapshot;

use crate::failure::Failure;
use crate::json;
use crate::json::ring::Clocks;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "clocks",
    summary: "Show the distributed clocks: delays, drifts, differences.",
    forms: &[""],
    help: "One line for each clock: position of the slave, propagation delay, drift,
difference from the reference clock, the largest difference since the clock
was locked, and its state. An application has to use the clocks. Not a
command of IgH.
",
    options: "",
    output: Output::Data,
    run,
};

/// Titles of the columns.
const TITLES: [&str; 6] = ["slave", "delay ns", "drift ppb", "difference ns", "largest ns", "state"];

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let masters = session.masters()?;
    for master in &masters {
        let number = master.master;
        let state = session.state(number);
        let Some(state) = session.if_driven(state)? else { continue };
        if session.arguments.json {
            json::print(session, &Clocks::new(number, &state.clocks))?;
            continue;
        }
        if masters.len() > 1 {
            writeln!(session, "Master{number}")?;
        }
        if state.clocks.is_empty() {
            session.say("No application uses the distributed clocks.");
        } else {
            session.write_text(&table(&state.clocks))?;
        }
    }
    Ok(())
}

fn table(clocks: &[ClockSnapshot]) -> String {
    let row = |clock: &ClockSnapshot| {
        let state = match (clock.is_reference, clock.is_locked) {
            (true, _) => "reference",
            (false, true) => "locked",
            (false, false) => "not locked",
        };
        let difference = clock.difference_ns.map_or_else(|| "-".to_owned(), |difference| difference.to_string());
        let (position, delay, drift) = (clock.position.to_string(), clock.delay_ns, clock.drift_ppb);
        [position, delay.to_string(), drift.to_string(), difference, clock.worst_ns.to_string(), state.to_owned()]
    };
    let rows: Vec<[String; 6]> = [TITLES.map(str::to_owned)].into_iter().chain(clocks.iter().map(row)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].len()).max().unwrap_or(0);
    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(width);
    let line = |row: &[String; 6]| {
        let [position, delay, drift, difference, worst, state] = row;
        format!("{position:>a$}  {delay:>b$}  {drift:>c$}  {difference:>d$}  {worst:>e$}  {state}\n")
    };
    rows.iter().map(line).collect()
}
