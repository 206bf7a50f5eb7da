//! Shared data of all procedures of a MainDevice: the model of the segment, which takes observations,
//! and data beside the model that procedures need.

use alloc::collections::VecDeque;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::{Cell, Ref, RefCell};
use core::time::Duration;

use super::error_statistics::ErrorStatistics;
use super::idle::requests::IdleRescans;
use super::sii::{EepromTurns, SiiCache};
use super::undeclared::Undeclared;
use crate::board::Board;
use crate::mail::Mailbox;
use crate::segment::clocks::ClockObservation;
use crate::segment::disturbance::{Disturbance, Wanted};
use crate::segment::effect::{Effect, Task};
use crate::segment::{Addressed, MemberFinding, Observation, Segment, Words};
use crate::supervisor::{Bus, Posted, Signal};
use crate::time::Instant;

/// The model and its companions, shared by all procedures.
#[derive(Clone, Debug)]
pub struct SharedSegment {
    segment: Rc<RefCell<Segment>>,
    bus: Bus,
    /// Mailboxes by member, in use from PREOP on.
    mailboxes: Rc<[Mailbox]>,
    /// Procedures to be started.
    tasks: Rc<RefCell<VecDeque<Task>>>,
    /// A new observation that was not posted by the cyclic half.
    news: Rc<Cell<bool>>,
    changed: Signal,
    /// Words for the cyclic half.
    pub board: Arc<Board>,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Turns at EEPROMs.
    pub eeproms: EepromTurns,
    /// Error counters.
    pub statistics: ErrorStatistics,
    /// SubDevices without a declaration.
    pub undeclared: Undeclared,
    /// Rescans that are requested without an application.
    pub(crate) idle_rescans: IdleRescans,
    /// Requests for another attempt to configure a member: of all, and by member.
    retried: Rc<(Cell<u32>, RefCell<Vec<u32>>)>,
}

/// Data beside the model.
#[derive(Debug)]
pub struct Beside {
    /// By member.
    pub mailboxes: Vec<Mailbox>,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Error counters.
    pub statistics: ErrorStatistics,
}

impl Beside {
    fn nothing(bus: &Bus, cache: SiiCache) -> Beside {
        Beside { mailboxes: Vec::new(), cache, statistics: ErrorStatistics::new(bus, 0, None) }
    }
}

impl SharedSegment {
    /// Shares a model without an application.
    pub fn idle(bus: &Bus, segment: Segment, cache: SiiCache, undeclared: Undeclared) -> SharedSegment {
        let (segment, board) = (Rc::new(RefCell::new(segment)), Arc::new(Board::new(0)));
        SharedSegment::of(bus, segment, board, Beside::nothing(bus, cache), undeclared)
    }

    /// The same model, with an application that is activated next.
    pub fn with_application(&self, bus: &Bus, board: Arc<Board>, beside: Beside) -> SharedSegment {
        SharedSegment::of(bus, self.segment.clone(), board, beside, self.undeclared.clone())
    }

    /// The same model, without an application.
    pub fn without_application(&self, bus: &Bus) -> SharedSegment {
        let beside = Beside::nothing(bus, self.cache.clone());
        let undeclared = self.undeclared.renewed(bus);
        SharedSegment::of(bus, self.segment.clone(), Arc::new(Board::new(0)), beside, undeclared)
    }

    fn of(
        bus: &Bus,
        segment: Rc<RefCell<Segment>>,
        board: Arc<Board>,
        beside: Beside,
        undeclared: Undeclared,
    ) -> SharedSegment {
        let Beside { mailboxes, cache, statistics } = beside;
        SharedSegment {
            segment,
            mailboxes: mailboxes.into(),
            tasks: Rc::default(),
            news: Rc::default(),
            changed: bus.signal(),
            bus: bus.clone(),
            board,
            cache,
            eeproms: EepromTurns::new(bus),
            statistics,
            undeclared,
            idle_rescans: IdleRescans::new(bus),
            retried: Rc::default(),
        }
    }

    /// Requests another attempt to configure a member, or all, without a further pause.
    pub(crate) fn retry(&self, index: Option<usize>) {
        let (all, single) = &*self.retried;
        match index {
            None => all.set(all.get().wrapping_add(1)),
            Some(index) => {
                let mut single = single.borrow_mut();
                let count = single.len().max(index + 1).min(self.mailboxes.len());
                single.resize(count, 0);
                single.get_mut(index).into_iter().for_each(|requests| *requests = requests.wrapping_add(1));
            }
        }
        self.changed.notify();
    }

    /// Waits until another attempt is requested.
    pub(super) async fn until_retried(&self, index: usize) {
        let requests = || {
            let (all, single) = &*self.retried;
            (all.get(), single.borrow().get(index).copied().unwrap_or_default())
        };
        let before = requests();
        self.changed.until(|| (requests() != before).then_some(())).await;
    }

