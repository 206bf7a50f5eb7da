//! Shared data of all procedures of a MainDevice: the model of the segment, which takes observations,
//! and data beside the model that procedures need.

use alloc::collections::VecDeque;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::{Ref, RefCell};
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::address::StationAddress;

use super::attempt_results::AttemptResults;
use super::error_statistics::ErrorStatistics;
use super::sii::{EepromTurns, SiiCache};
use super::undeclared::UndeclaredMailboxes;
use crate::board::Board;
use crate::info::AliasSource;
use crate::link::{Link, LinkOrder};
use crate::mail::Mailbox;
use crate::mail::coe::Dictionaries;
use crate::segment::clocks::{ClockFinding, ClockObservation, ClockVersions};
use crate::segment::disturbance::{Disturbance, Wanted};
use crate::segment::effect::{Effect, Task};
use crate::segment::{
    Addressed, IdleObservation, LinkObservation, MemberFinding, Observation, PdoFinding, Segment, SubDeviceKey,
    UndeclaredObservation, Words,
};
use crate::supervisor::{Bus, Posted, Signal};
use crate::time::Instant;

/// Time limit of the runtime for an order to the link layer.
const LINK_LIMIT: Duration = Duration::from_secs(1);

/// The model and its companions, shared by all procedures.
#[derive(Clone, Debug)]
pub struct SharedSegment {
    segment: Rc<RefCell<Segment>>,
    bus: Bus,
    /// Mailboxes by member, in use from PREOP on.
    mailboxes: Rc<[Mailbox]>,
    /// Procedures to be started.
    tasks: Rc<RefCell<VecDeque<Task>>>,
    changed: Signal,
    /// Words for the cyclic half.
    pub board: Arc<Board>,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Object dictionaries read before.
    pub(crate) dictionaries: Dictionaries,
    /// Turns at EEPROMs.
    pub eeproms: EepromTurns,
    /// Error counters.
    pub statistics: ErrorStatistics,
    /// Results of requested states of members.
    pub(super) results: AttemptResults,
    /// Mailboxes of SubDevices without a declaration.
    pub(crate) undeclared: UndeclaredMailboxes,
}

/// Data beside the model.
#[derive(Debug)]
pub struct SegmentData {
    /// Mailboxes of the members, by index.
    pub mailboxes: Vec<Mailbox>,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Error counters.
    pub statistics: ErrorStatistics,
}

impl SharedSegment {
    /// Shares a model without an application.
    pub fn idle(bus: &Bus, segment: Segment, cache: SiiCache, undeclared: UndeclaredMailboxes) -> SharedSegment {
        SharedSegment::without(bus, Rc::new(RefCell::new(segment)), cache, undeclared)
    }

    /// The same model, with an application that is activated next. Procedures that run without an application and
    /// continue beside it share procedures to be started, and changes wake them as well.
    pub fn with_application(&self, bus: &Bus, board: Arc<Board>, data: SegmentData) -> SharedSegment {
        let SegmentData { mailboxes, cache, statistics } = data;
        // No broadcast follows.
        self.board.post_end();
        let eeproms = EepromTurns::new(bus);
        let (mailboxes, results) = (mailboxes.into(), AttemptResults::default());
        SharedSegment { mailboxes, results, cache, statistics, board, eeproms, ..self.clone() }
    }

    /// The same model, without an application and on another bus.
    /// While broadcasts follow, what is shown of the segment as a whole goes on.
    pub fn without_application(&self, bus: &Bus) -> SharedSegment {
        let undeclared = self.undeclared.renewed(bus);
        let without = SharedSegment::without(bus, self.segment.clone(), self.cache.clone(), undeclared);
        let without = SharedSegment { dictionaries: self.dictionaries.clone(), ..without };
        if self.view().has_idle_operation() {
            without.board.go_on_from(&self.board);
        }
        without
    }

