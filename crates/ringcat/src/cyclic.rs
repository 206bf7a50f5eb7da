//! The cyclic half in this runtime: the beginning of cycles, the due domains, the counters.
//!
//! Nothing here waits, allocates or locks. Functions that each cycle calls are inlined on purpose: the calls alone
//! would take a tenth of a cycle's instructions (bin `socket_cycle`).

#[cfg(not(feature = "standby"))]
mod alone;
mod by_hand;
#[cfg(feature = "standby")]
mod of_two;

use std::sync::Arc;
use std::time::Duration;

use ringcat_engine::Follower;
use ringcat_engine::domain::DomainId;
use ringcat_engine::exchange::{CopyError, CopyRule, Exchange, Received};
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{Active, Directory};
use ringcat_engine::time::Instant;

use crate::cyclic_status::CyclicStatus;
use crate::links::Links;
use crate::observer::Observed;
use crate::of_two::OfTwo;
use crate::pace::{PaceNs, Trigger};
use crate::probe::{CycleJob, CycleProbe, JobTimer};
use crate::process_data::{ProcessData, Rate};
use crate::window::{Half, SHORTEST, Window};

/// A cycle is late when its delay reaches this fraction of its period.
const LATE_FRACTION: u64 = 10;
/// Interval of the check whether a pause has ended.
const PAUSE_LOOK: Duration = Duration::from_micros(20);
/// Period of an application without a domain that has one.
const IDLE_PERIOD: Duration = Duration::from_millis(1);
/// Shortest time from one cycle to the next.
const SHORTEST_PERIOD: Duration = Duration::from_micros(1);

/// What is published of the states of the domains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum States {
    /// They are evaluated and published in each cycle.
    Changing,
    /// The cyclic status includes them; there is one domain, and none of its frames is expected.
    Settled,
    /// As changing, and the next evaluation takes a snapshot.
    Wanted,
}

/// The cyclic half.
#[derive(Debug)]
pub(crate) struct Cyclic {
    pub exchange: Exchange,
    pub directory: Directory,
    pub pace: PaceNs,
    pub cyclic_status: Arc<CyclicStatus>,
    pub observed: Arc<Observed>,
    rates: Vec<Rate>,
    period_ns: u64,
    /// A cycle is late when its delay reaches this time.
    late_ns: u64,
    /// A longer delay is late, or longer than all before.
    usual_delay: u64,
    trigger: Trigger,
    /// Shifts the grid to follow the reference clock, with [`Trigger::ReferenceClock`].
    follower: Option<Follower>,
    /// Time of the last used reading of that clock.
    followed: Instant,
    /// When the last cycle began.
    begun_at: Instant,
    /// When the only frame left, if it left in the last cycle; otherwise never.
    left_at: Instant,
    /// The next cycle begins now at the latest.
    next_cycle: Instant,
    /// With [`Trigger::FramesReturned`] it may begin from now on.
    earliest: Instant,
    cycle: u64,
    /// Most cycles of a domain that may be under way at once.
    under_way: u32,
    /// A cycle is due and waits because the acyclic half requests a pause.
    held: bool,
    /// The last cycles do not wait for a pause.
    ends: bool,
    window: Arc<Window>,
    /// Number of disturbances that the cyclic status includes.
    published: u64,
    states: States,
    /// Its part in a ring of two MainDevices.
    pub of_two: OfTwo,
}

