//! A MainDevice that exchanges process data, cycle by cycle, run by hand.
//!
//! [`Application::cycle`] waits for the next cycle, judges the domains that are due, lets the application work on them,
//! and sends. While it waits, the acyclic half gets the wire, in windows that keep off the cyclic frames.
//!
//! Cycles have a fixed grid in time. One that begins late is counted ([`Pace`]); those that a stall of the machine has
//! passed over altogether are left out, so that frames are not sent in bursts to catch up.

use std::time::Duration;

use ringcat_engine::domain::{DomainId, DomainStatus, Freshness};
use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::exchange::{CyclicCounters, Entry, Exchange, Received};
use ringcat_engine::info::Direction;
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{Active, Directory, MainDevice as Engine, SubDeviceState};
use ringcat_engine::ring::RingState;
use ringcat_engine::ring::identity::{Class, class_of};
use ringcat_engine::supervisor::AcyclicCounters;
use ringcat_engine::time::Instant;
use ringcat_wire::al::AlState;
use ringcat_wire::frame::{BYTE_TIME_NS, MAX_FRAME, WIRE_OVERHEAD, wire_time_ns};

use crate::error::Error;
use crate::histogram::Histogram;
use crate::links::Links;
use crate::main_device::MainDevice;

/// Before a cycle begins, the wire is left to itself for so long: an acyclic frame that is under way then has passed
/// the interface.
const GUARD: Duration = Duration::from_nanos(wire_time_ns(MAX_FRAME) / 4);
/// A cycle is late when it begins this part of its period after its time.
const LATE_FRACTION: u32 = 10;
/// Cycles with zeroed outputs before an orderly stop.
const LAST_CYCLES: u32 = 3;
/// Period of an application without domains.
const IDLE_PERIOD: Duration = Duration::from_millis(1);

/// How well the cycles keep to their grid in time. None of it is the wire's fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// Cycles that ran.
    pub cycles: u64,
    /// Cycles that began later than a tenth of the period after their time.
    pub late: u64,
    /// Cycles that were left out because their time and that of the next had passed.
    pub skipped: u64,
    /// How late the last cycle began.
    pub last_delay: Duration,
    /// How late the latest cycle began.
    pub longest_delay: Duration,
}

#[derive(Debug)]
struct Rate {
    /// The domain is due every so many cycles.
    divider: u64,
    status: DomainStatus,
}

/// A MainDevice that exchanges process data.
#[derive(Debug)]
pub struct Application<L> {
    links: L,
    engine: Engine,
    exchange: Exchange,
    directory: Directory,
    rates: Vec<Rate>,
    period: Duration,
    next_cycle: Instant,
    cycle: u64,
    pace: Pace,
    /// When process data was sent last.
    sent_at: Instant,
    round_trips: Histogram,
    /// When what was sent so far will have left the interfaces.
    wire_free: Instant,
}

impl<L: Links> Application<L> {
    pub(crate) fn new(links: L, engine: Engine, active: Active) -> Application<L> {
        let periods = active.periods;
        let period = periods.iter().copied().min().unwrap_or(IDLE_PERIOD).max(Duration::from_micros(1));
        let rate = |domain: &Duration| Rate {
            divider: (domain.as_nanos() / period.as_nanos()).max(1) as u64,
            status: DomainStatus::default(),
        };
        Application {
            next_cycle: links.now() + period,
            wire_free: links.now(),
            links,
            engine,
            exchange: active.exchange,
            directory: active.directory,
            rates: periods.iter().map(rate).collect(),
            period,
            cycle: 0,
            pace: Pace::default(),
            sent_at: Instant::NEVER,
            round_trips: Histogram::default(),
        }
    }

