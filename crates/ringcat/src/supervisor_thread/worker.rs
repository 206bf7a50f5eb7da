//! What runs in the supervisor's thread: turns of the engine, requests of other threads, published states.
//!
//! In: frames, requests, words that the cyclic half posts. Out: frames, events, [`Published`].

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Duration;

use ringcat_engine::AcyclicCounters;
use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{MainDevice as Engine, SubDeviceState};
use ringcat_engine::ring_status::RingStatus;
use ringcat_engine::time::Instant;

use crate::acyclic::work;
use crate::job::Task;
use crate::link_figures::AcyclicSamples;
use crate::links::Links;
use crate::not_ready::Failures;
use crate::observer::Observed;
use crate::of_two::OfTwo;
#[cfg(feature = "daemon")]
use crate::record_requests::RecordRequests;
use crate::window::Window;

/// Longest sleep while tasks read queues that do not end a sleep, or while links have no waker.
const LONGEST_SLEEP: Duration = Duration::from_micros(500);
/// Longest sleep soon after a request, so that a sequence of requests does not wait for each one.
const SHORT_SLEEP: Duration = Duration::from_micros(50);
/// Time after a request in which [`SHORT_SLEEP`] applies.
const ATTENTIVE: Duration = Duration::from_millis(2);
/// Interval at which states are published, unless an event causes it earlier.
const PUBLISH: Duration = Duration::from_millis(10);
/// Events that may wait to be fetched; further ones are dropped and counted.
const EVENTS: usize = 4096;
/// Begins work. Work of the engine stays in the thread that made it.
type Begin = Box<dyn FnOnce(&mut Engine, Instant) -> Task + Send>;

/// What another thread requests.
pub(super) struct Request {
    pub attention: Attention,
    pub begin: Begin,
}

/// When a task is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attention {
    /// When the engine has worked.
    Engine,
    /// Every half millisecond: it reads queues that do not end a sleep.
    #[cfg(feature = "eoe")]
    Often,
}

/// Data that the thread publishes.
#[derive(Debug, Default)]
pub(super) struct Published {
    pub settled: AtomicBool,
    /// Events that wait to be fetched.
    pub waiting: AtomicUsize,
    /// The thread ends after this turn: it sends nothing more.
    pub is_handed_over: AtomicBool,
    pub rest: Mutex<Rest>,
    /// Frames while no application is active.
    pub samples: Mutex<AcyclicSamples>,
    /// What the active application shows of its process data.
    pub observed: Mutex<Weak<Observed>>,
    /// What the network interfaces of EoE publish.
    #[cfg(feature = "eoe")]
    pub ethernet: Mutex<Option<Weak<dyn std::any::Any + Send + Sync>>>,
    /// Where a file with the last frames is requested.
    #[cfg(feature = "daemon")]
    pub record: Mutex<Option<RecordRequests>>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Rest {
    pub states: Vec<SubDeviceState>,
    pub ring: RingStatus,
    pub counters: AcyclicCounters,
    pub events_dropped: u64,
    pub failures: Failures,
}

impl Published {
    /// Publishes the states of the engine. A request that changes them does so before its answer.
    pub fn states_of(&self, engine: &Engine) {
        let mut rest = self.rest.lock().unwrap_or_else(PoisonError::into_inner);
        rest.states = engine.states();
        rest.ring = engine.ring_status();
        rest.counters = engine.counters();
        self.settled.store(engine.all_settled(), Ordering::Release);
    }
}

/// What runs in the thread.
pub(super) struct Worker<L> {
    links: L,
    engine: Engine,
    of_two: OfTwo,
    window: Arc<Window>,
    asked: Vec<Request>,
    tasks: Vec<(Attention, Task)>,
    /// Other threads can end a sleep.
    has_waker: bool,
    events: Sender<TimedEvent>,
    events_dropped: u64,
    failures: Failures,
    published: Arc<Published>,
    publish_at: Instant,
    /// Until when the next request is expected soon.
    attentive_until: Instant,
    /// When there may be room for datagrams that wait.
    blocked_until: Option<Instant>,
}

impl<L: Links> Worker<L> {
    pub(super) fn new(
        links: L,
        (engine, of_two): (Engine, OfTwo),
        window: Arc<Window>,
        events: Sender<TimedEvent>,
        published: Arc<Published>,
    ) -> Worker<L> {
        Worker {
            has_waker: links.waker().is_some(),
            links,
            engine,
            of_two,
            window,
            asked: Vec::new(),
            tasks: Vec::new(),
            events,
            events_dropped: 0,
            failures: Failures::default(),
            published,
            publish_at: Instant(0),
            attentive_until: Instant(0),
            blocked_until: None,
        }
    }

