//! Acyclic datagrams with another working counter than expected, condensed to one report per command and address a
//! second.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use crate::time::Instant;

/// Shortest interval of reports about the same command and address.
pub(crate) const INTERVAL: Duration = Duration::from_secs(1);
/// Commands and addresses that are distinguished within an interval. Further ones are reported together.
const MOST: usize = 64;

/// Datagrams of one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WrongCommand {
    pub command: Command,
    pub target: Target,
    pub expected: Wkc,
    /// Working counter of the last of these datagrams.
    pub got: Wkc,
    /// Number of datagrams since the last report.
    pub count: u32,
}

/// What was seen, if it is to be reported.
#[derive(Debug, Default)]
pub(crate) struct CommandReports {
    is_on: bool,
    /// Kinds of datagrams, each with the time of its last report.
    kinds: Vec<(WrongCommand, Instant)>,
    /// Datagrams of kinds beyond [`MOST`].
    others: Option<WrongCommand>,
}

impl CommandReports {
    /// Begins or ends the collection of datagrams.
    pub(crate) fn set_on(&mut self, is_on: bool) {
        *self = CommandReports { is_on, ..CommandReports::default() };
    }

    /// Whether datagrams are taken in.
    pub(crate) fn is_on(&self) -> bool {
        self.is_on
    }

    /// Takes a datagram in; returns it if it is to be reported now.
    pub(crate) fn note(&mut self, wrong: WrongCommand, now: Instant) -> Option<WrongCommand> {
        let is_it = |(it, _): &&mut (WrongCommand, Instant)| (it.command, it.target) == (wrong.command, wrong.target);
        if let Some((known, at)) = self.kinds.iter_mut().find(is_it) {
            let count = known.count.saturating_add(wrong.count);
            *known = WrongCommand { count, ..wrong };
            return take_due(known, at, now);
        }
        if self.kinds.len() == MOST {
            self.kinds.retain(|(known, at)| known.count > 0 || now.since(*at) < INTERVAL);
        }
        if self.kinds.len() == MOST {
            let count = self.others.map_or(0, |others| others.count).saturating_add(wrong.count);
            self.others = Some(WrongCommand { target: Target::None, count, ..wrong });
            return None;
        }
        self.kinds.push((WrongCommand { count: 0, ..wrong }, now));
        Some(wrong)
    }

    /// Kinds of datagrams that have waited for an interval: to be reported now.
    pub(crate) fn take_waiting(&mut self, now: Instant) -> Vec<WrongCommand> {
        let due = self.kinds.iter_mut().filter_map(|(known, at)| take_due(known, at, now));
        let mut due: Vec<WrongCommand> = due.collect();
        due.extend(self.others.take());
        due
    }
}

fn take_due(known: &mut WrongCommand, at: &mut Instant, now: Instant) -> Option<WrongCommand> {
    let is_due = known.count > 0 && now.since(*at) >= INTERVAL;
    let due = is_due.then_some(*known);
    if is_due {
        (known.count, *at) = (0, now);
    }
    due
}

#[cfg(test)]
mod tests {
    use ringcat_wire::address::{RegisterAddress, StationAddress};

    use super::*;

    fn read(station: u16, got: u16) -> WrongCommand {
        let target = Target::Station(StationAddress(station), RegisterAddress(0x130));
        WrongCommand { command: Command::Fprd, target, expected: Wkc(1), got: Wkc(got), count: 1 }
    }

    // covers: jobs
    #[test]
    fn one_command_and_address_is_reported_once_a_second_with_its_number() {
        let mut reports = CommandReports::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        assert_eq!(reports.note(read(1, 0), at(0)), Some(read(1, 0)));
        assert_eq!((1..=5).filter_map(|ms| reports.note(read(1, 2), at(ms))).count(), 0);
        assert_eq!(reports.note(read(2, 0), at(6)), Some(read(2, 0)), "another address");
        assert_eq!(reports.take_waiting(at(999)), []);
        assert_eq!(reports.take_waiting(at(1000)), [WrongCommand { count: 5, ..read(1, 2) }]);
        assert_eq!(reports.take_waiting(at(9000)), []);
        assert_eq!(reports.note(read(1, 0), at(9000)), Some(read(1, 0)));
    }

    // covers: jobs
    #[test]
    fn a_flood_of_addresses_is_bounded_and_no_datagram_is_forgotten() {
        let mut reports = CommandReports::default();
        let mut reported = 0;
        for step in 0..10_000_u64 {
            reported += reports.note(read(step as u16, 0), Instant(step * 1000)).map_or(0, |wrong| wrong.count);
            assert!(reports.kinds.len() <= MOST);
        }
        let waiting = reports.take_waiting(Instant(INTERVAL.as_nanos() as u64 * 2));
        assert!(waiting.len() <= MOST + 1);
        assert_eq!(reported + waiting.iter().map(|wrong| wrong.count).sum::<u32>(), 10_000);
    }
}
