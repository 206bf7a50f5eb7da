//! Where the acyclic half runs: in the thread of the cycles, or in one of its own.

#[cfg(feature = "standby")]
use std::time::Duration;

use ringcat_engine::AcyclicCounters;
use ringcat_engine::event::TimedEvent;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{MainDevice as Engine, SubDeviceId, SubDeviceState};
use ringcat_engine::ring_status::RingStatus;
use ringcat_engine::time::Instant;

use crate::error::Error;
use crate::links::Links;
use crate::not_ready::{KeptEvents, Reason};
use crate::subdevice::SubDeviceName;
use crate::window::{Half, Window};

/// Functions of the acyclic half for an application, in either thread.
pub trait AcyclicHalf {
    /// Whether its frames come over the links of the cyclic half.
    const SHARES_LINKS: bool;

    /// Takes a frame of its class that arrived on shared links.
    fn receive(&mut self, link: Link, frame: &[u8], now: Instant);

    /// As INACTIVE on shared links: works on a frame of its class of the ACTIVE, before it is forwarded.
    #[cfg(feature = "standby")]
    fn fill(&mut self, link: Link, frame: &mut [u8], now: Instant);

    /// As INACTIVE on shared links: takes an own frame of its class that has come back.
    #[cfg(feature = "standby")]
    fn take_returned(&mut self, frame: &[u8], now: Instant);

    /// Reports SubDevices whose watchdog is not longer than process data may be missing in a takeover. Does not wait.
    #[cfg(feature = "standby")]
    fn report_watchdogs_within(&mut self, gap: Duration, cycle: Duration, now: Instant);

    /// The SubDevices whose watchdog is not longer than the time for which process data may be missing, with both
    /// times. Not for the cyclic path.
    ///
    /// # Errors
    /// Its thread has ended.
    #[cfg(feature = "standby")]
    fn watchdogs_within(&self, gap: Duration, cycle: Duration)
    -> Result<Vec<(SubDeviceId, Duration, Duration)>, Error>;

    /// Runs procedures, and sends on shared links as far as the window allows.
    fn work(&mut self, links: &mut impl Links, window: &Window);

    /// When it has work again, received frames aside.
    fn wake(&self) -> Instant;

    /// When it has work for [`AcyclicHalf::work`], received frames included; in the distant past for work that does not
    /// wait for a time. Cheap, for each pass of a wait on shared links.
    fn due_at(&mut self, links: &impl Links) -> Instant;

    /// As [`AcyclicHalf::due_at`], with the carriers that were read last.
    fn known_due_at(&self) -> Instant;

    /// The present state of each declared SubDevice. Not for the cyclic path.
    fn states(&self) -> Vec<SubDeviceState>;

    /// Whether every declared SubDevice is in its target state.
    fn all_settled(&self) -> bool;

    /// The ring and both links. Not for the cyclic path.
    fn ring_status(&self) -> RingStatus;

    /// Takes the oldest event. Not for the cyclic path: events own memory.
    fn pop_event(&mut self, now: Instant) -> Option<TimedEvent>;

    /// Its counters. Not for the cyclic path.
    fn counters(&self) -> AcyclicCounters;

    /// Calls a function with the time and its counters now and each second until the application ends.
    fn sample_each_second(&mut self, take: impl FnMut(Instant, AcyclicCounters) + Send + 'static);

    /// Data of the scan about a declared SubDevice. Not for the cyclic path.
    fn info(&self, subdevice: SubDeviceId) -> Option<SubDeviceInfo>;

    /// Evaluates the waiting events; they remain to be taken. Not for the cyclic path.
    fn keep_events(&mut self, now: Instant);

    /// The declared SubDevices that are not in their states, and why. Not for the cyclic path.
    ///
    /// # Errors
    /// Its thread has ended.
    fn not_ready(&self) -> Result<Vec<(SubDeviceName, Reason)>, Error>;
}

/// The acyclic half in the thread of the cycles, on the same links: for tests and simple applications.
#[derive(Debug)]
pub struct Inline {
    pub(crate) engine: Engine,
    events: KeptEvents,
}

impl Inline {
    pub(crate) fn new(engine: Engine) -> Inline {
        Inline { engine, events: KeptEvents::default() }
    }

