//! A MainDevice that exchanges process data, cycle by cycle, run by hand.
//!
//! [`Application::cycle`] waits for the next cycle, judges the domains that are due, lets the application work on them,
//! and sends. While it waits, the acyclic half gets the wire, in windows that keep off the cyclic frames.

use std::time::Duration;

use ringcat_engine::domain::{DomainId, DomainStatus, Freshness};
use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::exchange::{CyclicCounters, Entry, Exchange};
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{Active, Directory, MainDevice as Engine, SubDeviceState};
use ringcat_engine::ring::RingState;
use ringcat_engine::ring::identity::{Class, class_of};
use ringcat_engine::supervisor::AcyclicCounters;
use ringcat_engine::time::Instant;
use ringcat_wire::frame::{BYTE_TIME_NS, MAX_FRAME, WIRE_OVERHEAD, wire_time_ns};

use crate::links::Links;

/// Before a cycle begins, the wire is left to itself for so long: an acyclic frame that is under way then has passed
/// the interface.
const GUARD: Duration = Duration::from_nanos(wire_time_ns(MAX_FRAME) / 4);
/// Period of an application without domains.
const IDLE_PERIOD: Duration = Duration::from_millis(1);

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
    /// When what was sent so far will have left the interfaces.
    wire_free: Instant,
}

impl<L: Links> Application<L> {
    pub(crate) fn new(links: L, engine: Engine, active: Active, periods: &[Duration]) -> Application<L> {
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
        }
    }

    /// Waits for the next cycle, judges what is due, runs `work`, sends.
    pub fn cycle<R>(&mut self, work: impl FnOnce(&mut ProcessData<'_>) -> R) -> R {
        self.wait_for_cycle();
        let now = self.links.now();
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
        let Application { links, exchange, wire_free, .. } = self;
        exchange.send(now, &mut |link, frame| send(links, wire_free, now, link, frame));
        self.cycle += 1;
        self.next_cycle += self.period;
        result
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
        let Application { links, engine, exchange, .. } = self;
        let now = links.now();
        while links.receive(&mut |link, frame| match class_of(frame) {
            Some(Class::Acyclic) => {
                engine.receive(link, frame, now);
            }
            Some(Class::Cyclic) | None => {
                exchange.receive(link, frame, now);
            }
        }) {}
    }

    /// Bytes that may still leave before the next cycle's frames.
    fn window(&self, now: Instant) -> usize {
        let free = self.wire_free.max(now) + GUARD;
        let bytes = self.next_cycle.since(free).as_nanos() / u128::from(BYTE_TIME_NS);
        usize::try_from(bytes).unwrap_or(usize::MAX).saturating_sub(WIRE_OVERHEAD)
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

    /// How old a SubDevice's inputs are.
    pub fn freshness(&self, domain: DomainId, subdevice: usize) -> Freshness {
        self.exchange.freshness(domain, subdevice)
    }

    /// Where process data lies.
    pub fn directory(&self) -> &Directory {
        self.directory
    }
}
