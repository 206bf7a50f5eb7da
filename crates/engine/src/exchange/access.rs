//! Values that applications read and set between the steps of a cycle.

use core::time::Duration;

use super::copy::Copies;
use super::outcome::outcome;
use super::{
    ClockDatagrams, ClockSetup, CopyError, CopyId, CopyRule, CyclicCounters, CyclicFrame, Domain, Entry, Exchange,
    ForeignFrame, ReferenceTime,
};
use crate::declared::SubDeviceId;
use crate::domain::{DomainId, DomainStatus, Freshness};
use crate::ring::RingState;
use crate::time::Instant;

impl Exchange {
    /// Number of domains.
    pub fn domain_count(&self) -> usize {
        self.domains.len()
    }

    /// Image of a domain: outputs and inputs of its SubDevices. Its address does not change.
    pub fn image(&self, id: DomainId) -> &[u8] {
        self.domains.get(id.0).map_or(&[], Domain::image)
    }

    /// Image of a domain, to write outputs. Writes to inputs are overwritten by the next delivery.
    pub fn image_mut(&mut self, id: DomainId) -> &mut [u8] {
        self.domains.get_mut(id.0).map_or(&mut [], Domain::image_mut)
    }

    /// Puts the image of a domain into memory of the caller, with the content that it has there: outputs in it leave
    /// with the next cycle. The image is the beginning of the memory. Not for the cyclic path. False, and nothing has
    /// changed, if the memory is shorter than the image or there is no such domain.
    pub fn use_memory(&mut self, id: DomainId, memory: &'static mut [u8]) -> bool {
        self.domains.get_mut(id.0).is_some_and(|domain| domain.inputs_mut().use_memory(memory))
    }

