//! The list of SubDevices without a declaration: their mailboxes, requested states and attempts to reach them.
//!
//! Input: the SubDevices at their positions, requests, results of attempts, states that were read. Output: the attempts
//! that are due. An attempt belongs to an entry by its number: when the SubDevice is gone, or another state is
//! requested, the attempt is no longer current and ends.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};

use crate::declared::Address;
use crate::info::SubDeviceInfo;
use crate::mail::{EmergencyRings, Mailbox};
use crate::procedures::configure::ConfigureError;
use crate::segment::Reading;
use crate::supervisor::{Bus, Signal};
use crate::time::Instant;

/// Pause before the first repeated attempt; it doubles with every failure.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause between attempts.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// What follows a failed configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Retries {
    /// It is repeated after pauses of 100 ms to 5 s, without end.
    #[default]
    Always,
    /// The SubDevice stays as it is until a retry is requested. Losses of frames are repeated at any rate.
    OnRequest,
}

/// Progress of an entry towards its requested state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    /// The next attempt is due at this time; never, if it waits for a request.
    Due(Instant),
    /// An attempt is under way.
    UnderWay,
    /// It was reached.
    Reached,
    /// The application has forced a state: it is left as it is until another state is requested.
    Left,
}

/// A SubDevice without a declaration.
#[derive(Debug)]
struct Entry {
    info: Rc<SubDeviceInfo>,
    position: Position,
    mailbox: Mailbox,
    target: AlState,
    /// The target before the last request.
    before: AlState,
    progress: Progress,
    attempt: u32,
    failures: u32,
    /// Result of the last attempt that was requested.
    result: Option<(u32, Result<(), ConfigureError>)>,
}

/// An attempt to bring a SubDevice to its requested state.
#[derive(Clone, Debug)]
pub(crate) struct Attempt {
    pub station: StationAddress,
    pub number: u32,
    pub info: Rc<SubDeviceInfo>,
    pub mailbox: Mailbox,
    pub target: AlState,
}

/// The list, shared by all procedures.
#[derive(Clone, Debug)]
pub struct Undeclared {
    all: Rc<RefCell<Vec<Entry>>>,
    rings: Rc<RefCell<EmergencyRings>>,
    bus: Bus,
    changed: Signal,
    /// Counts changes of the list.
    version: Rc<Cell<u32>>,
    /// Whether entries are kept in their states; otherwise only requests are executed.
    is_kept: Rc<Cell<bool>>,
    retries: Retries,
}

impl Undeclared {
    /// An empty list.
    pub(crate) fn new(bus: &Bus, rings: Rc<RefCell<EmergencyRings>>, retries: Retries) -> Undeclared {
        let changed = bus.signal();
        Undeclared {
            all: Rc::default(),
            rings,
            bus: bus.clone(),
            changed,
            version: Rc::default(),
            is_kept: Rc::default(),
            retries,
        }
    }

    /// An empty list with the same choices for another bus.
    pub(crate) fn renewed(&self, bus: &Bus) -> Undeclared {
        Undeclared::new(bus, self.rings.clone(), self.retries)
    }

    /// What follows a failed configuration.
    pub(crate) fn retries(&self) -> Retries {
        self.retries
    }

    fn notify(&self) {
        self.version.set(self.version.get().wrapping_add(1));
        self.changed.notify();
    }

    /// From now on all entries are kept in their states.
    pub(crate) fn begin_keeping(&self) {
        self.is_kept.set(true);
    }

    /// Whether entries are kept in their states.
    pub(crate) fn is_kept(&self) -> bool {
        self.is_kept.get()
    }

