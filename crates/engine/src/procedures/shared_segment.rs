//! What all procedures of one MainDevice have at hand after activation: the model of the segment, to be looked at and
//! to be told what was observed, and what belongs to the bus beside it.

use alloc::collections::VecDeque;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::{Cell, Ref, RefCell};
use core::time::Duration;

use super::error_statistics::ErrorStatistics;
use super::sii::SiiCache;
use crate::board::Board;
use crate::mail::Mailbox;
use crate::segment::clocks::ClockObservation;
use crate::segment::disturbance::Disturbance;
use crate::segment::effect::{Effect, Task};
use crate::segment::{Observation, Segment, Words};
use crate::supervisor::{Bus, Posted, Signal};
use crate::time::Instant;

/// The model and what goes with it, shared by all procedures.
#[derive(Clone, Debug)]
pub struct SharedSegment {
    segment: Rc<RefCell<Segment>>,
    bus: Bus,
    /// Mailboxes by member, in use from PREOP on.
    mailboxes: Rc<[Mailbox]>,
    /// Procedures that are to be started.
    tasks: Rc<RefCell<VecDeque<Task>>>,
    /// Something was observed that the cyclic half has not posted.
    news: Rc<Cell<bool>>,
    changed: Signal,
    /// Number of the next temporary station address.
    next_temporary: Rc<Cell<u16>>,
    /// Before then it is not tried how many datagrams a frame may hold.
    next_frame_trial: Rc<Cell<Instant>>,
    /// Words for the cyclic half.
    pub board: Arc<Board>,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Error counters.
    pub statistics: ErrorStatistics,
}

/// What goes with the model.
#[derive(Debug)]
pub struct Beside {
    /// By member.
    pub mailboxes: Vec<Mailbox>,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Error counters.
    pub statistics: ErrorStatistics,
}

impl SharedSegment {
    /// Shares a model.
    pub fn new(bus: Bus, segment: Segment, board: Arc<Board>, beside: Beside) -> SharedSegment {
        let Beside { mailboxes, cache, statistics } = beside;
        SharedSegment {
            segment: Rc::new(RefCell::new(segment)),
            mailboxes: mailboxes.into(),
            tasks: Rc::default(),
            news: Rc::default(),
            changed: bus.signal(),
            next_temporary: Rc::default(),
            next_frame_trial: Rc::default(),
            bus,
            board,
            cache,
            statistics,
        }
    }

    /// A look at the model, between two points at which a procedure waits.
    pub fn view(&self) -> Ref<'_, Segment> {
        self.segment.borrow()
    }

    /// Tells the model what was observed, and carries out what follows.
    pub fn observe(&self, seen: Observation<'_>) {
        // Supervision need not wake for these.
        let is_apart = matches!(seen, Observation::Words(_) | Observation::Clocks(_));
        let effects = self.segment.borrow_mut().observe(seen, self.bus.now());
        for effect in effects.0 {
            match effect {
                Effect::Report(event) => self.bus.report(event),
                Effect::ReportOf(event, who) => self.bus.report_of(event, who),
                Effect::SuspendMailbox { index } => self.mailboxes.get(index).into_iter().for_each(Mailbox::suspend),
                Effect::MainCount(count) => self.bus.set_main_count(count),
                Effect::Occupants(occupants) => self.bus.set_occupants(occupants),
                Effect::Start(task) => self.tasks.borrow_mut().push_back(task),
            }
        }
        self.news.set(self.news.get() || !is_apart);
        self.changed.notify();
    }

    /// Lets procedures check again what they wait for beside the model.
    pub(super) fn notify(&self) {
        self.changed.notify();
    }

    /// Hands an observation of clocks to the model.
    pub(super) fn observe_clocks(&self, seen: ClockObservation<'_>) {
        self.observe(Observation::Clocks(seen));
    }

    /// What is posted, as the model wants it.
    pub(super) fn words(&self) -> Words {
        Words {
            links: self.bus.links(),
            carriers: self.bus.carriers(),
            ring: self.board.ring(),
            supervision: self.board.supervision(),
            cycles: self.board.cycles(),
        }
    }

    /// Waits until the cyclic half has posted something else than this, something else was observed, or a point of
    /// time.
    pub(super) async fn until_news(&self, seen: Posted, until: Instant) {
        self.bus.until_posted(seen, until, &self.changed, || self.news.replace(false)).await;
    }

    /// Waits until the cyclic half has posted something else than this, until a point of time, or until `ready`, which
    /// is asked when something was observed or notified.
    pub(super) async fn until_posted(&self, seen: Posted, until: Instant, ready: impl FnMut() -> bool) {
        self.bus.until_posted(seen, until, &self.changed, ready).await;
    }

    /// Waits until the model satisfies a condition.
    pub(crate) async fn until<T>(&self, mut ready: impl FnMut(&Segment) -> Option<T>) -> T {
        self.changed.until(|| ready(&self.segment.borrow())).await
    }

    /// The next procedure that is to be started.
    pub(super) async fn next_task(&self) -> Task {
        self.changed.until(|| self.tasks.borrow_mut().pop_front()).await
    }

    /// Waits until nothing else puts SubDevices or links out of reach, and keeps others from it; false where that does
    /// not come within a time. To be ended with [`SharedSegment::undisturb`], after everything has been undone.
    pub(super) async fn disturb(&self, wanted: Disturbance, limit: Duration) -> bool {
        self.observe(Observation::Wanted(wanted));
        let granted = self.until(|segment| (segment.disturbance() == Some(wanted)).then_some(()));
        if self.bus.within(limit, granted).await.is_err() {
            self.observe(Observation::Renounced(wanted));
            return false;
        }
        true
    }

    /// Nothing is out of reach on purpose any more.
    pub(super) fn undisturb(&self) {
        self.observe(Observation::Undisturbed);
    }

    /// A member's mailbox.
    pub fn mailbox(&self, index: usize) -> Option<Mailbox> {
        self.mailboxes.get(index).cloned()
    }

    /// Mailboxes by member.
    pub fn mailboxes(&self) -> &[Mailbox] {
        &self.mailboxes
    }

    /// Number of the next temporary station address.
    pub(super) fn next_temporary(&self) -> u16 {
        self.next_temporary.replace(self.next_temporary.get().wrapping_add(1))
    }

    /// Before when it is not tried how many datagrams a frame may hold.
    pub(super) fn next_frame_trial(&self) -> Instant {
        self.next_frame_trial.get()
    }

    /// It is not tried again before then.
    pub(super) fn set_next_frame_trial(&self, at: Instant) {
        self.next_frame_trial.set(at);
    }
}