    pub(crate) fn events_dropped(&self) -> u64 {
        self.engine.events_dropped() + self.events.dropped
    }
}

impl AcyclicHalf for Inline {
    const SHARES_LINKS: bool = true;

    fn receive(&mut self, link: Link, frame: &[u8], now: Instant) {
        self.engine.receive(link, frame, now);
    }

    #[cfg(feature = "standby")]
    fn fill(&mut self, link: Link, frame: &mut [u8], now: Instant) {
        self.engine.fill(link, frame, now);
    }

    #[cfg(feature = "standby")]
    fn take_returned(&mut self, frame: &[u8], now: Instant) {
        self.engine.take_returned(frame, now);
    }

    #[cfg(feature = "standby")]
    fn report_watchdogs_within(&mut self, gap: Duration, cycle: Duration, now: Instant) {
        self.engine.report_watchdogs_within(gap, cycle, now);
    }

    #[cfg(feature = "standby")]
    fn watchdogs_within(
        &self,
        gap: Duration,
        cycle: Duration,
    ) -> Result<Vec<(SubDeviceId, Duration, Duration)>, Error> {
        Ok(self.engine.watchdogs_within(gap, cycle))
    }

    fn work(&mut self, links: &mut impl Links, window: &Window) {
        work(&mut self.engine, links, window);
    }

    fn wake(&self) -> Instant {
        self.engine.next_deadline().unwrap_or(Instant::NEVER)
    }

    fn due_at(&mut self, links: &impl Links) -> Instant {
        self.engine.set_carriers(Link::ALL.map(|link| links.carrier(link)));
        self.engine.due_at()
    }

    #[inline(always)]
    fn known_due_at(&self) -> Instant {
        self.engine.due_at()
    }

    fn states(&self) -> Vec<SubDeviceState> {
        self.engine.states()
    }

    fn all_settled(&self) -> bool {
        self.engine.all_settled()
    }

    fn ring_status(&self) -> RingStatus {
        self.engine.ring_status()
    }

    fn pop_event(&mut self, now: Instant) -> Option<TimedEvent> {
        let Inline { engine, events } = self;
        events.pop(|| engine.pop_event(now))
    }

    fn counters(&self) -> AcyclicCounters {
        self.engine.counters()
    }

    fn sample_each_second(&mut self, take: impl FnMut(Instant, AcyclicCounters) + Send + 'static) {
        self.engine.sample_each_second(take);
    }

    fn info(&self, subdevice: SubDeviceId) -> Option<SubDeviceInfo> {
        self.engine.info(subdevice)
    }

    fn keep_events(&mut self, now: Instant) {
        let Inline { engine, events } = self;
        events.take_in(|| engine.pop_event(now));
    }

    fn not_ready(&self) -> Result<Vec<(SubDeviceName, Reason)>, Error> {
        Ok(self.events.failures.explain(&self.engine))
    }
}

/// Carries out a procedure's command to a link, if there is one.
pub(crate) fn carry_out_link_order(engine: &mut Engine, links: &mut impl Links) {
    if let Some((link, disconnect)) = engine.take_link_order() {
        let done = links.force_disconnect(link, disconnect);
        engine.answer_link_order(done);
    }
}

/// Passes new messages to a subscriber of `tracing`.
pub(crate) fn log_messages(engine: &mut Engine) {
    #[cfg(feature = "tracing")]
    crate::trace::record_messages(engine);
    let _ = engine;
}

/// Runs procedures and sends their datagrams as far as the window allows. True if datagrams have to wait for the next
/// window.
pub(crate) fn work(engine: &mut Engine, links: &mut impl Links, window: &Window) -> bool {
    engine.set_carriers(Link::ALL.map(|link| links.carrier(link)));
    engine.poll(links.now());
    carry_out_link_order(engine, links);
    if !engine.wants_to_send() {
        log_messages(engine);
        return false;
    }
    // Procedures have taken time, and the kernel takes time for each frame: the window is read as late as possible.
    let now = links.now();
    let budget = window.bytes(now);
    if budget > 0 {
        engine.transmit(now, budget, &mut |link, frame| {
            if link == Link::Main {
                window.occupy(Half::Acyclic, links.now(), frame.len());
            }
            links.send(link, frame);
        });
    }
    log_messages(engine);
    engine.wants_to_send()
}