    /// The SubDevices without a declaration, from now on. Entries of those that remain do not change; the others are
    /// closed.
    pub(crate) fn follow(&self, present: &[(Position, Rc<SubDeviceInfo>)]) {
        let now = self.bus.now();
        let mut before = core::mem::take(&mut *self.all.borrow_mut());
        let mut all = Vec::with_capacity(present.len());
        self.rings.borrow_mut().forget_positions();
        for (position, info) in present {
            let is_it = |entry: &Entry| entry.info.station == info.station && entry.info.identity == info.identity;
            let entry = match before.iter().position(is_it) {
                Some(at) => {
                    let mut entry = before.swap_remove(at);
                    entry.info = info.clone();
                    entry.position = *position;
                    entry.mailbox.rename((*position).into());
                    entry
                }
                None => self.entry(*position, info, Progress::Due(now)),
            };
            self.rings.borrow_mut().keep((*position).into(), entry.mailbox.emergencies());
            all.push(entry);
        }
        before.iter().for_each(|entry| entry.mailbox.close());
        *self.all.borrow_mut() = all;
        self.notify();
    }

    /// Whether these are the SubDevices of the list.
    pub(crate) fn is_of(&self, present: &[(Position, Rc<SubDeviceInfo>)]) -> bool {
        let all = self.all.borrow();
        let is_same = |(entry, (position, info)): (&Entry, &(Position, Rc<SubDeviceInfo>))| {
            entry.position == *position && Rc::ptr_eq(&entry.info, info)
        };
        all.len() == present.len() && all.iter().zip(present).all(is_same)
    }

    fn entry(&self, position: Position, info: &Rc<SubDeviceInfo>, progress: Progress) -> Entry {
        let mailbox = Mailbox::new(&self.bus, position);
        mailbox.keep_emergencies_in(self.rings.borrow_mut().of(Address::Scanned(position)));
        Entry {
            info: info.clone(),
            position,
            mailbox,
            target: AlState::PreOp,
            before: AlState::PreOp,
            progress,
            attempt: 0,
            failures: 0,
            result: None,
        }
    }

    /// Removes all entries; their mailboxes are closed, and their attempts end.
    pub(crate) fn clear(&self) {
        self.all.borrow_mut().drain(..).for_each(|entry| entry.mailbox.close());
        self.notify();
    }

    /// The mailbox of the SubDevice with a station address.
    pub(crate) fn mailbox(&self, station: StationAddress) -> Option<Mailbox> {
        self.all.borrow().iter().find(|entry| entry.info.station == station).map(|entry| entry.mailbox.clone())
    }

    /// The mailboxes in use.
    pub(crate) fn mailboxes(&self) -> Vec<Mailbox> {
        let all = self.all.borrow();
        all.iter().filter(|entry| entry.mailbox.is_open()).map(|entry| entry.mailbox.clone()).collect()
    }

    /// All SubDevices of the list, at their positions.
    pub(crate) fn all(&self) -> Vec<(Position, Rc<SubDeviceInfo>)> {
        self.all.borrow().iter().map(|entry| (entry.position, entry.info.clone())).collect()
    }

    /// The SubDevice with a station address, and its mailbox.
    pub(crate) fn of_station(&self, station: StationAddress) -> Option<(Rc<SubDeviceInfo>, Mailbox)> {
        let all = self.all.borrow();
        let entry = all.iter().find(|entry| entry.info.station == station)?;
        Some((entry.info.clone(), entry.mailbox.clone()))
    }

    /// Leaves the SubDevice with a station address as it is until another state is requested; an attempt ends.
    pub(crate) fn leave(&self, station: StationAddress) {
        if let Some(entry) = self.all.borrow_mut().iter_mut().find(|entry| entry.info.station == station) {
            entry.attempt = entry.attempt.wrapping_add(1);
            entry.progress = Progress::Left;
        }
        self.notify();
    }

    /// Whether all are in their requested states, or left as they are.
    pub(crate) fn are_settled(&self) -> bool {
        self.all.borrow().iter().all(|entry| matches!(entry.progress, Progress::Reached | Progress::Left))
    }

    /// The OR of the AL states of all, if each is in its requested state; `None` if some are left in any state.
    pub(crate) fn expected_states(&self) -> Option<u8> {
        let all = self.all.borrow();
        let is_left = all.iter().any(|entry| entry.progress == Progress::Left);
        (!is_left).then(|| all.iter().fold(0, |or, entry| or | entry.target.code()))
    }