    /// Waits for the next cycle, judges what is due, runs `work`, sends.
    pub fn cycle<R>(&mut self, work: impl FnOnce(&mut ProcessData<'_>) -> R) -> R {
        self.wait_for_cycle();
        let now = self.links.now();
        self.keep_pace(now);
        for (number, rate) in self.rates.iter_mut().enumerate() {
            if self.cycle.is_multiple_of(rate.divider) {
                rate.status = self.exchange.process(DomainId(number), now);
            }
        }
        let result = work(&mut ProcessData {
            exchange: &mut self.exchange,
            directory: &self.directory,
            rates: &self.rates,
            cycle: self.cycle,
            now,
        });
        for (number, rate) in self.rates.iter().enumerate() {
            if self.cycle.is_multiple_of(rate.divider) {
                self.exchange.queue(DomainId(number), now);
            }
        }
        let Application { links, exchange, wire_free, sent_at, .. } = self;
        let before = exchange.counters().sent;
        exchange.send(now, &mut |link, frame| send(links, wire_free, now, link, frame));
        if exchange.counters().sent != before {
            *sent_at = now;
        }
        self.cycle += 1;
        self.next_cycle += self.period;
        result
    }

    /// Notes how late the cycle is, and leaves out those whose time has passed meanwhile.
    fn keep_pace(&mut self, now: Instant) {
        let delay = now.since(self.next_cycle);
        self.pace.cycles += 1;
        self.pace.last_delay = delay;
        self.pace.longest_delay = self.pace.longest_delay.max(delay);
        self.pace.late += u64::from(delay > self.period / LATE_FRACTION);
        let passed_over = (delay.as_nanos() / self.period.as_nanos()) as u64;
        if passed_over > 0 {
            self.pace.skipped += passed_over;
            self.next_cycle += Duration::from_nanos(passed_over.saturating_mul(self.period.as_nanos() as u64));
        }
    }

    /// Receives and lets the acyclic half work until the cycle begins.
    fn wait_for_cycle(&mut self) {
        loop {
            self.receive();
            let now = self.links.now();
            self.engine.poll(now);
            let budget = self.window(now);
            if budget > 0 && self.engine.wants_to_send() {
                let Application { links, engine, wire_free, .. } = self;
                engine.transmit(now, budget, &mut |link, frame| send(links, wire_free, now, link, frame));
            }
            if now >= self.next_cycle {
                return;
            }
            let wake = self.engine.next_deadline().unwrap_or(Instant::NEVER);
            self.links.wait(wake.max(now).min(self.next_cycle));
        }
    }

    fn receive(&mut self) {
        let Application { links, engine, exchange, round_trips, sent_at, .. } = self;
        let now = links.now();
        while links.receive(&mut |link, frame| match class_of(frame) {
            Some(Class::Acyclic) => {
                engine.receive(link, frame, now);
            }
            Some(Class::Cyclic) | None => {
                if exchange.receive(link, frame, now) == Received::Taken {
                    round_trips.record(now.since(*sent_at));
                }
            }
        }) {}
    }

    /// Bytes that may still leave before the next cycle's frames.
    fn window(&self, now: Instant) -> usize {
        let free = self.wire_free.max(now) + GUARD;
        let bytes = self.next_cycle.since(free).as_nanos() / u128::from(BYTE_TIME_NS);
        usize::try_from(bytes).unwrap_or(usize::MAX).saturating_sub(WIRE_OVERHEAD)
    }

    /// An orderly stop: a few more cycles, with all outputs zero where `outputs` says so, then all SubDevices are taken
    /// down to a state. Hands back the MainDevice, which may scan again.
    ///
    /// # Errors
    /// SubDevices that do not get to the state in time, or a bus that fails.
    pub fn stop(mut self, outputs: LastOutputs, state: AlState, limit: Duration) -> Result<MainDevice<L>, Error> {
        for _ in 0..LAST_CYCLES {
            self.cycle(|data| {
                if outputs == LastOutputs::Zero {
                    data.zero_outputs();
                }
            });
        }
        self.engine.start_stop(state, limit, self.links.now());
        let mut main_device = MainDevice::from_parts(self.links, self.engine);
        main_device.finish_stop()?;
        Ok(main_device)
    }

    /// How well the cycles keep to their grid.
    pub fn pace(&self) -> Pace {
        self.pace
    }

    /// Times from the sending of a cycle's frames to the arrival of their copies. (A copy that arrives after other frames
    /// were sent counts from those.)
    pub fn round_trips(&self) -> &Histogram {
        &self.round_trips
    }

    /// Forgets the round trips so far.
    pub fn reset_round_trips(&mut self) {
        self.round_trips = Histogram::default();
    }

    /// Where a PDO entry of a declared SubDevice lies.
    pub fn entry(&self, subdevice: usize, index: u16, sub_index: u8) -> Option<Entry> {
        self.directory.entry(subdevice, index, sub_index)
    }

    /// Where all process data lies.
    pub fn directory(&self) -> &Directory {
        &self.directory
    }

    /// How far each declared SubDevice is.
    pub fn states(&self) -> Vec<SubDeviceState> {
        self.engine.states()
    }

    /// Whether every declared SubDevice is in its target state.
    pub fn all_settled(&self) -> bool {
        self.engine.all_settled()
    }

    /// Takes the oldest event.
    pub fn pop_event(&mut self) -> Option<TimedEvent> {
        let now = self.links.now();
        if let Some(foreign) = self.exchange.pop_foreign() {
            let event = Event::ForeignFrame { arrived_on: foreign.arrived_on, bytes: foreign.bytes.to_vec() };
            return Some(TimedEvent { at: now, event });
        }
        self.engine.pop_event(now)
    }

    /// State of the ring.
    pub fn ring(&self) -> RingState {
        self.engine.ring()
    }

    /// Counters of process data.
    pub fn cyclic_counters(&self) -> CyclicCounters {
        *self.exchange.counters()
    }

    /// Counters of everything else.
    pub fn acyclic_counters(&self) -> AcyclicCounters {
        self.engine.counters()
    }

    /// Host time.
    pub fn now(&self) -> Instant {
        self.links.now()
    }

    /// The cyclic half, for what is not offered here.
    pub fn exchange(&self) -> &Exchange {
        &self.exchange
    }

    /// The cyclic half, for what is not offered here.
    pub fn exchange_mut(&mut self) -> &mut Exchange {
        &mut self.exchange
    }

    /// The acyclic half, for what is not offered here.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The acyclic half, for what is not offered here.
    pub fn engine_mut(&mut self) -> &mut Engine {
        &mut self.engine
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

/// Sends a frame and notes when the wire will be free of it. Both links carry the same frames, so one account serves
/// both.
fn send(links: &mut impl Links, wire_free: &mut Instant, now: Instant, link: Link, frame: &[u8]) {
    if link == Link::Main {
        *wire_free = (*wire_free).max(now) + Duration::from_nanos(wire_time_ns(frame.len()));
    }
    links.send(link, frame);
}

/// What outputs show at an orderly stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastOutputs {
    /// Zero.
    Zero,
    /// What the application wrote last.
    Held,
}

/// What an application works on within a cycle.
#[derive(Debug)]
pub struct ProcessData<'a> {
    exchange: &'a mut Exchange,
    directory: &'a Directory,
    rates: &'a [Rate],
    cycle: u64,
    now: Instant,
}

impl ProcessData<'_> {
    /// Number of the cycle, from 0.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// Time at which the cycle began.
    pub fn now(&self) -> Instant {
        self.now
    }