    pub(super) fn run(mut self, incoming: &Receiver<Request>) {
        loop {
            let now = self.links.now();
            let Worker { links, engine, of_two, .. } = &mut self;
            let has_work = of_two.take_in(links, engine, now);
            loop {
                match incoming.try_recv() {
                    Ok(request) => self.asked.push(request),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return,
                }
            }
            if has_work || self.is_due(now) {
                self.turn();
            }
            if self.published.is_handed_over.load(Ordering::Acquire) {
                return;
            }
            let now = self.links.now();
            self.links.wait_from(now, self.next_turn(now).max(now));
        }
    }

    /// Whether there is work without a frame.
    fn is_due(&mut self, now: Instant) -> bool {
        let Worker { links, engine, .. } = self;
        engine.set_carriers(Link::ALL.map(|link| links.carrier(link)));
        let is_called = links.take_call();
        is_called
            || !self.asked.is_empty()
            || self.is_often()
            || now >= self.publish_at
            || self.blocked_until.is_some_and(|at| now >= at)
            || self.engine.next_deadline().is_some_and(|at| now >= at)
    }

    /// Whether there is work for which other threads do not end a sleep.
    fn is_often(&self) -> bool {
        !self.has_waker || self.tasks.iter().any(|(attention, _)| *attention != Attention::Engine)
    }

    fn turn(&mut self) {
        let Worker { links, engine, window, .. } = self;
        let blocked = work(engine, links, window);
        let mut asked = !self.asked.is_empty();
        let is_changed = self.pass_on_events();
        self.publish(is_changed);
        asked |= self.answer();
        let now = self.links.now();
        if asked {
            self.attentive_until = now + ATTENTIVE;
        }
        self.blocked_until = blocked.then(|| self.window.look_again(now));
    }

    /// The end of a sleep: a deadline, room on the wire, or the next reading of words that do not end a sleep.
    fn next_turn(&self, now: Instant) -> Instant {
        let longest = match self.is_often() {
            true if now < self.attentive_until => now + SHORT_SLEEP,
            true => now + LONGEST_SLEEP,
            false => self.publish_at.min(self.window.next_reading(now)),
        };
        let wake = self.engine.next_deadline().unwrap_or(Instant::NEVER);
        wake.min(self.blocked_until.unwrap_or(Instant::NEVER)).min(longest)
    }

    /// Begins requested work, and calls all tasks; true if any has ended.
    fn answer(&mut self) -> bool {
        let now = self.links.now();
        let Worker { asked, tasks, engine, .. } = self;
        tasks.extend(asked.drain(..).map(|request| (request.attention, (request.begin)(engine, now))));
        let before = tasks.len();
        tasks.retain_mut(|(_, task)| !task(engine, now));
        tasks.len() < before
    }

    /// Passes on all events; true if there were any.
    fn pass_on_events(&mut self) -> bool {
        let now = self.links.now();
        let mut any = false;
        while let Some(event) = self.engine.pop_event(now) {
            self.failures.observe(&event);
            any |= !matches!(event.event, Event::Skipped { .. } | Event::Domain { .. });
            // A bounded channel would keep memory for as many from the beginning.
            let has_room = self.published.waiting.fetch_add(1, Ordering::AcqRel) < EVENTS;
            if !has_room || self.events.send(event).is_err() {
                self.published.waiting.fetch_sub(1, Ordering::AcqRel);
                self.events_dropped += 1;
            }
        }
        any
    }

    fn publish(&mut self, is_changed: bool) {
        let now = self.links.now();
        if !is_changed && now < self.publish_at {
            return;
        }
        self.publish_at = now + PUBLISH;
        let dropped = self.events_dropped + self.engine.events_dropped();
        let mut rest = self.published.rest.lock().unwrap_or_else(PoisonError::into_inner);
        rest.events_dropped = dropped;
        rest.failures = self.failures.clone();
        drop(rest);
        #[cfg(feature = "packet")]
        let was_settled = self.published.settled.load(Ordering::Relaxed);
        self.published.states_of(&self.engine);
        #[cfg(feature = "packet")]
        if !was_settled && self.published.settled.load(Ordering::Relaxed) {
            // What a start has used is not used again: a tenth of the heap, with 50 servos.
            crate::realtime::give_back_memory();
        }
        let mut samples = self.published.samples.lock().unwrap_or_else(PoisonError::into_inner);
        samples.take(now, self.engine.counters());
    }
}