    /// Station addresses of those that are not in their requested states.
    pub(crate) fn unsettled(&self) -> Vec<StationAddress> {
        let all = self.all.borrow();
        let is_settled = |it: &&Entry| matches!(it.progress, Progress::Reached | Progress::Left);
        all.iter().filter(|it| !is_settled(it)).map(|it| it.info.station).collect()
    }

    /// Station addresses of all.
    pub(crate) fn stations(&self) -> Vec<StationAddress> {
        self.all.borrow().iter().map(|entry| entry.info.station).collect()
    }

    /// Requests a state of the SubDevice at a position. Returns its attempt, and whether it is a new one: the same
    /// request may be under way.
    pub(crate) fn request(&self, position: Position, info: &Rc<SubDeviceInfo>, state: AlState) -> (Attempt, bool) {
        let place = self.all.borrow().iter().position(|entry| entry.info.station == info.station);
        let place = place.unwrap_or_else(|| {
            let entry = self.entry(position, info, Progress::Reached);
            self.all.borrow_mut().push(entry);
            self.all.borrow().len() - 1
        });
        let mut all = self.all.borrow_mut();
        let entry = &mut all[place];
        let is_under_way = entry.progress == Progress::UnderWay && entry.target == state;
        if !is_under_way {
            entry.before = core::mem::replace(&mut entry.target, state);
            entry.begin();
            entry.failures = 0;
        }
        let attempt = entry.attempt();
        drop(all);
        self.notify();
        (attempt, !is_under_way)
    }

    /// The attempts that are due; they are under way from now on.
    pub(crate) fn take_due(&self) -> Vec<Attempt> {
        let now = self.bus.now();
        let mut all = self.all.borrow_mut();
        let due = all.iter_mut().filter(|entry| matches!(entry.progress, Progress::Due(at) if at <= now));
        due.map(|entry| {
            entry.begin();
            entry.attempt()
        })
        .collect()
    }

    /// Waits until an attempt may be due.
    pub(crate) async fn until_due(&self) {
        let seen = self.version.get();
        let times = |entry: &Entry| match entry.progress {
            Progress::Due(at) => Some(at),
            Progress::UnderWay | Progress::Reached | Progress::Left => None,
        };
        let next = self.all.borrow().iter().filter_map(times).min().unwrap_or(Instant::NEVER);
        let changed = self.changed.until(|| (self.version.get() != seen).then_some(()));
        let _ = self.bus.within(next.since(self.bus.now()), changed).await;
    }

    /// Whether an attempt is the current one.
    pub(crate) fn is_current(&self, attempt: &Attempt) -> bool {
        self.all.borrow().iter().any(|entry| entry.is_of(attempt))
    }

    /// Whether the state of an attempt was reached and is still requested.
    pub(crate) fn is_reached(&self, attempt: &Attempt) -> bool {
        let is_it = |entry: &Entry| {
            let is_same = entry.info.station == attempt.station && entry.attempt == attempt.number;
            is_same && entry.progress == Progress::Reached
        };
        self.all.borrow().iter().any(is_it)
    }

    /// An attempt has ended. Returns true if the failure is to be reported.
    pub(crate) fn end(&self, attempt: &Attempt, result: Result<(), ConfigureError>, is_of_bus: bool) -> bool {
        let mut all = self.all.borrow_mut();
        let Some(entry) = all.iter_mut().find(|entry| entry.is_of(attempt)) else { return false };
        let is_reached = result.is_ok();
        entry.progress = if is_reached {
            entry.failures = 0;
            Progress::Reached
        } else {
            // A SubDevice that refuses a requested state goes back to the state before.
            entry.target = if is_of_bus { entry.target } else { core::mem::replace(&mut entry.before, AlState::PreOp) };
            entry.failures = entry.failures.saturating_add(1);
            let doublings = (entry.failures - 1).min(8);
            let pause = FIRST_PAUSE.saturating_mul(1 << doublings).min(LONGEST_PAUSE);
            let is_back = attempt.target != entry.target;
            let waits = self.retries == Retries::OnRequest && !is_of_bus && !is_back;
            Progress::Due(if waits { Instant::NEVER } else { self.bus.now() + pause })
        };
        entry.result = Some((attempt.number, result));
        let is_news = !is_reached && (entry.failures == 1 || !is_of_bus);
        drop(all);
        self.notify();
        is_news
    }

