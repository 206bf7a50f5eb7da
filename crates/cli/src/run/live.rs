//! A table on a terminal that is drawn over itself: figures of the cycles, states of the SubDevices.
//!
//! Where the standard output is no terminal, nothing is drawn.

use std::fmt::Write as _;
use std::time::Duration;

use ringcat::cyclic_status::{CyclicStatus, Phase};
use ringcat::text::Names;
use ringcat::{
    AlState, ClockStatus, DomainId, Instant, Link, Redundancy, RedundancyLoss, RingState, RingStatus, SubDeviceState,
    SupervisorThread,
};

use crate::output::{draw, is_terminal, write};
use crate::times::us;

/// Time between two drawings.
const PERIOD: Duration = Duration::from_millis(500);
/// Most SubDevices in the list; of more of them those that are not in OP.
const LISTED: usize = 16;
/// Lines must not break on any terminal, or there would be more of them than are drawn over.
const WIDTH: usize = 79;

/// The table.
#[derive(Debug)]
pub struct Live {
    terminal: bool,
    /// Whether there is a ring.
    ring: bool,
    /// Whether there are distributed clocks.
    clocks: bool,
    next: Instant,
    /// Lines on the terminal that will be drawn over.
    drawn: usize,
}

impl Live {
    /// A table on the standard output, if that is a terminal, of a MainDevice with two links or one, with distributed
    /// clocks or without.
    pub fn new(ring: bool, clocks: bool) -> Live {
        Live { terminal: is_terminal(), ring, clocks, next: Instant(0), drawn: 0 }
    }

    /// Draws the table, when it is time for that.
    pub fn show(&mut self, now: Instant, cyclic_status: &CyclicStatus, supervisor: &SupervisorThread, names: &Names) {
        if !self.terminal || now < self.next {
            return;
        }
        self.next = now + PERIOD;
        self.clear();
        let ring = self.ring.then(|| supervisor.ring_status());
        let clocks = if self.clocks { supervisor.clocks().ok() } else { None };
        let clocks = clocks.map(|clocks| clock_line(&clocks, cyclic_status.clock_spread_ns(), cyclic_status.phase()));
        let lines = table(cyclic_status, ring.as_ref(), clocks, &supervisor.states(), names);
        self.drawn = lines.len();
        write(format_args!("{}\n", lines.join("\n")));
    }

    /// Removes the table from the terminal, so that other lines can be printed.
    pub fn clear(&mut self) {
        if self.drawn > 0 {
            // To the first line of the table, then clear to the end of the screen (ECMA-48: CPL, ED).
            draw(format_args!("\x1b[{}F\x1b[J", self.drawn));
            self.drawn = 0;
        }
    }
}

fn table(
    cyclic_status: &CyclicStatus,
    ring: Option<&RingStatus>,
    clocks: Option<String>,
    states: &[SubDeviceState],
    names: &Names,
) -> Vec<String> {
    let (pace, counters, status) =
        (cyclic_status.pace(), cyclic_status.counters(), cyclic_status.status(DomainId(0)).unwrap_or_default());
    let us = |time: Duration| time.as_nanos() as f64 / 1e3;
    let state = status.in_words();
    let (trips, wake_ups) = (cyclic_status.round_trips(), cyclic_status.wake_ups());
    let mut lines = vec![
        format!("{} cycles   wkc {} of {}, {state}", pace.cycles, status.wkc, status.expected),
        format!(
            "the wire      {} frames missing, {} too late, {} damaged",
            counters.missing(),
            counters.lost_late,
            counters.lost_damaged
        ),
        format!("this machine  {} late wake-ups, {} cycles left out", pace.late, pace.skipped),
    ];
    for (title, times) in [("round trips", trips), ("wake-ups", wake_ups)] {
        let (half, most, longest) = (times.quantile(500_000), times.quantile(990_000), times.longest());
        lines.push(format!("{title:<13} 50 % {:.1}, 99 % {:.1}, longest {:.1} us", us(half), us(most), us(longest)));
    }
    lines.extend(ring.into_iter().flat_map(|ring| ring_lines(ring, names)));
    lines.extend(clocks);
    lines.push(count(states));
    lines.extend(list(states, names));
    for line in &mut lines {
        if let Some((at, _)) = line.char_indices().nth(WIDTH) {
            line.truncate(at);
        }
    }
    lines
}

/// The clocks: how many are locked, how far they are apart, how far cycles are from their phase.
fn clock_line(clocks: &[ClockStatus], spread_ns: Option<u32>, phase: Phase) -> String {
    let locked = clocks.iter().filter(|clock| clock.is_locked || clock.is_reference).count();
    let reference = clocks.iter().find(|clock| clock.is_reference);
    let reference = reference.map_or_else(String::new, |clock| format!(", reference {}", clock.position));
    let spread = spread_ns.map_or_else(String::new, |ns| format!(", spread {ns} ns"));
    let phase = phase.is_locked.then(|| format!(", cycles {} us from their phase", us(phase.error_ns)));
    let phase = phase.unwrap_or_default();
    format!("{:<13} {locked} of {} locked{spread}{reference}{phase}", "clocks", clocks.len())
}