    /// Gives back the memory of the caller that holds the image of a domain, as long as the image. The image continues
    /// in own memory. Not for the cyclic path: this allocates. `None` where the image is in own memory.
    pub fn give_memory_back(&mut self, id: DomainId) -> Option<&'static mut [u8]> {
        self.domains.get_mut(id.0)?.inputs_mut().bytes.give_back()
    }

    /// Working counters of a domain's last evaluated cycle by the link on which copies were sent, for readers beside
    /// the application: what the first try of each frame has shown. `None` before the first evaluation and as soon as
    /// the domain is queued again.
    pub fn wkc_by_link(&self, id: DomainId) -> Option<[u32; 2]> {
        let domain = self.domains.get(id.0)?;
        let evaluated = domain.evaluated();
        let of_cycle =
            self.frames.get(domain.frames())?.iter().filter(|frame| evaluated > 0 && frame.left() == evaluated);
        of_cycle.map(CyclicFrame::wkc_by_link).reduce(|sum, more| [sum[0] + more[0], sum[1] + more[1]])
    }

    /// The last state of a domain; `None` if it is not declared.
    pub fn status(&self, id: DomainId) -> Option<DomainStatus> {
        let domain = self.domains.get(id.0)?;
        let pending = domain.oldest().is_some_and(|set| self.frames[set].iter().any(CyclicFrame::is_waiting));
        Some(domain.status(pending))
    }

    /// Age of a SubDevice's inputs in a domain.
    pub fn freshness(&self, id: DomainId, subdevice: SubDeviceId) -> Freshness {
        let Some(domain) = self.domains.get(id.0) else { return Freshness::Never };
        domain.freshness(subdevice.0)
    }

    /// The AL status (register 0x0130, lower byte) that a SubDevice showed in the last evaluated cycle of its domain;
    /// zero where it did not answer. `None` before the first cycle, and where its frames do not show it
    /// ([`crate::layout::Witness`]).
    pub fn al_status(&self, subdevice: SubDeviceId) -> Option<u8> {
        let evaluated = |frame: &&CyclicFrame| {
            let evaluated = self.domains.get(frame.domain()).map_or(0, Domain::evaluated);
            (1..=evaluated).contains(&frame.left())
        };
        let tries = self.again.iter().flatten().map(|again| &again.frame);
        let shown = self.frames.iter().chain(tries).filter(evaluated);
        let newest = shown.filter_map(|frame| Some((frame.left(), frame.al_status(subdevice.0)?)));
        let newest = newest.max_by_key(|(left, status)| (*left, *status != 0));
        newest.map(|(_, status)| status)
    }

    /// Sets the inputs that are copied to outputs in every cycle, replacing the previous table. The copies are made
    /// when a domain is queued, after all writes of the application. Not for the cyclic path: this allocates.
    ///
    /// # Errors
    /// Sources that are not inputs, targets that are not outputs or have two sources, different lengths; the table
    /// stays unchanged then.
    pub fn set_copies(&mut self, rules: &[CopyRule]) -> Result<(), CopyError> {
        self.copies = Copies::new(rules, &self.domains, &self.frames)?;
        self.find_only_frame();
        Ok(())
    }

    /// Whether a copy was refused the last time because its source was stale.
    pub fn is_copy_stale(&self, rule: CopyId) -> bool {
        self.copies.is_stale(rule)
    }

    /// Sets the deadline of a domain's frames; the default is one period per cycle that may be on the wire, less a
    /// quarter of a period.
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

    /// Whether all cycles of a domain are on the wire, so that it would be skipped now.
    pub fn is_full(&self) -> bool {
        self.domains.iter().any(|domain| domain.is_full(&self.frames))
    }

    /// When the frame left of which the last copy was taken.
    pub fn taken_left_at(&self) -> Instant {
        let Some(frame) = self.frames.get(usize::from(self.taken)) else { return Instant::NEVER };
        let domain = self.domains.get(frame.domain());
        let timeout_ns = domain.map_or_else(|| self.service_timeout_ns(), Domain::timeout_ns);
        Instant(frame.deadline().0.saturating_sub(timeout_ns))
    }

    /// Whether frames are on the wire that have not returned as expected. Overdue frames count until they are given up.
    pub fn in_flight(&self) -> bool {
        self.frames.iter().any(CyclicFrame::is_waiting)
    }

    /// Whether frames of the oldest cycle under way of any domain have not returned as expected, whatever their try.
    /// Domains that are queued and have not left await nothing.
    pub fn awaits_frames(&self) -> bool {
        let mut oldest = self.domains.iter().filter_map(Domain::oldest).flatten();
        oldest.any(|at| self.frames.get(at).is_some_and(|frame| outcome(frame, self.again.get(at)).waiting))
    }

    /// Whether copies of frames may still come back, including second copies of frames whose inputs are delivered. As
    /// INACTIVE, frames of the other MainDevice may come at any time.
    pub fn awaits_copies(&self) -> bool {
        let is_open = |frame: &CyclicFrame| frame.is_waiting() || frame.is_delivered();
        self.decide_at != Instant::NEVER || self.frames.iter().any(is_open) || self.standby.awaits_copies()
    }

    /// Cycles that begin earlier than this disturb a measurement of propagation delays that found no time without
    /// frames on the wire; in the distant past without such a request. The request may be withdrawn at any time.
    /// Applications that send continuously in their own loop check this before they send.
    pub fn pause_until(&self) -> Instant {
        self.board.traffic.pause_until()
    }

    /// State of the ring as the cyclic frames show it.
    pub fn ring(&self) -> RingState {
        self.evidence.monitor.state()
    }

    /// Sets the application's choices about distributed clocks.
    pub fn set_up_clocks(&mut self, setup: ClockSetup) {
        self.evidence.clocks.set_up(setup);
    }

    /// Sets the application's time now, in nanoseconds of system time: bus shift steers the reference clock to it.
    /// Without it, host time plus the epoch of the configuration is used. The first time may also be the grid of SYNC
    /// pulses (`PulseGrid`); 0 counts as not set.
    pub fn set_application_time(&mut self, time: u64, now: Instant) {
        self.board.clocks.times.post_application_time(time, now.0);
        self.evidence.clocks.set_application_time(time, now);
    }

    /// Sets the first application time, which was valid at the earlier instant `at`: the grid of SYNC pulses begins
    /// with this time (`PulseGrid`). To be called before [`Exchange::set_application_time`].
    pub fn set_first_application_time(&mut self, time: u64, at: Instant) {
        self.board.clocks.times.post_application_time(time, at.0);
    }

    /// The application's time.
    pub fn application_time(&self, now: Instant) -> u64 {
        self.evidence.clocks.application_time(now)
    }

    /// The next frame sets the reference clock towards this time, once. The other clocks follow.
    pub fn sync_reference_to(&mut self, time: u64) {
        self.evidence.clocks.want_reference_at(time);
    }

    /// Chooses when the datagrams of distributed clocks take effect; in each cycle unless chosen otherwise.
    pub fn set_clock_datagrams(&mut self, policy: ClockDatagrams) {
        self.board.clocks.times.post_called(policy == ClockDatagrams::Called);
        self.evidence.clocks.set_datagrams(policy);
    }

    /// The next frame sets the reference clock towards the application's time when it leaves, once.
    pub fn sync_reference(&mut self, now: Instant) {
        self.evidence.clocks.want_reference_now(now);
    }

    /// The next frame distributes the time of the reference clock, with [`ClockDatagrams::Called`]. No time is
    /// distributed while delays are unknown after a change of cables.
    pub fn sync_clocks(&mut self) {
        self.evidence.clocks.want_distribution();
    }

    /// The next frame reads the differences of all clocks, with [`ClockDatagrams::Called`];
    /// [`Exchange::clock_spread_ns`] is `None` until it is back.
    pub fn monitor_clocks(&mut self) {
        self.evidence.clocks.want_differences();
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
        &self.tally.counters
    }

    /// How often any counter was changed except [`CyclicCounters::sent`], [`CyclicCounters::bytes`] and
    /// [`CyclicCounters::received`]: while this stays the same, so do the others.
    pub fn disturbances(&self) -> u64 {
        self.tally.disturbances
    }

    /// Whether this MainDevice is INACTIVE: nothing is sent, and frames of the other MainDevice of the ring are to be
    /// forwarded.
    #[inline(always)]
    pub fn is_inactive(&self) -> bool {
        self.standby.is_inactive()
    }

    /// Takes the oldest kept frame of another MainDevice (protocol MR-10).
    pub fn pop_foreign(&mut self) -> Option<ForeignFrame<'_>> {
        self.foreign.pop()
    }
}
