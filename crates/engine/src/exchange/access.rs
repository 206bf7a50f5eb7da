//! What applications read and set between the steps of a cycle.

use core::time::Duration;

use super::copy::Copies;
use super::{
    ClockSetup, CopyError, CopyRule, CyclicCounters, CyclicFrame, Domain, Entry, Exchange, ForeignFrame, ReferenceTime,
};
use crate::domain::{DomainId, DomainStatus, Freshness};
use crate::ring::RingState;
use crate::time::Instant;

impl Exchange {
    /// Number of domains.
    pub fn domain_count(&self) -> usize {
        self.domains.len()
    }

    /// A domain's image: its SubDevices' outputs and inputs. Its address does not change.
    pub fn image(&self, id: DomainId) -> &[u8] {
        self.domains.get(id.0).map_or(&[], Domain::image)
    }

    /// A domain's image, to write outputs. What is written into inputs is overwritten by the next delivery.
    pub fn image_mut(&mut self, id: DomainId) -> &mut [u8] {
        self.domains.get_mut(id.0).map_or(&mut [], Domain::image_mut)
    }

    /// The last judgement of a domain.
    pub fn status(&self, id: DomainId) -> DomainStatus {
        let Some(domain) = self.domains.get(id.0) else { return DomainStatus::default() };
        let pending = domain.oldest().is_some_and(|set| self.frames[set].iter().any(CyclicFrame::is_waiting));
        domain.status(pending)
    }

    /// How old a SubDevice's inputs in a domain are.
    pub fn freshness(&self, id: DomainId, subdevice: usize) -> Freshness {
        let Some(domain) = self.domains.get(id.0) else { return Freshness::Never };
        domain.freshness(subdevice)
    }

    /// The AL status (register 0x0130, lower byte) that a SubDevice showed in the cycle of its domain that was judged
    /// last; zero where it did not answer. `None` before the first, and where its frames show it nowhere
    /// ([`crate::layout::Witness`]).
    pub fn al_status(&self, subdevice: usize) -> Option<u8> {
        let judged = |frame: &&CyclicFrame| {
            let judged = self.domains.get(frame.domain()).map_or(0, Domain::judged);
            (1..=judged).contains(&frame.left())
        };
        let shown = self.frames.iter().filter(judged);
        let newest = shown.filter_map(|frame| Some((frame.left(), frame.al_status(subdevice)?))).max_by_key(|it| it.0);
        newest.map(|(_, status)| status)
    }

    /// Sets the inputs that are copied to outputs in every cycle, in place of those that were before: when a domain is
    /// queued, behind everything that the application wrote. Not for the cyclic path: this allocates.
    ///
    /// # Errors
    /// Sources that are no inputs, targets that are no outputs or have two sources, different lengths; nothing is
    /// changed then.
    pub fn set_copies(&mut self, rules: &[CopyRule]) -> Result<(), CopyError> {
        self.copies = Copies::new(rules, &self.domains, &self.frames)?;
        Ok(())
    }

    /// Whether a copy, by its place in the table, was refused the last time because its source was stale.
    pub fn is_copy_stale(&self, rule: usize) -> bool {
        self.copies.is_stale(rule)
    }

    /// Overrides how long a domain's frames are waited for; the default is as many periods as cycles may be under way,
    /// less a quarter of a period.
    pub fn set_timeout(&mut self, id: DomainId, timeout: Duration) {
        if let Some(domain) = self.domains.get_mut(id.0) {
            domain.set_timeout(timeout);
        }
    }

    /// Reads an entry's value from its image, zero-extended.
    pub fn read(&self, entry: &Entry) -> u64 {
        entry.read(self.image(entry.domain))
    }

    /// Writes an entry's value into its image, truncated to the entry's bits.
    pub fn write(&mut self, entry: &Entry, value: u64) {
        entry.write(self.image_mut(entry.domain), value);
    }

    /// Whether a domain has all its cycles under way, so that it would be skipped now.
    pub fn is_full(&self) -> bool {
        self.domains.iter().any(|domain| domain.is_full(&self.frames))
    }

    /// When the frame left of which a copy was taken last.
    pub fn taken_left_at(&self) -> Instant {
        let Some(frame) = self.frames.get(usize::from(self.taken)) else { return Instant::NEVER };
        let timeout_ns = self.domains.get(frame.domain()).map_or(0, Domain::timeout_ns);
        Instant(frame.deadline().0.saturating_sub(timeout_ns))
    }

    /// Whether frames are out that have not returned as expected. Those that are overdue count until they are given up.
    pub fn in_flight(&self) -> bool {
        self.frames.iter().any(CyclicFrame::is_waiting)
    }

    /// Whether copies of frames are out that may still come: also second ones, of frames whose inputs are delivered.
    pub fn awaits_copies(&self) -> bool {
        self.frames.iter().any(|frame| frame.is_waiting() || frame.is_delivered())
    }

    /// Cycles that begin earlier than this disturb a measurement of propagation delays that found no time without
    /// frames on the wire; long ago where nothing of the kind is asked for. It may be taken back at any time.
    /// Applications that send all the time in a loop of their own look at this before they send.
    pub fn pause_until(&self) -> Instant {
        self.board.traffic.pause_until()
    }

    /// State of the ring as the cyclic frames show it.
    pub fn ring(&self) -> RingState {
        self.evidence.monitor.state()
    }

    /// Says what the application chose about distributed clocks.
    pub fn set_up_clocks(&mut self, setup: ClockSetup) {
        self.evidence.clocks.set_up(setup);
    }

    /// The application's time now, in nanoseconds of system time: what bus shift leads the reference clock to. Without
    /// it, host time plus the epoch of the configuration counts.
    pub fn set_application_time(&mut self, time: u64, now: Instant) {
        self.evidence.clocks.set_application_time(time, now);
    }

    /// The application's time.
    pub fn application_time(&self, now: Instant) -> u64 {
        self.evidence.clocks.application_time(now)
    }

    /// The next frame steers the reference clock towards this time, once. What follows it follows.
    pub fn sync_reference_to(&mut self, time: u64) {
        self.evidence.clocks.want_reference_at(time);
    }

    /// The last reading of the reference clock; `None` before the first and without distributed clocks.
    pub fn reference_time(&self) -> Option<ReferenceTime> {
        self.evidence.clocks.reference_time()
    }

    /// OR of all |0x092C| in nanoseconds as the last cycle saw it: at most twice the largest.
    pub fn clock_spread_ns(&self) -> Option<u32> {
        self.evidence.clocks.spread_ns()
    }

    /// Counters since activation.
    pub fn counters(&self) -> &CyclicCounters {
        &self.counters
    }

    /// Takes the oldest kept frame of another MainDevice (protocol MR-10).
    pub fn pop_foreign(&mut self) -> Option<ForeignFrame<'_>> {
        self.foreign.pop()
    }
}
