//! A MainDevice that exchanges process data.
//!
//! [`Application::cycle`] waits for the next cycle, evaluates the domains that are due, runs the application's work on
//! them, and sends. An application with its own loop calls the steps itself: [`Application::receive`],
//! [`Application::process`], [`Application::queue`], [`Application::send`].
//!
//! A [`Trigger`] starts each cycle: by default the time, on a fixed grid. A cycle that begins late is counted
//! ([`Pace`]). Cycles that a stall of the machine has missed completely are left out, so that no bursts of frames are
//! sent.
//!
//! The acyclic half runs in the same thread and on the same links ([`Inline`]) while the application waits for a cycle,
//! or in its own thread on its own links ([`crate::supervisor_thread`]).

use std::sync::Arc;
use std::time::Duration;

use ringcat_engine::AcyclicCounters;
use ringcat_engine::Follower;
use ringcat_engine::RingState;
use ringcat_engine::domain::{DomainId, DomainStatus};
use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::exchange::{CopyError, CopyRule, CyclicCounters, Entry, Exchange};
use ringcat_engine::main_device::{Active, Directory, LiveStatus, Pending, SubDeviceId, SubDeviceState};
use ringcat_engine::ring_status::RingStatus;
use ringcat_engine::time::Instant;
use ringcat_engine::{Class, class_of};

use crate::acyclic::{AcyclicHalf, Inline};
use crate::cyclic::Cyclic;
use crate::cyclic_status::CyclicStatus;
use crate::error::Error;
use crate::histogram::Histogram;
use crate::links::Links;
use crate::pace::{Pace, Trigger};
use crate::probe::{CycleJob, CycleProbe, JobTimer};
use crate::process_data::ProcessData;
use crate::window::Window;

/// Cycles with zeroed outputs before an orderly stop.
const LAST_CYCLES: u32 = 3;

/// Values of the outputs during an orderly stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LastOutputs {
    /// Zero.
    Zero,
    /// The values that the application wrote last.
    Held,
}

/// A MainDevice that exchanges process data.
#[derive(Debug)]
pub struct Application<L, H = Inline> {
    pub(crate) links: L,
    pub(crate) cyclic: Cyclic,
    pub(crate) acyclic: H,
    pub(crate) window: Arc<Window>,
    pub(crate) live_status: LiveStatus,
}

impl<L: Links, H: AcyclicHalf> Application<L, H> {
    pub(crate) fn new(links: L, mut acyclic: H, active: Active, window: Arc<Window>) -> Application<L, H> {
        let live_status = active.live_status.clone();
        let mut cyclic = Cyclic::new(active, window.clone(), links.now());
        cyclic.set_up_of_two(&links);
        let samples = cyclic.observed.samples();
        acyclic.sample_each_second(move |now, counters| samples.take(now, counters));
        Application { links, cyclic, acyclic, window, live_status }
    }

