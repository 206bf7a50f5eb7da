//! Disturbances: procedures that put SubDevices out of reach, take a link out of use or change station addresses on
//! purpose, and procedures that need all of this unchanged. Only one runs at a time.
//!
//! The model does not cancel a running disturbance: it runs until it is undone. The end of an application ends its
//! procedure; the link and the ports that it has changed are restored first then, before any SubDevice is stopped
//! (`procedures/loops.rs`), and addresses that it was assigning are read by the scan that follows. If several are
//! requested, the most urgent one is next. Each ends within its own time limit, and earlier if a more urgent one
//! waits. In a segment that changes repeatedly the more urgent ones may be requested again and again: a kind that
//! [`MOST_PASSED`] others have passed is next, and its turn is not shortened. So each kind waits for at most
//! [`LONGEST_WAIT`] turns of others, also if its procedure gives up waiting and requests it again.

use alloc::vec::Vec;

/// A kind of disturbance; the most urgent one first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Disturbance {
    /// No frame returns: one ring behind a junction after the other is examined, while the others are excluded.
    IsolateRings,
    /// Rings are opened at a port, to measure propagation delays of their cables.
    OpenByPort,
    /// SubDevices without a known station address get one.
    Readdress,
    /// The redundant link is down, to locate crossed lines.
    OpenByLink,
    /// Ports and station addresses of the whole segment are read.
    Rescan,
}

/// Number of kinds.
const KINDS: usize = 5;
/// Turns of other kinds after which a waiting kind is next, whatever its urgency.
const MOST_PASSED: u8 = 3;
/// Turns of other kinds that a waiting kind waits for at most: those that pass it, and the other kinds that were passed
/// as often.
#[cfg(test)]
const LONGEST_WAIT: usize = MOST_PASSED as usize + KINDS - 1;

/// How a disturbance has got its turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Claim {
    /// It was the most urgent one.
    Urgency,
    /// Others have passed it too often.
    Patience,
}

/// A request for a disturbance with the procedure's number: several procedures may request the same kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// The kind.
    pub disturbance: Disturbance,
    /// The number.
    pub number: u32,
}

/// The disturbance under way, and the waiting ones.
#[derive(Debug, Default)]
pub(super) struct Slot {
    running: Option<(Wanted, Claim)>,
    waiting: Vec<Wanted>,
    /// By kind, how often others have passed it since its last turn, while it waited.
    passed: [u8; KINDS],
    /// How often SubDevices were put out of reach.
    isolations: u32,
    /// Number of the next request.
    next_number: u32,
}

impl Slot {
    /// The disturbance under way.
    pub fn running(&self) -> Option<Disturbance> {
        self.running.map(|(running, _)| running.disturbance)
    }

    /// Whether the disturbance under way has this number.
    pub fn is_granted(&self, number: u32) -> bool {
        self.running.is_some_and(|(running, _)| running.number == number)
    }

    /// Whether a more urgent disturbance waits that may shorten the turn of the running one.
    pub fn is_outranked(&self) -> bool {
        let Some((running, Claim::Urgency)) = self.running else { return false };
        self.waiting.iter().any(|waiting| waiting.disturbance < running.disturbance)
    }

    /// How often SubDevices were put out of reach: a scan during such a time does not show which SubDevices answer.
    pub fn isolations(&self) -> u32 {
        self.isolations
    }

    /// Number of the next request.
    pub fn next_number(&self) -> u32 {
        self.next_number
    }

    /// An empty slot, with other numbers than before.
    pub fn emptied(&self) -> Slot {
        let isolations = self.isolations.wrapping_add(1);
        Slot { isolations, next_number: self.next_number, ..Slot::default() }
    }

    /// The same for an application that begins: a procedure that has closed ports for a moment ends then, and releases
    /// its turn.
    pub fn emptied_for_application(&self) -> Slot {
        let running = self.running.filter(|(running, _)| running.disturbance == Disturbance::OpenByPort);
        Slot { running, ..self.emptied() }
    }