    /// Last judgement of a domain.
    pub fn status(&self, domain: DomainId) -> DomainStatus {
        self.rates.get(domain.0).map_or_else(DomainStatus::default, |rate| rate.status)
    }

    /// Whether a domain is due in this cycle.
    pub fn is_due(&self, domain: DomainId) -> bool {
        self.rates.get(domain.0).is_some_and(|rate| self.cycle.is_multiple_of(rate.divider))
    }

    /// Value of an entry, zero-extended.
    pub fn read(&self, entry: &Entry) -> u64 {
        self.exchange.read(entry)
    }

    /// Value of an entry, sign-extended.
    pub fn read_signed(&self, entry: &Entry) -> i64 {
        entry.read_signed(self.exchange.image(entry.domain))
    }

    /// Sets an entry.
    pub fn write(&mut self, entry: &Entry, value: u64) {
        self.exchange.write(entry, value);
    }

    /// A domain's whole image.
    pub fn image(&self, domain: DomainId) -> &[u8] {
        self.exchange.image(domain)
    }

    /// A domain's whole image, to write outputs.
    pub fn image_mut(&mut self, domain: DomainId) -> &mut [u8] {
        self.exchange.image_mut(domain)
    }

    /// Sets all outputs of all domains to zero.
    pub fn zero_outputs(&mut self) {
        for subdevice in 0..self.directory.subdevice_count() {
            for area in self.directory.areas(subdevice).iter().filter(|area| area.direction == Direction::Outputs) {
                let start = area.placed.image_offset as usize;
                let end = start + usize::from(area.placed.area.length);
                self.exchange.image_mut(area.domain)[start..end].fill(0);
            }
        }
    }

    /// How old a SubDevice's inputs are.
    pub fn freshness(&self, domain: DomainId, subdevice: usize) -> Freshness {
        self.exchange.freshness(domain, subdevice)
    }

    /// Where process data lies.
    pub fn directory(&self) -> &Directory {
        self.directory
    }
}