/// The ring and both links.
fn ring_lines(status: &RingStatus, names: &Names) -> Vec<String> {
    let state = match status.state {
        RingState::Unknown => "unknown",
        RingState::Closed => "closed",
        RingState::Open => "OPEN",
    };
    let more = match (status.place, status.redundancy) {
        (Some(cable), _) => format!(", break {}", names.cable(cable, status.place_ends)),
        (None, Redundancy::Lost { cause: cause @ RedundancyLoss::OneWay(_), .. }) => format!(", {cause}"),
        (None, _) if status.unsteady => format!(", unsteady: {} changes", status.changes),
        (None, _) => String::new(),
    };
    let mut lines = vec![format!("{:<13} {state}{more}", "ring")];
    for link in [Link::Main, Link::Redundant] {
        let it = status.link(link);
        let carrier = match it.carrier {
            Some(true) => "",
            Some(false) => ", no carrier",
            None => ", carrier unknown",
        };
        lines.push(format!("{:<13} {} SubDevices{carrier}", link.to_string(), it.answering));
    }
    lines
}

/// State of a SubDevice in words.
pub fn word(state: SubDeviceState) -> String {
    match state {
        SubDeviceState::Absent => "does not answer".to_owned(),
        SubDeviceState::Unknown => "unknown: no ACTIVE".to_owned(),
        SubDeviceState::Settled(state) => state.to_string(),
        _ => "is being configured".to_owned(),
    }
}

/// Number of SubDevices in each state.
fn count(states: &[SubDeviceState]) -> String {
    let mut kinds: Vec<(SubDeviceState, usize)> = Vec::new();
    for state in states {
        match kinds.iter_mut().find(|(kind, _)| kind == state) {
            Some((_, count)) => *count += 1,
            None => kinds.push((*state, 1)),
        }
    }
    let mut line = format!("{:<13}", "SubDevices");
    for (at, (state, count)) in kinds.iter().enumerate() {
        // Writing into a String cannot fail.
        let _ = write!(line, "{}{count} {}", if at == 0 { " " } else { ", " }, word(*state));
    }
    line
}

/// One line each, as far as there is room.
fn list(states: &[SubDeviceState], names: &Names) -> Vec<String> {
    let in_op = |state: &SubDeviceState| *state == SubDeviceState::Settled(AlState::Op);
    let all = states.len() <= LISTED;
    let shown = states.iter().enumerate().filter(|(_, state)| all || !in_op(state)).take(LISTED);
    let line = |(number, state): (usize, &SubDeviceState)| {
        let name = names.0.get(number).map_or("", String::as_str);
        format!("{number:>13} {:<24.24} {}", name, word(*state))
    };
    shown.map(line).collect()
}

#[cfg(test)]
mod tests {
    use ringcat::{Cable, PortOf, Position};

    use super::*;

    #[test]
    fn the_ring_is_shown_with_its_break_and_both_links() {
        let mut status = RingStatus::default();
        status.state = RingState::Closed;
        status.links[0].answering = 3;
        status.links[1].carrier = Some(false);
        let names = Names::default();
        let expected = ["ring          closed", "MAIN          3 SubDevices, carrier unknown"];
        assert_eq!(ring_lines(&status, &names)[..2], expected);
        assert_eq!(ring_lines(&status, &names)[2], "REDUNDANT     0 SubDevices, no carrier");
        status.state = RingState::Open;
        status.place = Some(Cable { near: Some(PortOf::new(Position(2), 1)), far: None });
        let expected = "ring          OPEN, break between SubDevice 2 port 1 and the REDUNDANT interface";
        assert_eq!(ring_lines(&status, &names)[0], expected);
    }

    // covers: dc-tools
    #[test]
    fn clocks_have_a_line() {
        let mut clocks = [ClockStatus::default(); 2];
        clocks.iter_mut().for_each(|clock| clock.position = Position(3));
        clocks[0].is_reference = true;
        let mut phase = Phase::default();
        (phase.error_ns, phase.is_locked) = (-1_500, true);
        let expected = "clocks        1 of 2 locked, spread 31 ns, reference 3, cycles -1.5 us from their phase";
        assert_eq!(clock_line(&clocks, Some(31), phase), expected);
        assert_eq!(clock_line(&[], None, Phase::default()), "clocks        0 of 0 locked");
    }

    // covers: run
    #[test]
    fn of_many_subdevices_those_that_are_not_in_op_are_listed() {
        let mut states = vec![SubDeviceState::Settled(AlState::Op); 40];
        states[7] = SubDeviceState::Absent;
        let names = Names((0..40).map(|n| format!("a name that is longer than its column {n}")).collect());
        assert_eq!(count(&states), "SubDevices    39 OP, 1 does not answer");
        assert_eq!(list(&states, &names), ["            7 a name that is longer th does not answer"]);
        assert_eq!(list(&states[..16], &names).len(), 16);
        states.fill(SubDeviceState::Configuring);
        assert_eq!(list(&states, &names).len(), LISTED);
    }
}