    /// Waits for the next cycle, evaluates the domains that are due, runs `work`, sends.
    #[inline(always)]
    pub fn cycle<R>(&mut self, work: impl FnOnce(&mut ProcessData<'_>) -> R) -> R {
        self.cycle_probed(&mut (), work)
    }

    /// As [`Application::cycle`], with a probe for its steps: [`JobProbe`](crate::JobProbe) records the time of each
    /// job, [`FramesIn`](crate::FramesIn) reports the return of the last frame.
    #[inline(always)]
    pub fn cycle_probed<P: CycleProbe, R>(&mut self, probe: &mut P, work: impl FnOnce(&mut ProcessData<'_>) -> R) -> R {
        let (now, looked_at) = self.wait_for_cycle(probe);
        let mut timer = JobTimer::begin::<P>(|| self.links.now());
        self.cyclic.begin(now, looked_at);
        timer.done(probe, CycleJob::Process, || self.links.now());
        let result = work(&mut self.cyclic.data(now));
        timer.done(probe, CycleJob::Work, || self.links.now());
        self.cyclic.end(now, &mut self.links, probe, timer);
        result
    }

    /// Waits until the cycle begins. Returns the time, and the time at which the last check for frames began.
    #[inline(always)]
    fn wait_for_cycle(&mut self, probe: &mut impl CycleProbe) -> (Instant, Instant) {
        let waited = self.wait_for_only_frame(probe);
        let now = self.links.now();
        let due_at = match waited {
            Some((left_at, due_at)) => {
                self.note_round_trip(left_at, now);
                due_at
            }
            None if H::SHARES_LINKS => self.acyclic.due_at(&self.links),
            None => Instant::NEVER,
        };
        if due_at > now && !self.links.has_frame() && self.cyclic.begins(now) {
            return (now, now);
        }
        self.wait_for_frames(probe)
    }

    /// The fast path of a wait: if the only frame is on the wire, waits for it, and then for the next cycle. If the
    /// frame came back: its departure, and when the acyclic half has work if it shares the links. What other threads
    /// request during the second wait is done after this cycle has left. Ends early if the acyclic half has work.
    #[inline(always)]
    fn wait_for_only_frame<P: CycleProbe>(&mut self, probe: &mut P) -> Option<(Instant, Instant)> {
        let Application { links, cyclic, acyclic, .. } = self;
        if !cyclic.exchange.awaits_only_frame() || !links.has_arrival_times() {
            return None;
        }
        let left_at = cyclic.left_at()?;
        let mut now = links.now();
        let until = cyclic.begins_at();
        let sends_again = cyclic.exchange.sends_again();
        let wake = if sends_again { until.min(cyclic.exchange.decide_at()) } else { until };
        let wake = if H::SHARES_LINKS { wake.min(acyclic.known_due_at()) } else { wake };
        if now >= wake {
            return None;
        }
        links.wait_from(now, wake);
        if H::SHARES_LINKS || sends_again {
            now = links.now();
        }
        let (mut is_back, mut timer) = (false, JobTimer::begin::<P>(|| links.now()));
        links.receive(&mut |link, frame| {
            if H::SHARES_LINKS && class_of(frame) == Some(Class::Acyclic) {
                acyclic.receive(link, frame, now);
            } else {
                is_back = cyclic.take_only_frame(link, frame, now);
            }
        });
        if !is_back {
            return None;
        }
        timer.done(probe, CycleJob::Receive, || links.now());
        if P::AWAITS_FRAMES && !cyclic.exchange.awaits_frames() {
            probe.frames_are_in(links.now());
        }
        let due_at = if H::SHARES_LINKS { acyclic.due_at(links) } else { Instant::NEVER };
        if cyclic.may_begin_early() {
            return Some((left_at, due_at));
        }
        if H::SHARES_LINKS {
            let wake = until.min(due_at);
            if now < wake {
                links.wait_from(now, wake);
            }
        } else {
            links.sleep(until);
        }
        Some((left_at, due_at))
    }

    /// Receives frames, and runs the acyclic half if it shares the links, until the cycle begins. Returns the time, and
    /// the time at which the last check for frames began.
    #[inline(never)]
    fn wait_for_frames(&mut self, probe: &mut impl CycleProbe) -> (Instant, Instant) {
        loop {
            // Read once per wait.
            let looked_at = self.links.now();
            self.take_in(looked_at, probe);
            // Before the acyclic half, for which the wire is not kept free any longer if nothing is sent again.
            let decide_at = match self.cyclic.exchange.sends_again() {
                true => self.cyclic.decide_if_due(looked_at, &mut self.links),
                false => Instant::NEVER,
            };
            let mut now = looked_at;
            let mut due_at = self.acyclic.due_at(&self.links);
            if due_at <= now {
                self.acyclic.work(&mut self.links, &self.window);
                due_at = self.acyclic.wake();
                now = self.links.now();
            }
            if self.cyclic.begins(now) {
                return (now, looked_at);
            }
            let wake = self.cyclic.wake(now).min(due_at).min(decide_at);
            if H::SHARES_LINKS || self.cyclic.exchange.awaits_copies() {
                self.links.wait_from(now, wake.max(now));
            } else {
                self.links.sleep(wake);
            }
        }
    }

    /// Takes all frames that have arrived, sends lost frames again, and runs the acyclic half if it shares the links.
    /// First step of a cycle in the application's own loop; further calls are harmless. A lost frame is sent again only
    /// if this is called when frames usually are back, at [`Application::receive_again_at`], and once more before
    /// [`Application::process`].
    pub fn receive(&mut self) {
        self.receive_probed(&mut ());
    }

    pub(crate) fn receive_probed(&mut self, probe: &mut impl CycleProbe) {
        let now = self.links.now();
        self.take_in(now, probe);
        self.cyclic.decide_if_due(now, &mut self.links);
        self.work_if_due(now);
    }

    /// Runs the acyclic half if it shares the links and has work.
    fn work_if_due(&mut self, now: Instant) {
        if self.acyclic.due_at(&self.links) <= now {
            self.acyclic.work(&mut self.links, &self.window);
        }
    }

    /// Takes all frames that have arrived.
    #[inline(always)]
    fn take_in<P: CycleProbe>(&mut self, now: Instant, probe: &mut P) {
        if self.cyclic.exchange.is_inactive() {
            return self.cyclic.pass_on(&mut self.links, &mut self.acyclic);
        }
        let mut awaits_frames = P::AWAITS_FRAMES && self.cyclic.exchange.awaits_frames();
        loop {
            let mut timer = JobTimer::begin::<P>(|| self.links.now());
            let Application { links, acyclic, cyclic, .. } = self;
            let mut left_at = None;
            let any = links.receive(&mut |link, frame| {
                if H::SHARES_LINKS && class_of(frame) == Some(Class::Acyclic) {
                    acyclic.receive(link, frame, now);
                } else {
                    left_at = cyclic.receive(link, frame, now);
                }
            });
            if !any {
                break;
            }
            if let Some(left_at) = left_at {
                self.note_round_trip(left_at, now);
            }
            timer.done(probe, CycleJob::Receive, || self.links.now());
            if awaits_frames && !self.cyclic.exchange.awaits_frames() {
                awaits_frames = false;
                probe.frames_are_in(self.links.now());
            }
        }
    }

    /// Records the round trip of the frame that was taken last.
    #[inline(always)]
    fn note_round_trip(&mut self, left_at: Instant, now: Instant) {
        let received_at = self.links.received_at(left_at, now).unwrap_or(now);
        self.cyclic.note_round_trip(left_at, received_at);
    }

    /// When [`Application::receive`] is to be called again so that a frame that is lost by then is sent again; in the
    /// distant future if all frames are back. For an application that runs the steps of a cycle itself.
    pub fn receive_again_at(&self) -> Instant {
        self.cyclic.exchange.decide_at()
    }

    /// Evaluates a domain: gives up its overdue frames and compares its working counters. Step of a cycle in the
    /// application's own loop.
    pub fn process(&mut self, domain: DomainId) -> DomainStatus {
        self.cyclic.process(domain, self.links.now())
    }

    /// Copies a domain's outputs into its frames. False if all its cycles are still under way: the domain is skipped.
    /// Step of a cycle in the application's own loop.
    pub fn queue(&mut self, domain: DomainId) -> bool {
        self.cyclic.exchange.queue(domain, self.links.now())
    }

    /// Sends the queued frames; the acyclic half may then use the wire for about one period. Last step of a cycle in
    /// the application's own loop.
    pub fn send(&mut self) {
        let now = self.links.now();
        self.cyclic.send_by_hand(now, &mut self.links);
        self.work_if_due(now);
    }

    /// Process data of all domains, to be used between [`Application::process`] and [`Application::queue`].
    pub fn process_data(&mut self) -> ProcessData<'_> {
        self.cyclic.data(self.links.now())
    }

    /// Sets the trigger of the cycles; the default is the time.
    pub fn set_trigger(&mut self, trigger: Trigger) {
        self.cyclic.set_trigger(trigger);
    }

    /// Sets the inputs that are copied to outputs in every cycle, replacing the previous table. Inputs received with
    /// this cycle's frames leave with its next ones, regardless of what `work` writes to these outputs. The tolerated
    /// age of a source is the period of its domain plus `max_age` cycles. To be called before the cycles begin.
    ///
    /// # Errors
    /// A source is not an input, a target is not an output or has two sources, or lengths differ.
    pub fn set_copies(&mut self, rules: &[CopyRule]) -> Result<(), CopyError> {
        self.cyclic.set_copies(rules)
    }

    /// The control loop that follows the reference clock, with [`Trigger::ReferenceClock`]: the last phase error, and
    /// whether errors are small.
    pub fn follower(&self) -> Option<&Follower> {
        self.cyclic.follower()
    }

    /// When the last cycle began.
    pub fn begun_at(&self) -> Instant {
        self.cyclic.begun_at()
    }

    /// Runs the last cycles before a stop, if they are allowed, with all outputs zero if `outputs` requests it.
    /// Afterwards only the acyclic half uses the wire.
    pub(crate) fn end_cycles(&mut self, outputs: LastOutputs, are_allowed: bool) {
        self.cyclic.begin_last();
        for _ in 0..if are_allowed { LAST_CYCLES } else { 0 } {
            self.cycle(|data| {
                if outputs == LastOutputs::Zero {
                    data.zero_outputs();
                }
            });
        }
        self.cyclic.retire();
    }

    /// Counts and delays of the cycles on their grid.
    pub fn pace(&self) -> Pace {
        self.cyclic.pace.shown()
    }

    /// Times from the sending of a cycle's frames to the arrival of each copy at the interface, independent of when a
    /// thread reads the copy ([`Links::received_at`]).
    pub fn round_trips(&self) -> &Histogram {
        self.cyclic.cyclic_status.round_trips()
    }

    /// Figures that other threads can read while the cycles run.
    pub fn cyclic_status(&self) -> &Arc<CyclicStatus> {
        &self.cyclic.cyclic_status
    }

    /// Where a PDO entry of a declared SubDevice lies.
    pub fn entry(&self, subdevice: SubDeviceId, index: u16, sub_index: u8) -> Option<Entry> {
        self.cyclic.directory.entry(subdevice, index, sub_index)
    }

    /// Where all process data lies.
    pub fn directory(&self) -> &Directory {
        &self.cyclic.directory
    }

    /// The present state of each declared SubDevice.
    pub fn states(&self) -> Vec<SubDeviceState> {
        self.acyclic.states()
    }

    /// Whether every declared SubDevice is in its target state.
    pub fn all_settled(&self) -> bool {
        self.acyclic.all_settled()
    }

    /// Takes the oldest event.
    pub fn pop_event(&mut self) -> Option<TimedEvent> {
        let now = self.links.now();
        if let Some(foreign) = self.cyclic.exchange.pop_foreign() {
            let event = Event::ForeignFrame { arrived_on: foreign.arrived_on, bytes: foreign.bytes.to_vec() };
            return Some(TimedEvent::new(now, event));
        }
        self.acyclic.pop_event(now)
    }

    /// The ring and both links: carriers, SubDevices on each link and their states, location of a break, redundancy.
    /// Not for the cyclic path.
    pub fn ring_status(&self) -> RingStatus {
        self.acyclic.ring_status()
    }

    /// State of the ring as the cyclic frames show it.
    pub fn ring(&self) -> RingState {
        self.cyclic.exchange.ring()
    }

    /// Counters of process data.
    pub fn cyclic_counters(&self) -> CyclicCounters {
        *self.cyclic.exchange.counters()
    }

    /// Counters of everything else.
    pub fn acyclic_counters(&self) -> AcyclicCounters {
        self.acyclic.counters()
    }

    /// Host time.
    pub fn now(&self) -> Instant {
        self.links.now()
    }

    /// The cyclic half, to read its state.
    pub fn exchange(&self) -> &Exchange {
        &self.cyclic.exchange
    }

    /// The links.
    pub fn links(&self) -> &L {
        &self.links
    }

    /// The links.
    pub fn links_mut(&mut self) -> &mut L {
        &mut self.links
    }
}

impl<L: Links> Application<L, Inline> {
    /// Runs cycles until a service, for example of a [`SubDevice`](crate::SubDevice), has ended, and returns its
    /// result. After the limit the service is cancelled.
    ///
    /// # Errors
    /// [`Error::TimedOut`], or the error of the service.
    pub fn cycle_until<T, E>(
        &mut self,
        mut pending: Pending<Result<T, E>>,
        limit: Duration,
        mut work: impl FnMut(&mut ProcessData<'_>),
    ) -> Result<T, Error>
    where
        Error: From<E>,
    {
        let end = self.now() + limit;
        loop {
            if let Some(result) = pending.take() {
                return Ok(result?);
            }
            if !pending.is_running() {
                return Err(Error::Gone);
            }
            if self.now() >= end {
                return Err(Error::TimedOut { limit });
            }
            self.cycle(&mut work);
        }
    }

    /// Number of events that were dropped because they were not taken in time.
    pub fn events_dropped(&self) -> u64 {
        self.acyclic.events_dropped()
    }
}