    /// Requests a disturbance. It is under way at once if no other is.
    pub fn want(&mut self, wanted: Wanted) {
        self.next_number = wanted.number.wrapping_add(1);
        self.waiting.push(wanted);
        self.grant();
    }

    /// A disturbance has been undone, or its request was withdrawn before it began.
    pub fn end(&mut self, number: u32) {
        self.waiting.retain(|waiting| waiting.number != number);
        if self.is_granted(number) {
            self.running = None;
            self.grant();
        }
    }

    /// The most urgent one, unless others have passed one too often.
    fn next(&self) -> Option<(Wanted, Claim)> {
        let passed = |waiting: &Wanted| self.passed[waiting.disturbance as usize];
        let late = self.waiting.iter().copied().filter(|waiting| passed(waiting) >= MOST_PASSED);
        let late = late.min_by_key(|waiting| (u8::MAX - passed(waiting), waiting.disturbance));
        let urgent = || self.waiting.iter().copied().min_by_key(|waiting| waiting.disturbance);
        late.map(|late| (late, Claim::Patience)).or_else(|| Some((urgent()?, Claim::Urgency)))
    }

    fn grant(&mut self) {
        if self.running.is_some() {
            return;
        }
        let Some((next, claim)) = self.next() else { return };
        self.waiting.retain(|waiting| waiting.number != next.number);
        self.running = Some((next, claim));
        let mut is_passed = [false; KINDS];
        self.waiting.iter().for_each(|waiting| is_passed[waiting.disturbance as usize] = true);
        is_passed[next.disturbance as usize] = false;
        self.passed[next.disturbance as usize] = 0;
        for (passed, _) in self.passed.iter_mut().zip(is_passed).filter(|(_, is)| *is) {
            *passed = passed.saturating_add(1);
        }
        let is_isolation = next.disturbance == Disturbance::IsolateRings;
        self.isolations = self.isolations.wrapping_add(u32::from(is_isolation));
    }
}

#[cfg(test)]
mod tests {
    use super::Disturbance::{IsolateRings, OpenByLink, OpenByPort, Readdress, Rescan};
    use super::*;

    const ALL: [Disturbance; KINDS] = [IsolateRings, OpenByPort, Readdress, OpenByLink, Rescan];

    /// Kinds that are requested every so many steps, last this many steps, and give up waiting after this many.
    #[derive(Clone, Copy)]
    struct Rate {
        every: u64,
        lasts: u64,
        patience: u64,
    }

    /// A segment in which all kinds are requested again and again. Returns the most turns of other kinds that one of
    /// them has waited for, and how often each had its turn.
    fn flap(rates: [Rate; KINDS], steps: u64) -> (usize, [usize; KINDS]) {
        let mut slot = Slot::default();
        let (mut requested, mut ends, mut number) = ([None::<(u32, u64)>; KINDS], 0, 0);
        // By kind: turns of others since it began to wait, given-up requests included.
        let (mut waited, mut most, mut turns) = ([None::<usize>; KINDS], 0, [0; KINDS]);
        let mut running = None;
        for now in 0..steps {
            for (kind, rate) in rates.into_iter().enumerate() {
                match requested[kind] {
                    None if now % rate.every == 0 && running != Some(kind) => {
                        slot.want(Wanted { disturbance: ALL[kind], number });
                        requested[kind] = Some((number, now));
                        waited[kind].get_or_insert(0);
                        number += 1;
                    }
                    Some((number, since)) if !slot.is_granted(number) && now - since >= rate.patience => {
                        slot.end(number);
                        requested[kind] = None;
                    }
                    _ => {}
                }
            }
            if let Some(kind) = running
                && now >= ends
            {
                let (number, _) = requested[kind].take().expect("it runs");
                slot.end(number);
                running = None;
            }
            if running.is_none()
                && let Some(kind) = slot.running().map(|it| it as usize)
            {
                (running, ends) = (Some(kind), now + rates[kind].lasts);
                most = most.max(waited[kind].take().unwrap_or(0));
                turns[kind] += 1;
                let waiting = waited.iter_mut().zip(&requested).filter(|(_, requested)| requested.is_some());
                waiting.filter_map(|(waited, _)| waited.as_mut()).for_each(|waited| *waited += 1);
            }
        }
        (most.max(waited.into_iter().flatten().max().unwrap_or(0)), turns)
    }