    /// Borrows the model, between two points at which a procedure waits.
    pub fn view(&self) -> Ref<'_, Segment> {
        self.segment.borrow()
    }

    /// Passes an observation to the model, and executes its effects.
    pub fn observe(&self, seen: Observation<'_>) {
        // Supervision need not run for these.
        let is_apart = matches!(seen, Observation::Words(_) | Observation::Clocks(_));
        let effects = self.segment.borrow_mut().observe(seen, self.bus.now());
        for effect in effects.0 {
            match effect {
                Effect::Report(event) => self.bus.report(event),
                Effect::ReportOf(event, occupant) => self.bus.report_of(event, occupant),
                Effect::SuspendMailbox { index } => self.mailboxes.get(index).into_iter().for_each(Mailbox::suspend),
                Effect::MainCount(count) => self.bus.set_main_count(count),
                Effect::Occupants(occupants) => self.bus.set_occupants(occupants),
                Effect::Start(task) => self.tasks.borrow_mut().push_back(task),
            }
        }
        self.news.set(self.news.get() || !is_apart);
        self.changed.notify();
    }

    /// Passes a finding of an attempt to bring up a member to the model.
    pub(super) fn observe_member(&self, (index, attempt): (usize, u32), finding: MemberFinding<'_>) {
        self.observe(Observation::OfMember { index, attempt, finding });
    }

    /// Makes waiting procedures check their conditions again, for changes outside the model.
    pub(super) fn notify(&self) {
        self.changed.notify();
    }

    /// Passes an observation of clocks to the model.
    pub(super) fn observe_clocks(&self, seen: ClockObservation<'_>) {
        self.observe(Observation::Clocks(seen));
    }

    /// The posted words, in the form that the model takes.
    pub(super) fn words(&self) -> Words {
        Words {
            links: self.bus.links(),
            carriers: self.bus.carriers(),
            ring: self.board.ring(),
            supervision: self.board.supervision(),
            cycles: self.board.cycles(),
        }
    }

    /// Waits until the cyclic half has posted words that differ from `seen`, until another observation, or until a
    /// time.
    pub(super) async fn until_news(&self, seen: Posted, until: Instant) {
        self.bus.until_posted(seen, until, &self.changed, || self.news.replace(false)).await;
    }

    /// Waits until the cyclic half has posted words that differ from `seen`, until a time, or until `ready`, which is
    /// evaluated after each observation or notification.
    pub(super) async fn until_posted(&self, seen: Posted, until: Instant, ready: impl FnMut() -> bool) {
        self.bus.until_posted(seen, until, &self.changed, ready).await;
    }

    /// Waits until the model satisfies a condition.
    pub(crate) async fn until<T>(&self, mut ready: impl FnMut(&Segment) -> Option<T>) -> T {
        self.changed.until(|| ready(&self.segment.borrow())).await
    }

    /// The next procedure to be started.
    pub(super) async fn next_task(&self) -> Task {
        self.changed.until(|| self.tasks.borrow_mut().pop_front()).await
    }

    /// Waits until no other disturbance is under way, and then blocks others; `None` if that takes longer than the
    /// limit. The returned turn must be dropped after everything has been undone.
    pub(super) async fn disturb(&self, disturbance: Disturbance, limit: Duration) -> Option<Turn> {
        let turn = Turn::new(self, disturbance);
        let granted = self.until(|segment| segment.is_granted(turn.number).then_some(()));
        self.bus.within(limit, granted).await.is_ok().then_some(turn)
    }

    /// The same without a limit, as long as the disturbance is needed; `None` if it is no longer needed.
    pub(super) async fn disturb_while(
        &self,
        disturbance: Disturbance,
        is_needed: impl Fn(&Segment) -> bool,
    ) -> Option<Turn> {
        let turn = Turn::new(self, disturbance);
        let granted = |segment: &Segment| match segment.is_granted(turn.number) {
            true => Some(true),
            false => (!is_needed(segment)).then_some(false),
        };
        self.until(granted).await.then_some(turn)
    }

    /// The mailbox of a SubDevice.
    pub(crate) fn mailbox_of(&self, subdevice: Addressed) -> Option<Mailbox> {
        match subdevice {
            Addressed::Member(index) => self.mailbox(index),
            Addressed::Undeclared(key) => self.undeclared.mailbox(key.station),
        }
    }

    /// A member's mailbox.
    pub fn mailbox(&self, index: usize) -> Option<Mailbox> {
        self.mailboxes.get(index).cloned()
    }

    /// Mailboxes by member.
    pub fn mailboxes(&self) -> &[Mailbox] {
        &self.mailboxes
    }
}

/// The turn of a disturbance, or its place in the queue. Dropping it ends the disturbance, also if its procedure is
/// cancelled.
#[derive(Debug)]
pub(super) struct Turn {
    segment: SharedSegment,
    number: u32,
}

impl Turn {
    fn new(segment: &SharedSegment, disturbance: Disturbance) -> Turn {
        let number = segment.view().next_disturbance();
        segment.observe(Observation::Wanted(Wanted { disturbance, number }));
        Turn { segment: segment.clone(), number }
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.segment.observe(Observation::Undisturbed(self.number));
    }
}
