//! `watch`: a live table of states, working counters, ring, clocks and cycles. Not a command of the original tool.

use std::cell::RefCell;
use std::io::{self, IsTerminal};
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::{Duration, Instant};

use ringcat_control::client::ClientError;
use ringcat_control::message::{Answer, MasterState, Query};
use ringcat_control::tool::{CycleReport, ToolAnswer, ToolQuery};
use ringcat_link::HeldSignals;
use ringcat_link::job::{HeldJobSignals, JobSignal};
use ringcat_link::terminal::{CTRL_BACKSLASH, CTRL_C, CTRL_D, CTRL_Z, Key, Keys};

use super::watched::{Watched, lines};
use crate::failure::{Failure, unexpected};
use crate::screen;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Interval of the requests.
const REFRESH: Duration = Duration::from_millis(500);
/// Interval at which keys, signals and the size of the terminal are checked.
const LOOK: Duration = Duration::from_millis(50);

/// The command.
pub const COMMAND: Command = Command {
    name: "watch",
    summary: "Show a live table: states, counters, ring, clocks, cycles.",
    forms: &[""],
    help: "For each master the application that drives it, its ring, frames and lost
frames per second, beside an application its cycles, the working counters of
its domains and its clocks; then a line for each slave, with the difference
from the reference clock where it has one.

In a terminal the table is drawn twice a second at the same place, until q,
Ctrl-C or the end of the input. Ctrl-Z stops the command until a shell
continues it. Elsewhere, and with --once, the table is printed once. Not a
command of IgH.
",
    options: "  --once                 Print the table once.
",
    output: Output::Table,
    run,
};

/// Cycles of a master at the previous request.
#[derive(Clone, Copy)]
struct Before {
    master: u32,
    cycles: CycleReport,
}

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let mut before = Vec::new();
    if session.arguments.once || !io::stdout().is_terminal() || !io::stdin().is_terminal() {
        let lines = table(session, &mut before)?;
        return session.write_text(&lines.concat());
    }
    // A failure of the first table is reported on the normal screen.
    let first = table(session, &mut before)?;
    screen::restore_at_panic();
    let end = Rc::new(RefCell::new(End::start()?));
    let meanwhile = Rc::clone(&end);
    session.check_meanwhile(LOOK, Box::new(move || meanwhile.borrow_mut().check(Duration::ZERO)));
    session.write(screen::BEGIN.as_bytes())?;
    let watched = match draw(session, &mut before, first, &end) {
        Err(Failure::Asked(ClientError::Ended)) => Ok(()),
        watched => watched,
    };
    let left = session.write(screen::END.as_bytes()).and_then(|()| session.flush());
    session.end_checks();
    watched.and(left)
}

/// What ends or interrupts the table: keys and signals.
struct End {
    signals: HeldSignals,
    /// Dropped first: a signal that has come takes effect when the terminal is given back.
    keys: Keys,
    jobs: HeldJobSignals,
    /// Number of times that the program was stopped: the screen was that of others meanwhile.
    stops: u32,
}

impl End {
    fn start() -> io::Result<End> {
        let (signals, jobs) = (HeldSignals::hold(), HeldJobSignals::hold());
        Ok(End { signals, keys: Keys::start()?, jobs, stops: 0 })
    }

    /// Waits so long for a key that ends the table, and looks for signals.
    fn check(&mut self, limit: Duration) -> ControlFlow<()> {
        let pressed = self.keys.next(limit);
        let signal = self.jobs.next();
        if pressed == Some(Key::Byte(CTRL_Z)) {
            self.stop(HeldJobSignals::stop_group);
        } else if signal == Some(JobSignal::Stop) {
            self.stop(HeldJobSignals::stop);
        } else if signal == Some(JobSignal::Continue) {
            self.go_on();
        }
        let is_over = match pressed {
            Some(Key::Byte(byte)) => matches!(byte, b'q' | b'Q' | CTRL_C | CTRL_D | CTRL_BACKSLASH),
            Some(Key::End) => true,
            None => false,
        };
        match is_over || signal == Some(JobSignal::Quit) || self.signals.wait(Duration::ZERO).is_some() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

impl End {
    /// Gives the terminal back, and stops until the shell continues this program.
    fn stop(&mut self, stop: fn(&HeldJobSignals)) {
        screen::put(screen::END);
        self.keys.pause();
        stop(&self.jobs);
        self.go_on();
    }

    /// Takes the terminal again.
    fn go_on(&mut self) {
        self.keys.resume();
        screen::put(screen::BEGIN);
        self.stops = self.stops.wrapping_add(1);
    }
}

/// Draws the table until a key or a signal ends it.
fn draw(
    session: &mut Session<'_>,
    before: &mut Vec<Before>,
    mut table_now: Vec<String>,
    end: &RefCell<End>,
) -> Result<(), Failure> {
    let (mut drawn, mut asked) = (None, Instant::now());
    loop {
        let size = (screen::size(), end.borrow().stops);
        if asked.elapsed() >= REFRESH {
            asked = Instant::now();
            (table_now, drawn) = (table(session, before)?, None);
        }
        if drawn != Some(size) {
            drawn = Some(size);
            session.write(screen::page(&table_now, size.0).as_bytes())?;
            session.flush()?;
        }
        if end.borrow_mut().check(LOOK).is_break() {
            return Ok(());
        }
    }
}

/// The lines of all masters.
fn table(session: &mut Session<'_>, before: &mut Vec<Before>) -> Result<Vec<String>, Failure> {
    let mut all = Vec::new();
    for master in session.masters()? {
        if !all.is_empty() {
            all.push("\n".to_owned());
        }
        match look(session, &master) {
            Ok(watched) => {
                let number = master.master;
                let cycles = watched.report.cycles;
                let last = before.iter().find(|it| it.master == number).map(|it| it.cycles);
                before.retain(|it| it.master != number);
                before.extend(cycles.map(|cycles| Before { master: number, cycles }));
                all.extend(lines(&master, &watched, last));
            }
            // The others are shown all the same.
            Err(Failure::Asked(ClientError::Refused(refusal))) => {
                all.push(format!("Master{}  not shown: {refusal}\n", master.master));
            }
            Err(failure) => return Err(failure),
        }
    }
    Ok(all)
}

/// All that is shown of a master.
fn look(session: &mut Session<'_>, master: &MasterState) -> Result<Watched, Failure> {
    let number = master.master;
    let ToolAnswer::Master(report) = session.tool(number, ToolQuery::Master)? else { return Err(unexpected()) };
    let state = session.state(number)?;
    let (Answer::Overview(seen), _) = session.ask(number, Query::Overview, Vec::new())? else {
        return Err(unexpected());
    };
    let ToolAnswer::Domains(domains) = session.tool(number, ToolQuery::Domains)? else { return Err(unexpected()) };
    let slaves = session.slaves(number)?;
    Ok(Watched { report, state, counts: seen.counts, domains, slaves })
}