impl Cyclic {
    pub fn new(active: Active, window: Arc<Window>, now: Instant) -> Cyclic {
        let periods = active.periods;
        let shortest = periods.iter().copied().filter(|period| !period.is_zero()).min();
        let period = shortest.unwrap_or(IDLE_PERIOD).max(SHORTEST_PERIOD);
        let rate = |domain: &Duration| Rate::new(*domain, period);
        let next_cycle = now + period;
        let period_ns = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX);
        window.expect_cycle(next_cycle);
        let cyclic_status = Arc::new(CyclicStatus::new(periods.len()));
        let observed = Observed::new(cyclic_status.clone(), active.live_status, &active.exchange, &active.directory);
        Cyclic {
            exchange: active.exchange,
            directory: active.directory,
            pace: PaceNs::default(),
            cyclic_status,
            observed: Arc::new(observed),
            rates: periods.iter().map(rate).collect(),
            period_ns,
            late_ns: period_ns / LATE_FRACTION,
            usual_delay: 0,
            trigger: Trigger::default(),
            follower: None,
            followed: Instant::NEVER,
            begun_at: now,
            left_at: Instant::NEVER,
            states: States::Changing,
            next_cycle,
            earliest: next_cycle,
            cycle: 0,
            under_way: active.under_way.into(),
            held: false,
            ends: false,
            window,
            published: 0,
            of_two: OfTwo::default(),
        }
    }

    /// The last cycles begin: they start by time, and a measurement no longer delays them.
    pub fn begin_last(&mut self) {
        self.set_trigger(Trigger::Time);
        self.ends = true;
        #[cfg(feature = "standby")]
        self.exchange.end_offers();
    }

    pub fn set_trigger(&mut self, trigger: Trigger) {
        self.trigger = trigger;
        self.follower = match trigger {
            Trigger::ReferenceClock { phase_ns } => Some(Follower::new(self.period_ns, phase_ns)),
            Trigger::Time | Trigger::FramesReturned { .. } => None,
        };
    }

    /// Sets what is copied in every cycle; the ages that rules tolerate count from the period of the source's domain.
    pub fn set_copies(&mut self, rules: &[CopyRule]) -> Result<(), CopyError> {
        let of_domain = |rule: &CopyRule| {
            let cycles = self.rates.get(rule.source.domain.0).map_or(1, Rate::cycles);
            rule.with_max_age(rule.max_age.saturating_add(cycles - 1))
        };
        let rules: Vec<CopyRule> = rules.iter().map(of_domain).collect();
        self.exchange.set_copies(&rules)
    }

    /// Takes a frame of the cyclic class or of an unknown sender. Returns its departure if it is an expected copy.
    #[inline(always)]
    pub fn receive(&mut self, link: Link, frame: &[u8], now: Instant) -> Option<Instant> {
        let taken = if self.exchange.sends_again() {
            let taken = self.exchange.receive_and_follow(link, frame, now);
            self.window.expect_try(self.exchange.decide_at().max(now));
            taken
        } else {
            self.exchange.receive(link, frame, now)
        };
        let taken = taken == Received::Taken;
        taken.then(|| self.exchange.taken_left_at())
    }

    /// Takes a frame while only one is on the wire. False if this was another one, or if it is to be decided whether it
    /// is sent again.
    #[inline(always)]
    pub fn take_only_frame(&mut self, link: Link, frame: &[u8], now: Instant) -> bool {
        self.receive(link, frame, now).is_some() && self.exchange.decide_at() == Instant::NEVER
    }

    /// Records the arrival at the interface of a copy with this departure.
    #[inline(always)]
    pub fn note_round_trip(&self, left_at: Instant, received_at: Instant) {
        self.cyclic_status.round_trips().record_ns(received_at.0.saturating_sub(left_at.0));
    }

    /// Whether a cycle begins now. A due cycle waits while the acyclic half requests a pause.
    #[inline(always)]
    pub fn begins(&mut self, now: Instant) -> bool {
        let is_due = now >= self.next_cycle || (self.may_begin_early() && now >= self.earliest);
        is_due && !self.is_held_back(now)
    }

    /// Whether the due cycle has to wait.
    #[inline(always)]
    fn is_held_back(&mut self, now: Instant) -> bool {
        let pause_until = self.exchange.pause_until();
        let is_paused = now < pause_until && !self.ends;
        if is_paused {
            self.held = true;
            self.window.expect_cycle(pause_until);
        }
        is_paused
    }

    /// Time of the next check whether a cycle begins, unless a frame arrives before.
    #[inline(always)]
    pub fn wake(&self, now: Instant) -> Instant {
        if now < self.exchange.pause_until() && !self.ends {
            // A pause may end earlier than requested.
            return now + PAUSE_LOOK;
        }
        if self.may_begin_early() { self.earliest.min(self.next_cycle) } else { self.next_cycle }
    }

    /// When the only frame left, if it left in the last cycle.
    #[inline(always)]
    pub fn left_at(&self) -> Option<Instant> {
        (self.left_at != Instant::NEVER).then_some(self.left_at)
    }

    /// When the next cycle begins at the latest.
    #[inline(always)]
    pub const fn begins_at(&self) -> Instant {
        self.next_cycle
    }

    /// Whether the next cycle may begin before its time: it begins with returned frames, and not all are on the wire.
    #[inline(always)]
    pub fn may_begin_early(&self) -> bool {
        matches!(self.trigger, Trigger::FramesReturned { .. }) && !self.exchange.is_full()
    }

    /// Begins a cycle: records its delay, evaluates the due domains. All frames that had arrived at `looked_at` are
    /// taken. Only frames that were overdue at that time are given up, however long this thread was delayed since.
    #[inline(always)]
    pub fn begin(&mut self, now: Instant, looked_at: Instant) {
        self.begun_at = now;
        if !self.begin_of_two(now) {
            self.keep_pace(now);
        }
        match self.states {
            States::Settled if self.exchange.process_unchanged() => {}
            States::Wanted => self.process_and_show(looked_at),
            States::Settled | States::Changing => self.process_due(looked_at),
        }
    }

    /// Evaluates the due domains.
    #[inline(never)]
    fn process_due(&mut self, looked_at: Instant) {
        for (number, rate) in self.rates.iter_mut().enumerate() {
            if rate.is_due(self.cycle) {
                rate.status = self.exchange.process(DomainId(number), looked_at);
            }
        }
        self.note_states();
    }

    /// Evaluates the due domains, and takes a snapshot.
    #[cold]
    fn process_and_show(&mut self, looked_at: Instant) {
        self.process_due(looked_at);
        self.observed.fill(self.cycle, self.begun_at, &self.exchange, &self.rates);
    }

    /// Publishes the states of the domains after any was evaluated.
    fn note_states(&mut self) {
        self.cyclic_status.publish_rates(&self.rates);
        self.cyclic_status.publish_ring(self.exchange.ring());
        let is_settled = matches!(&self.rates[..], [alone] if !alone.status.pending);
        self.states = if is_settled { States::Settled } else { States::Changing };
    }

    /// Records the delay of the cycle, and sets the time of the next one.
    #[inline(always)]
    fn keep_pace(&mut self, now: Instant) {
        let delay = now.0.saturating_sub(self.next_cycle.0);
        self.pace.cycles += 1;
        if self.held {
            self.note_pause();
            self.pass_over(now, delay);
            return;
        }
        self.pace.last_delay = delay;
        if delay > self.usual_delay {
            self.note_late(delay);
        }
        self.cyclic_status.wake_ups().record_ns(delay);
        if delay < self.period_ns && matches!(self.trigger, Trigger::Time) {
            self.next_cycle = Instant(self.next_cycle.0.saturating_add(self.period_ns));
        } else {
            self.pace.skipped += self.pass_over(now, delay);
        }
    }

    /// Records that the cycle had to wait for a pause.
    #[cold]
    fn note_pause(&mut self) {
        self.held = false;
        self.pace.paused += 1;
        self.pace.disturbances += 1;
    }

    /// Records that the cycle is late, or later than all before.
    #[cold]
    fn note_late(&mut self, delay: u64) {
        let is_late = delay > self.late_ns;
        if is_late || delay > self.pace.longest_delay {
            self.pace.disturbances += 1;
            self.pace.longest_delay = self.pace.longest_delay.max(delay);
            self.pace.late += u64::from(is_late);
        }
        self.usual_delay = self.pace.longest_delay.min(self.late_ns);
    }

    /// Sets the time of the next cycle; returns the number of cycles left out because their time has passed.
    #[inline(never)]
    fn pass_over(&mut self, now: Instant, delay: u64) -> u64 {
        let passed_over = delay / self.period_ns;
        match self.trigger {
            Trigger::Time | Trigger::ReferenceClock { .. } => {
                let periods = self.period_ns.saturating_mul(passed_over + 1);
                self.next_cycle = Instant(self.next_cycle.0.saturating_add(periods));
                if self.follower.is_some() {
                    self.follow_reference();
                }
            }
            Trigger::FramesReturned { at_least } => {
                self.earliest = now + at_least;
                self.next_cycle = Instant(now.0.saturating_add(self.period_ns.saturating_mul(self.under_way.into())));
            }
        }
        passed_over
    }

    /// Shifts the next cycle to follow the reference clock, once for each reading of it.
    #[cold]
    fn follow_reference(&mut self) {
        let Some(follower) = &mut self.follower else { return };
        let Some(reading) = self.exchange.reference_time().filter(|reading| reading.sent_at != self.followed) else {
            return;
        };
        self.followed = reading.sent_at;
        let correction = follower.correction(reading.at(self.next_cycle));
        self.next_cycle = Instant(self.next_cycle.0.saturating_add_signed(correction));
        self.cyclic_status.publish_phase(follower.error_ns(), follower.is_locked());
    }

    /// How far the next cycle was from its phase in system time, in nanoseconds.
    pub fn follower(&self) -> Option<&Follower> {
        self.follower.as_ref()
    }

    /// When the last cycle began.
    pub const fn begun_at(&self) -> Instant {
        self.begun_at
    }

    /// Process data for the application.
    pub fn data(&mut self, now: Instant) -> ProcessData<'_> {
        ProcessData {
            exchange: &mut self.exchange,
            directory: &self.directory,
            rates: &self.rates,
            cycle: self.cycle,
            now,
        }
    }

    /// Ends the cycle: sends the due domains.
    #[inline(always)]
    pub fn end<P: CycleProbe>(&mut self, now: Instant, links: &mut impl Links, probe: &mut P, mut timer: JobTimer) {
        let is_alone = self.exchange.load_only_frame();
        if !is_alone {
            self.queue_due(now);
        }
        // Round trips, deadlines and readings of the reference clock count from the time at which the frames leave, not
        // from the beginning of the work.
        let now = links.now();
        timer.done(probe, CycleJob::Queue, || now);
        let next = match self.trigger {
            Trigger::Time | Trigger::ReferenceClock { .. } => self.next_cycle,
            Trigger::FramesReturned { at_least } if at_least >= SHORTEST => self.earliest,
            Trigger::FramesReturned { .. } => Instant::NEVER,
        };
        if is_alone {
            self.left_at = now;
            let Cyclic { exchange, window, .. } = self;
            exchange.send_only_frame(now, &mut |frame| {
                window.occupy(Half::Cyclic, now, frame.len());
                links.send(Link::Main, frame);
            });
            self.follow_departures(now);
            self.cycle += 1;
            self.window.expect_cycle(next);
        } else {
            self.send(now, next, links);
        }
        self.publish();
        timer.done(probe, CycleJob::Send, || links.now());
        if P::TIMES_JOBS {
            probe.cycle_ended();
        }
    }

    /// Copies the outputs of the due domains into their frames.
    #[inline(never)]
    fn queue_due(&mut self, now: Instant) {
        for (number, rate) in self.rates.iter().enumerate() {
            if rate.is_due(self.cycle) {
                self.exchange.queue(DomainId(number), now);
            }
        }
    }

    /// Sends frames again that are lost, if it is time to decide that. All frames that had arrived at `looked_at` were
    /// taken. Returns the time of the next decision.
    #[cold]
    pub fn decide_if_due(&mut self, looked_at: Instant, links: &mut impl Links) -> Instant {
        let Cyclic { exchange, window, .. } = self;
        if looked_at >= exchange.decide_at() {
            let now = links.now();
            exchange.decide(looked_at, now, &mut |link, frame| {
                if link == Link::Main {
                    window.occupy(Half::Cyclic, now, frame.len());
                }
                links.send(link, frame);
            });
            window.expect_try(exchange.decide_at());
        }
        exchange.decide_at()
    }

    /// Where lost frames are sent again: notes when the frames that have left are lost.
    #[inline(always)]
    fn follow_departures(&mut self, now: Instant) {
        let Cyclic { exchange, window, .. } = self;
        if exchange.sends_again() {
            exchange.expect_next(self.next_cycle);
            exchange.follow_departures(now);
            window.expect_try(exchange.decide_at());
        }
    }

    /// Sends the queued frames; the next cycle's frames leave at `next`.
    #[inline(never)]
    fn send(&mut self, now: Instant, next: Instant, links: &mut impl Links) {
        self.left_at = Instant::NEVER;
        let Cyclic { exchange, window, .. } = self;
        exchange.send(now, &mut |link, frame| {
            if link == Link::Main {
                window.occupy(Half::Cyclic, now, frame.len());
            }
            links.send(link, frame);
        });
        self.follow_departures(now);
        self.cycle += 1;
        self.window.expect_cycle(next);
        self.cyclic_status.publish_spread(self.exchange.clock_spread_ns());
        self.cyclic_status.publish_ring(self.exchange.ring());
    }

    #[inline(always)]
    fn publish(&mut self) {
        self.cyclic_status.publish_cycle(&self.pace, self.exchange.counters());
        let disturbances = self.exchange.disturbances() + self.pace.disturbances;
        if disturbances != self.published || self.cyclic_status.is_any_wanted() {
            self.publish_rest(disturbances);
        }
    }

    /// Publishes what changes only in disturbed cycles, and carries out requests of readers.
    #[cold]
    fn publish_rest(&mut self, disturbances: u64) {
        self.published = disturbances;
        if self.cyclic_status.publish_rest(&self.pace, self.exchange.counters()) {
            self.states = States::Wanted;
        }
    }

    /// Publishes the address of another sender on this wire.
    pub fn publish_foreign(&mut self) {
        if let Some(foreign) = self.exchange.pop_foreign()
            && let Some(source) = foreign.bytes.get(6..12).and_then(|bytes| bytes.try_into().ok())
        {
            self.cyclic_status.publish_foreign(foreign.arrived_on, source);
        }
    }

    /// No cycle follows: only the acyclic half uses the wire.
    pub fn retire(&self) {
        self.window.expect_cycle(Instant::NEVER);
    }
}
