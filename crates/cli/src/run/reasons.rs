//! Checks that failed while `ringcat run` exchanged process data, in words for its last line.

use ringcat::text::Names;
use ringcat::{AlState, ClockStatus, CyclicCounters, RingState, SubDeviceState};

use super::exchange::Run;
use super::live;
use super::pace::Seen;
use crate::output::counted;

/// How the exchange of process data went.
#[derive(Debug, Default)]
pub struct Exchanged {
    before: Seen,
    after: Seen,
    /// Domains that are incomplete at the end.
    incomplete: Vec<String>,
    states: Vec<SubDeviceState>,
    all_settled: bool,
    /// The ring, where there is to be one.
    ring: Option<RingState>,
    clocks: Vec<ClockStatus>,
}

impl Exchanged {
    /// At the end of the exchange, while cycles still run.
    pub fn of(run: &Run, before: &Seen, is_ring: bool, clocks: &[ClockStatus]) -> Exchanged {
        let supervisor = run.cycles.supervisor();
        Exchanged {
            before: *before,
            after: Seen::of(run.cycles.cyclic_status()),
            incomplete: run.incomplete(),
            states: supervisor.states(),
            all_settled: supervisor.all_settled(),
            ring: is_ring.then(|| supervisor.ring_status().state),
            clocks: clocks.to_vec(),
        }
    }

    /// Failed checks; empty if all passed. Frames that several counters have counted are named once.
    pub fn reasons(&self, names: &Names) -> Vec<String> {
        let (before, after) = (&self.before.counters, &self.after.counters);
        let gained = |count: fn(&CyclicCounters) -> u64| count(after).saturating_sub(count(before));
        let lost = gained(|counters| counters.lost);
        let mut reasons = Vec::new();
        for (count, what) in [
            (gained(CyclicCounters::missing), "did not come back"),
            (gained(|counters| counters.lost_late), "came back too late"),
            (gained(|counters| counters.lost_damaged), "came back damaged"),
        ] {
            if count > 0 {
                reasons.push(format!("{} {what}", counted(count as usize, "frame", "frames")));
            }
        }
        // A frame that did not come back in time makes its cycle incomplete, and is named already.
        let incomplete = gained(|counters| counters.incomplete).saturating_sub(lost);
        let cycles = self.after.pace.cycles.saturating_sub(self.before.pace.cycles);
        if incomplete > 0 {
            reasons.push(format!("{incomplete} of {cycles} cycles incomplete"));
        }
        reasons.extend(self.incomplete.iter().map(|words| format!("at the end {words}")));
        reasons.extend(self.after.cycle_time_not_kept(&self.before));
        reasons.extend(self.not_in_state(names));
        match self.ring {
            Some(RingState::Open) => reasons.push("the ring is open".to_owned()),
            Some(RingState::Unknown) => reasons.push("it is unknown whether the ring is closed".to_owned()),
            Some(RingState::Closed) | None => {}
        }
        let unlocked = self.clocks.iter().filter(|clock| clock.is_awaited()).count();
        if unlocked > 0 {
            reasons.push(format!("{unlocked} of {} clocks not locked", self.clocks.len()));
        }
        reasons
    }

    /// The clocks.
    pub fn clocks(&self) -> &[ClockStatus] {
        &self.clocks
    }

    /// The SubDevices.
    pub fn states(&self) -> &[SubDeviceState] {
        &self.states
    }

    /// The ring, where there is to be one.
    pub fn ring(&self) -> Option<RingState> {
        self.ring
    }

    /// SubDevices that left their state; the first by name.
    fn not_in_state(&self, names: &Names) -> Option<String> {
        if self.all_settled {
            return None;
        }
        let is_out = |state: &&SubDeviceState| **state != SubDeviceState::Settled(AlState::Op);
        let first = self.states.iter().position(|state| is_out(&state));
        let count = self.states.iter().filter(is_out).count();
        Some(match first {
            Some(first) => {
                let name = names.0.get(first).map_or_else(String::new, |name| format!(" \"{name}\""));
                let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
                format!("SubDevice {first}{name} {}{more}, not in OP", live::word(self.states[first]))
            }
            None => "not all SubDevices are in their state".to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(counters: CyclicCounters, cycles: u64, skipped: u64) -> Seen {
        let mut pace = ringcat::Pace::default();
        (pace.cycles, pace.skipped) = (cycles, skipped);
        Seen { counters, pace }
    }

    fn settled() -> Exchanged {
        Exchanged { all_settled: true, after: seen(CyclicCounters::default(), 1_000, 0), ..Exchanged::default() }
    }

    fn reasons(exchanged: &Exchanged) -> Vec<String> {
        exchanged.reasons(&Names(vec!["coupler".to_owned()]))
    }

    // covers: lost-frames
    #[test]
    fn lost_frames_are_missing_late_or_damaged_and_no_incomplete_cycles_besides() {
        let mut counters = CyclicCounters::default();
        (counters.lost, counters.lost_late, counters.lost_damaged, counters.incomplete) = (76, 71, 2, 76);
        let mut exchanged = Exchanged { after: seen(counters, 3_704, 0), ..settled() };
        let expected = ["3 frames did not come back", "71 frames came back too late", "2 frames came back damaged"];
        assert_eq!(reasons(&exchanged), expected);
        exchanged.before = exchanged.after;
        assert_eq!(reasons(&exchanged), [""; 0], "what was before counts not");
        exchanged.after.counters.incomplete += 4;
        exchanged.after.pace.cycles += 100;
        assert_eq!(reasons(&exchanged), ["4 of 100 cycles incomplete"]);
    }

    #[test]
    fn a_few_cycles_that_this_machine_left_out_are_no_failure_and_many_are() {
        let few = Exchanged { after: seen(CyclicCounters::default(), 1_000, 90), ..settled() };
        assert_eq!(reasons(&few), [""; 0]);
        let mut skipped = CyclicCounters::default();
        skipped.skipped = 500;
        let many = Exchanged { after: seen(skipped, 1_000, 500), ..settled() };
        assert_eq!(reasons(&many), ["the cycle time was not kept: 1000 of 2000 cycles left out"]);
    }

    #[test]
    fn subdevices_ring_and_clocks_are_checked_at_the_end() {
        let states = vec![SubDeviceState::Absent, SubDeviceState::Settled(AlState::Op), SubDeviceState::Configuring];
        let mut exchanged = Exchanged { states, all_settled: false, ring: Some(RingState::Open), ..settled() };
        exchanged.clocks = vec![ClockStatus::default(); 3];
        exchanged.clocks[0].is_required = true;
        exchanged.clocks[1].is_reference = true;
        exchanged.incomplete = vec!["domain 0: no SubDevice answers, working counter 0 of 3".to_owned()];
        let expected = [
            "at the end domain 0: no SubDevice answers, working counter 0 of 3",
            "SubDevice 0 \"coupler\" does not answer and 1 more, not in OP",
            "the ring is open",
            "1 of 3 clocks not locked",
        ];
        assert_eq!(reasons(&exchanged), expected);
        let closed = Exchanged { ring: Some(RingState::Closed), ..settled() };
        assert_eq!(reasons(&closed), [""; 0]);
    }
}