    // covers: ring-flap
    #[test]
    fn a_segment_that_flaps_at_any_rate_lets_no_disturbance_wait_for_ever() {
        let (mut most, mut fewest) = (0, usize::MAX);
        for every in [1, 2, 7, 40, 250] {
            for lasts in [1, 3, 20, 90] {
                for patience in [lasts * KINDS as u64, 1_000, u64::MAX] {
                    let rate = |kind: u64| Rate { every: every + kind, lasts: lasts + kind, patience };
                    let (waited, turns) = flap([rate(0), rate(1), rate(2), rate(3), rate(4)], 100_000);
                    most = most.max(waited);
                    fewest = fewest.min(turns.into_iter().min().unwrap_or(0));
                    assert!(waited <= LONGEST_WAIT, "every {every}, {lasts}, {patience}: {waited} turns, {turns:?}");
                }
            }
        }
        assert!(most > MOST_PASSED.into() && fewest >= 100, "{most} turns of others, {fewest} of each kind");
    }

    #[test]
    fn a_turn_by_patience_is_not_shortened_and_the_next_is_by_urgency_again() {
        let mut slot = Slot::default();
        slot.want(Wanted { disturbance: IsolateRings, number: 0 });
        slot.want(Wanted { disturbance: Rescan, number: 1 });
        for number in 2..=1 + u32::from(MOST_PASSED) {
            slot.want(Wanted { disturbance: IsolateRings, number });
            slot.end(slot.running.expect("one runs").0.number);
            assert_eq!(slot.running(), Some(IsolateRings), "request {number}");
        }
        slot.want(Wanted { disturbance: IsolateRings, number: 9 });
        slot.end(1 + u32::from(MOST_PASSED));
        assert!(slot.is_granted(1) && !slot.is_outranked());
        slot.want(Wanted { disturbance: Rescan, number: 10 });
        slot.end(1);
        assert!(slot.is_granted(9));
    }

    fn want(slot: &mut Slot, wanted: impl IntoIterator<Item = Disturbance>) {
        for (number, disturbance) in (0..).zip(wanted) {
            slot.want(Wanted { disturbance, number });
        }
    }

    #[test]
    fn one_disturbance_runs_at_a_time_and_the_most_urgent_is_next() {
        let mut slot = Slot::default();
        want(&mut slot, [OpenByLink, OpenByPort, IsolateRings]);
        assert_eq!((slot.running(), slot.isolations()), (Some(OpenByLink), 0));
        assert!(slot.is_outranked());
        slot.end(0);
        assert!(!slot.is_outranked());
        assert_eq!((slot.running(), slot.isolations()), (Some(IsolateRings), 1));
        slot.end(2);
        assert_eq!(slot.running(), Some(OpenByPort));
        slot.end(1);
        assert_eq!(slot.running(), None);
    }

    #[test]
    fn a_withdrawn_disturbance_is_not_granted() {
        let mut slot = Slot::default();
        want(&mut slot, [IsolateRings, OpenByPort]);
        slot.end(1);
        assert_eq!(slot.running(), Some(IsolateRings));
        slot.end(0);
        assert_eq!(slot.running(), None);
    }

    #[test]
    fn two_disturbances_of_a_kind_run_one_after_the_other() {
        let mut slot = Slot::default();
        want(&mut slot, [Rescan, Rescan]);
        assert!(slot.is_granted(0) && !slot.is_granted(1));
        slot.end(0);
        assert!(slot.is_granted(1));
        slot.end(0);
        assert!(slot.is_granted(1));
    }
}