    fn without(
        bus: &Bus,
        segment: Rc<RefCell<Segment>>,
        cache: SiiCache,
        undeclared: UndeclaredMailboxes,
    ) -> SharedSegment {
        SharedSegment {
            segment,
            mailboxes: Rc::default(),
            tasks: Rc::default(),
            changed: bus.signal(),
            bus: bus.clone(),
            board: Arc::new(Board::new(0)),
            cache,
            dictionaries: Dictionaries::default(),
            eeproms: EepromTurns::new(bus),
            statistics: ErrorStatistics::new(bus, 0, None),
            results: AttemptResults::default(),
            undeclared,
        }
    }

    /// Waits until another attempt to configure a member is requested.
    pub(super) async fn until_retried(&self, index: usize) {
        let requests = |model: &Segment| model.member(index).map(|member| member.retries);
        let before = requests(&self.view());
        self.until(|model| (requests(model) != before).then_some(())).await;
    }

    /// Borrows the model, between two points at which a procedure waits.
    pub fn view(&self) -> Ref<'_, Segment> {
        self.segment.borrow()
    }

    /// Passes an observation to the model, and executes its effects.
    pub fn observe(&self, seen: Observation<'_>) {
        let effects = self.segment.borrow_mut().observe(seen, self.bus.now());
        let mut written = Vec::new();
        for effect in effects.0 {
            match effect {
                Effect::Report(event) => self.bus.report(event),
                Effect::ReportOf(event, occupant) => self.bus.report_of(event, occupant),
                Effect::SuspendMailbox { index } => self.mailboxes.get(index).into_iter().for_each(Mailbox::suspend),
                Effect::MainCount(count) => self.bus.set_main_count(count),
                Effect::Occupants(occupants) => self.bus.set_occupants(occupants),
                Effect::OrderLink(order) => self.bus.order_link(order),
                Effect::Mailboxes(now) => written.extend(self.undeclared.follow(&now)),
                Effect::Start(task) => self.tasks.borrow_mut().push_back(task),
            }
        }
        self.changed.notify();
        self.observe_outdated(written);
    }

    /// Passes a finding of an attempt to bring up a member to the model.
    pub(super) fn observe_member(&self, (index, attempt): (usize, u32), finding: MemberFinding<'_>) {
        self.observe(Observation::OfMember { index, attempt, finding });
    }

    /// Passes a finding of clocks to the model, with their version when it was asked for.
    pub(super) fn find_of_clocks(&self, versions: ClockVersions, finding: ClockFinding<'_>) {
        self.observe_clocks(ClockObservation::Found(versions, finding));
    }

    /// Passes an observation of clocks to the model.
    pub(crate) fn observe_clocks(&self, seen: ClockObservation<'_>) {
        self.observe(Observation::Clocks(seen));
    }

    /// The SubDevice whose alias counts as soon as it is written into its EEPROM.
    pub(crate) fn key_for_alias(&self, station: StationAddress) -> Option<SubDeviceKey> {
        let view = self.view();
        let it = view.subdevices().at(station).filter(|_| view.alias_source() == AliasSource::Sii)?;
        Some(it.key)
    }

    /// Passes an observation without an application to the model.
    pub(crate) fn observe_idle(&self, seen: IdleObservation<'_>) {
        self.observe(Observation::Idle(seen));
    }

    /// Passes an observation of SubDevices without a declaration to the model.
    pub(crate) fn observe_undeclared(&self, seen: UndeclaredObservation<'_>) {
        self.observe(Observation::Undeclared(seen));
    }

    /// Passes the posted words to the model. Words that it has processed before change nothing.
    pub(super) fn observe_words(&self) {
        self.observe(Observation::Words(self.words()));
    }

    /// The posted words, in the form that the model takes.
    pub(super) fn words(&self) -> Words {
        Words::posted(&self.board, self.bus.links(), self.bus.carriers())
    }

    /// Passes to the model which SubDevices have got mail that has changed their PDOs since they were known: before
    /// their mailboxes are closed.
    pub(crate) fn observe_written_pdos(&self) {
        self.observe_undeclared_pdos();
        for (index, mailbox) in self.mailboxes.iter().enumerate().filter(|(_, mailbox)| mailbox.has_written_pdos()) {
            mailbox.forget_written_pdos();
            let attempt = self.view().member(index).map(|member| member.attempt);
            let outdated = |attempt| self.observe_member((index, attempt), MemberFinding::Pdos(PdoFinding::Outdated));
            attempt.into_iter().for_each(outdated);
        }
    }

    /// The same for those without a declaration.
    pub(super) fn observe_undeclared_pdos(&self) {
        self.observe_outdated(self.undeclared.take_written_pdos());
    }

    fn observe_outdated(&self, written: Vec<SubDeviceKey>) {
        for key in written {
            self.observe_undeclared(UndeclaredObservation::Pdos { key, finding: PdoFinding::Outdated });
        }
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

    /// Carries out work; ends it with `None` as soon as the model fulfils a condition.
    pub(crate) async fn unless<T>(
        &self,
        is_ended: impl Fn(&Segment) -> bool,
        work: impl Future<Output = T>,
    ) -> Option<T> {
        let ended = self.until(|model| is_ended(model).then_some(()));
        let (mut ended, mut work) = (pin!(ended), pin!(work));
        poll_fn(|context| match ended.as_mut().poll(context) {
            Poll::Ready(()) => Poll::Ready(None),
            Poll::Pending => work.as_mut().poll(context).map(Some),
        })
        .await
    }

    /// Waits until no branch of the segment is closed for a measurement.
    pub(super) async fn until_branches_are_open(&self) {
        self.until(|model| (!model.clocks().are_branches_closed()).then_some(())).await;
    }

    /// The next procedure to be started.
    pub(super) async fn next_task(&self) -> Task {
        self.changed.until(|| self.tasks.borrow_mut().pop_front()).await
    }

    /// Disconnects or reconnects a link. False if the link layer cannot do that. The procedure that disconnected a link
    /// must reconnect it. For one procedure at a time.
    pub(super) async fn force_disconnect(&self, link: Link, disconnect: bool) -> bool {
        self.observe(Observation::Link(LinkObservation::Ordered(LinkOrder { link, disconnect })));
        let answered = self.until(Segment::link_answer);
        let is_done = self.bus.within(LINK_LIMIT, answered).await.unwrap_or(false);
        self.observe(Observation::Link(LinkObservation::Ended));
        is_done
    }

    /// A place in the queue of procedures that disturb the segment: later disturbances of this kind wait until it is
    /// dropped.
    pub(super) fn queue_up(&self, disturbance: Disturbance) -> Turn {
        Turn::new(self, disturbance)
    }

    /// Waits until no other disturbance is under way, and then blocks others; `None` if that takes longer than the
    /// limit. The returned turn must be dropped after everything has been undone.
    pub(super) async fn disturb(&self, disturbance: Disturbance, limit: Duration) -> Option<Turn> {
        let turn = self.queue_up(disturbance);
        let granted = self.until(|segment| segment.is_granted(turn.number).then_some(()));
        self.bus.within(limit, granted).await.is_ok().then_some(turn)
    }

    /// The same without a limit, as long as the disturbance is needed; `None` if it is no longer needed.
    pub(super) async fn disturb_while(
        &self,
        disturbance: Disturbance,
        is_needed: impl Fn(&Segment) -> bool,
    ) -> Option<Turn> {
        let turn = self.queue_up(disturbance);
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
            Addressed::Undeclared(key) => self.undeclared.of(key),
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

/// Runs a procedure until an application is active.
pub(super) async fn until_active(segment: &SharedSegment, procedure: impl Future<Output = ()>) {
    let mut procedure = pin!(procedure);
    poll_fn(|context| {
        if segment.view().is_active() {
            return Poll::Ready(());
        }
        procedure.as_mut().poll(context)
    })
    .await;
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