    /// Whether BOOT is requested of the SubDevice at a position.
    pub(crate) fn is_in_boot(&self, position: Position) -> bool {
        let all = self.all.borrow();
        all.iter().any(|entry| entry.position == position && entry.target == AlState::Boot)
    }

    /// Waits until a SubDevice has reached a requested state (true), or another one is requested (false).
    pub(crate) async fn until_decided(&self, station: StationAddress, state: AlState) -> bool {
        let decided = || {
            let all = self.all.borrow();
            let entry = all.iter().find(|entry| entry.info.station == station)?;
            (entry.target != state || entry.progress == Progress::Reached).then_some(entry.target == state)
        };
        self.changed.until(decided).await
    }

    /// The present position of the SubDevice of an attempt.
    pub(crate) fn position_of(&self, attempt: &Attempt) -> Option<Position> {
        self.all.borrow().iter().find(|entry| entry.is_of(attempt)).map(|entry| entry.position)
    }

    /// Waits for the result of an attempt.
    pub(crate) async fn result(&self, attempt: &Attempt) -> Result<(), ConfigureError> {
        let ready = || {
            let all = self.all.borrow();
            let entry = all.iter().find(|entry| entry.info.station == attempt.station);
            match entry {
                None => Some(Err(ConfigureError::Interrupted)),
                Some(entry) => match &entry.result {
                    Some((number, result)) if *number == attempt.number => Some(result.clone()),
                    _ if entry.attempt != attempt.number => Some(Err(ConfigureError::Interrupted)),
                    _ => None,
                },
            }
        };
        self.changed.until(ready).await
    }

    /// Repeats failed attempts now: of the SubDevice with a station address, or of all.
    pub(crate) fn retry(&self, station: Option<StationAddress>) {
        let now = self.bus.now();
        for entry in &mut *self.all.borrow_mut() {
            let is_meant = station.is_none_or(|station| entry.info.station == station);
            if is_meant && matches!(entry.progress, Progress::Due(_)) {
                entry.progress = Progress::Due(now);
                entry.failures = 0;
            }
        }
        self.notify();
    }

    /// States were read. A SubDevice that left its state is brought back; returned with its position.
    pub(crate) fn observe(&self, readings: &[(StationAddress, Reading)]) -> Vec<(Position, AlStatus, AlStatusCode)> {
        if !self.is_kept() {
            return Vec::new();
        }
        let now = self.bus.now();
        let mut left = Vec::new();
        for (station, reading) in readings {
            let Reading::Answer { status, code, .. } = reading else { continue };
            let mut all = self.all.borrow_mut();
            let Some(entry) = all.iter_mut().find(|entry| entry.info.station == *station) else { continue };
            let is_there = !status.error && status.al_state() == Some(entry.target);
            if entry.progress == Progress::Reached && !is_there {
                entry.progress = Progress::Due(now);
                entry.before = AlState::PreOp;
                left.push((entry.position, *status, *code));
            }
        }
        if !left.is_empty() {
            self.notify();
        }
        left
    }
}

impl Entry {
    fn begin(&mut self) {
        self.progress = Progress::UnderWay;
        self.attempt = self.attempt.wrapping_add(1);
    }

    fn attempt(&self) -> Attempt {
        Attempt {
            station: self.info.station,
            number: self.attempt,
            info: self.info.clone(),
            mailbox: self.mailbox.clone(),
            target: self.target,
        }
    }

    fn is_of(&self, attempt: &Attempt) -> bool {
        self.info.station == attempt.station && self.attempt == attempt.number && self.progress == Progress::UnderWay
    }
}
