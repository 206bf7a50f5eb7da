//! One handle of a master: reservation, activation, the way back.
//!
//! A handle that only opened the master may request information and use mailboxes, beside the one that reserved it. The
//! application exists between activation and deactivation; cyclic calls use it by a claim that never waits.

mod activation;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use ringcat::daemon::{ClientError, SegmentOverview};
use ringcat::{LastOutputs, Link, ReferenceClock, Services, SubDeviceId};

use crate::active::{Active, Slot};
use crate::bus::Bus;
use crate::claim::Claim;
use crate::code::{Code, Outcome, report};
use crate::draft::Draft;
use crate::environment::socket;
use crate::given_time::GivenTimes;
use crate::host::{check_memory, variable, watch_forks};
use crate::live::{Live, Words};
use crate::locks::locked;
use crate::network::Network;
use crate::responder::{DaemonResponder, Responder};
use crate::types::SegmentState;

/// Limit of the way to PREOP at the end of an application.
const END_LIMIT: Duration = Duration::from_secs(5);
/// Longest wait for a cyclic call of another thread.
const CLAIM_LIMIT: Duration = Duration::from_secs(1);

/// Limit of the way to PREOP on a bus. No frame reaches the SubDevices of one that the daemon has taken back.
fn end_limit(bus: &Bus) -> Duration {
    if bus.check_held().is_ok() { END_LIMIT } else { Duration::ZERO }
}

/// What a handle has of its master.
#[derive(Debug)]
enum Access {
    /// The bus: this process has opened the links.
    Bus(Arc<Bus>),
    /// The bus, reserved for this handle: of this process, or handed over by a daemon.
    Reserved(Arc<Bus>),
    /// Questions to a daemon.
    Daemon(Arc<Responder>),
    /// Nothing: it was released.
    Released,
}

/// A connection to the daemon that has this master. `None` if variables name links instead, or no variable names the
/// daemon and none answers.
///
/// # Errors
/// The daemon does not answer, or has no such master.
fn ask_daemon(index: u32) -> Result<Option<DaemonResponder>, String> {
    let Some(socket) = socket(index, variable) else { return Ok(None) };
    match DaemonResponder::open(&socket, index) {
        Ok(responder) => Ok(Some(responder)),
        Err(ClientError::NoDaemon { .. }) if variable("RINGCAT_SOCKET").is_none() => Ok(None),
        Err(error) => Err(error.to_string()),
    }
}

/// A handle of a master.
#[derive(Debug)]
pub struct Master {
    access: Mutex<Access>,
    is_reserved: AtomicBool,
    is_active: AtomicBool,
    has_clock: AtomicBool,
    /// The links of the active application are a ring.
    is_ring: AtomicBool,
    draft: Mutex<Draft>,
    application: Claim<Slot>,
    live: Live,
    /// The last time of the application; 0 before.
    application_time: AtomicU64,
    /// Times before activation.
    given: Mutex<GivenTimes>,
    /// Memory of images that no application uses.
    memory: Mutex<Vec<&'static mut [u8]>>,
}

impl Master {
    /// Opens a master: a connection to the daemon that has it, or the links that variables name.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn open(index: u32) -> Result<Master, String> {
        watch_forks();
        check_memory()?;
        let access = match ask_daemon(index)? {
            Some(responder) => Access::Daemon(Arc::new(Responder::Daemon(responder))),
            None => Access::Bus(Bus::open(index)?),
        };
        Ok(Master {
            access: Mutex::new(access),
            is_reserved: AtomicBool::new(false),
            is_active: AtomicBool::new(false),
            has_clock: AtomicBool::new(false),
            is_ring: AtomicBool::new(false),
            draft: Mutex::default(),
            application: Claim::new(Slot::Empty),
            live: Live::default(),
            application_time: AtomicU64::new(0),
            given: Mutex::default(),
            memory: Mutex::default(),
        })
    }

    /// Its bus.
    ///
    /// # Errors
    /// It was released, or a daemon has the bus because this handle has not reserved it.
    pub fn bus(&self) -> Outcome<Arc<Bus>> {
        match &*locked(&self.access) {
            Access::Bus(bus) | Access::Reserved(bus) => Ok(bus.clone()),
            Access::Daemon(_) => Err(Code::NOT_RESERVED),
            Access::Released => Err(Code::INVALID),
        }
    }

    /// Where questions are answered.
    ///
    /// # Errors
    /// It was released, or the daemon has taken the bus back.
    pub fn responder(&self) -> Outcome<Arc<Responder>> {
        match &*locked(&self.access) {
            Access::Bus(bus) | Access::Reserved(bus) => bus.check_held().map(|()| bus.responder()),
            Access::Daemon(responder) => Ok(responder.clone()),
            Access::Released => Err(Code::INVALID),
        }
    }

    /// Reserves the bus; returns when it is scanned.
    ///
    /// # Errors
    /// Another handle or process has it, or this handle has it already.
    pub fn reserve(&self) -> Outcome {
        let bus = self.take()?;
        bus.wait_until_scanned();
        let mut draft = locked(&self.draft);
        draft.set_found(bus.found()?);
        draft.set_wildcards(bus.settings().has_wildcards);
        drop(draft);
        self.is_reserved.store(true, Ordering::Release);
        Ok(())
    }

    /// The bus, reserved for this handle; from a daemon if it does not have it.
    fn take(&self) -> Outcome<Arc<Bus>> {
        let mut access = locked(&self.access);
        let bus = match &*access {
            Access::Daemon(responder) => match &**responder {
                Responder::Daemon(responder) => Bus::take(responder)?,
                Responder::Here(_) => return Err(Code::INVALID),
            },
            Access::Bus(bus) | Access::Reserved(bus) => bus.clone(),
            Access::Released => return Err(Code::INVALID),
        };
        bus.reserve()?;
        *access = Access::Reserved(bus.clone());
        Ok(bus)
    }

    /// Whether this handle has reserved the bus.
    ///
    /// # Errors
    /// It has not.
    pub fn check_reserved(&self) -> Outcome {
        if self.is_reserved.load(Ordering::Acquire) { Ok(()) } else { Err(Code::NOT_RESERVED) }
    }

    /// Whether an application is active.
    pub fn is_active(&self) -> bool {
        self.is_active.load(Ordering::Acquire)
    }

    /// Changes the declaration.
    ///
    /// # Errors
    /// The handle has not reserved the bus, or the application is active.
    pub fn change<R>(&self, change: impl FnOnce(&mut Draft) -> Outcome<R>) -> Outcome<R> {
        self.check_reserved()?;
        let mut draft = locked(&self.draft);
        if self.is_active() {
            return Err(Code::BUSY);
        }
        change(&mut draft)
    }

    /// Reads the declaration.
    ///
    /// # Errors
    /// The handle has not reserved the bus.
    pub fn look<R>(&self, look: impl FnOnce(&Draft) -> R) -> Outcome<R> {
        self.check_reserved()?;
        Ok(look(&locked(&self.draft)))
    }

    /// The declaration follows the last scan from now on.
    ///
    /// # Errors
    /// As [`Master::change`].
    pub fn refresh(&self) -> Outcome {
        let found = self.bus()?.found()?;
        self.change(|draft| {
            draft.set_found(found);
            Ok(())
        })
    }

    /// Declares the network of a file.
    ///
    /// # Errors
    /// As [`Master::change`]; something is declared already, or the file does not fit the bus.
    pub fn load(&self, file: &Network) -> Outcome {
        if self.is_active() {
            return Err(Code::BUSY);
        }
        // SubDevices are identified by these words.
        let words = self.bus()?.supervisor().learn_data_words(file.declared());
        words.map_err(|_| Code::GONE)?;
        self.refresh()?;
        let is_ring = self.responder()?.overview()?.is_ring;
        if file.is_ring && !is_ring {
            report(format_args!("the network file declares a ring: it needs a redundant interface"));
            return Err(Code::INVALID);
        }
        self.change(|draft| {
            let loaded = draft.load(file);
            // A network is declared as a whole or not at all.
            if loaded.is_err_and(|code| code != Code::BUSY) {
                draft.clear();
            }
            loaded
        })
    }

    /// Starts the application. It returns at once; SubDevices are configured while it cycles.
    ///
    /// # Errors
    /// The handle has not reserved the bus, the declaration does not fit, or the daemon has taken the bus back, also
    /// that of an active application.
    pub fn activate(&self) -> Outcome {
        self.check_reserved()?;
        let bus = self.bus()?;
        bus.check_held()?;
        if self.is_active() {
            report(format_args!("the master is active already"));
            return Ok(());
        }
        self.refresh()?;
        let draft = locked(&self.draft);
        // Another thread may have released it meanwhile, which waits for the draft.
        self.check_reserved()?;
        // Another thread may have activated it meanwhile; its application uses the memory of the domains.
        if self.is_active() {
            report(format_args!("the master is active already"));
            return Ok(());
        }
        self.has_clock.store(draft.has_clock(), Ordering::Release);
        self.begin(&bus, &draft)?;
        self.is_active.store(true, Ordering::Release);
        Ok(())
    }

    /// Ends the application: all SubDevices go to PREOP, the declaration is empty again.
    ///
    /// # Errors
    /// The handle has not reserved the bus, or nothing is active.
    pub fn deactivate(&self) -> Outcome {
        self.check_reserved()?;
        self.end()
    }

    fn end(&self) -> Outcome {
        let bus = self.bus()?;
        let taken = self.application.use_within(CLAIM_LIMIT, Slot::take)?;
        let Active { mut application, .. } = taken.ok_or(Code::INVALID)?;
        // The log already has that the daemon has taken the bus back.
        let is_held = bus.check_held().is_ok();
        let mut draft = locked(&self.draft);
        self.keep_memory(&draft, |domain| application.give_memory_back(domain));
        let ended = match application.deactivate(LastOutputs::Zero, end_limit(&bus)) {
            Ok(ended) => ended,
            Err(refused) => {
                if is_held {
                    report(format_args!("master {}: {}", bus.master(), refused.error));
                }
                refused.main_device
            }
        };
        bus.give_links_back(ended.links);
        draft.clear();
        self.application_time.store(0, Ordering::Relaxed);
        *locked(&self.given) = GivenTimes::default();
        self.is_active.store(false, Ordering::Release);
        // The states of SubDevices are not known once the acyclic half has ended; a line reports it.
        let _ = self.live.follow(&bus, 0, false);
        draft.set_found(bus.found().unwrap_or_default());
        Ok(())
    }

    /// Ends everything that the handle has.
    ///
    /// # Errors
    /// [`Code::IO`]: a cyclic call panicked. What is left is for [`Master::abandon`].
    pub fn release(&self) -> Outcome {
        // An activation in another thread ends before, and a later one finds that nothing is reserved.
        {
            let _draft = locked(&self.draft);
            self.is_reserved.store(false, Ordering::Release);
        }
        if self.is_active() && self.end() == Err(Code::IO) {
            return Err(Code::IO);
        }
        let access = std::mem::replace(&mut *locked(&self.access), Access::Released);
        if let Access::Reserved(bus) = access {
            bus.unreserve();
        }
        Ok(())
    }

    /// Gives everything up after a panic. What the application has is dropped, not used: its SubDevices are left to the
    /// daemon, or without one to their watchdogs. A bus of another handle stays as it is.
    pub fn abandon(&self) {
        let access = std::mem::replace(&mut *locked(&self.access), Access::Released);
        if let Access::Reserved(bus) = &access {
            bus.abandon();
        }
        self.is_reserved.store(false, Ordering::Release);
        self.is_active.store(false, Ordering::Release);
        // May panic too: everything else is given up by now. Without a daemon the application has the bus as long
        // as it exists.
        let failed = self.application.recover(Slot::Empty);
        drop(failed.or_else(|| self.application.use_within(CLAIM_LIMIT, std::mem::take).ok()));
    }

    /// The end of the application panics.
    #[cfg(test)]
    pub fn panic_at_the_end(&self) {
        locked(&self.draft).panics_when_cleared = true;
    }

    /// A cyclic call: uses the application, or does nothing while there is none.
    ///
    /// # Errors
    /// The handle has not reserved the bus; another cyclic call runs; the daemon has taken the bus back, which
    /// [`Master::receive`] finds.
    #[inline(always)]
    pub fn cycle<R: Default>(&self, work: impl FnOnce(&mut Active) -> R) -> Outcome<R> {
        match self.application.use_now(|slot| slot.use_now(work))?? {
            Some(result) => Ok(result),
            None => self.check_reserved().map(|()| R::default()),
        }
    }

    /// The first call of a cycle: receives the frames that have arrived.
    ///
    /// # Errors
    /// As [`Master::cycle`].
    #[inline(always)]
    pub fn receive(&self) -> Outcome {
        match self.application.use_now(Slot::receive)?? {
            Some(()) => Ok(()),
            None => self.check_reserved(),
        }
    }

    /// State of all SubDevices, or of those on one link. Loads words while the application of this handle is active;
    /// before, it reads the SubDevices.
    ///
    /// # Errors
    /// The handle was released; another thread activates or deactivates it; the bus has one link only.
    pub fn segment(&self, link: Option<Link>) -> Outcome<SegmentState> {
        if self.is_active() {
            if link == Some(Link::Redundant) && !self.is_ring() {
                return Err(Code::INVALID);
            }
            return self.live(SegmentState::default(), |live| live.segment(link));
        }
        let seen = self.responder()?.overview()?;
        if link == Some(Link::Redundant) && !seen.is_ring {
            return Err(Code::INVALID);
        }
        Ok(match link {
            None => SegmentState::new(seen.responding(), seen.al_states, seen.is_up.contains(&true)),
            Some(link) => {
                let count = seen.counts[link.index()];
                SegmentState::new(count, if count > 0 { seen.al_states } else { 0 }, seen.is_up[link.index()])
            }
        })
    }

    /// Reads words of the active application; `lost` stands for them when the daemon has taken the bus back.
    ///
    /// # Errors
    /// Another thread activates or deactivates it.
    pub fn live<R>(&self, lost: R, read: impl FnOnce(&Words) -> R) -> Outcome<R> {
        self.live.read(lost, read)
    }

    /// State of all SubDevices: from words while the application of this handle is active, otherwise from an answer.
    ///
    /// # Errors
    /// As [`Master::live`] and [`Master::responder`]; the answer does not come.
    pub fn overview(&self) -> Outcome<SegmentOverview> {
        if !self.is_active() {
            return self.responder()?.overview();
        }
        self.live(None, |live| Some(live.overview()))?.ok_or(Code::GONE)
    }

    /// Repeats failed configurations. While the application is active, this only sets a word for the acyclic half.
    ///
    /// # Errors
    /// The handle has not reserved the bus; as [`Master::live`]; the acyclic half has ended.
    pub fn reset(&self) -> Outcome {
        self.check_reserved()?;
        if !self.is_active() {
            return self.bus()?.supervisor().retry(None).map(|_| ()).map_err(|_| Code::GONE);
        }
        self.live.retry()
    }

    /// Whether a clock takes part in the application.
    pub fn has_clock(&self) -> bool {
        self.is_active() && self.has_clock.load(Ordering::Relaxed)
    }

    /// Sets the application's time.
    ///
    /// # Errors
    /// The handle has not reserved the bus; another cyclic call runs.
    pub fn set_application_time(&self, time: u64) -> Outcome {
        self.check_reserved()?;
        self.application_time.store(time, Ordering::Relaxed);
        if !self.is_active() {
            locked(&self.given).set(time);
        }
        self.cycle(|Active { application, .. }| {
            let now = application.now();
            application.set_application_time(time, now);
        })
    }

    /// The application's time.
    pub fn application_time(&self) -> u64 {
        self.application_time.load(Ordering::Relaxed)
    }
}

impl Master {
    /// Chooses the reference clock, also while the application is active; `None`: the first SubDevice with a clock.
    ///
    /// # Errors
    /// The SubDevice has no clock; no SubDevice has one.
    pub fn select_reference(&self, index: Option<usize>) -> Outcome {
        if !self.is_active() {
            return self.change(|draft| draft.choose_reference(index));
        }
        self.look(|draft| draft.check_reference(index))??;
        let reference =
            index.map_or(ReferenceClock::FirstWithClock, |index| ReferenceClock::Declared(SubDeviceId(index)));
        let chosen = self.bus()?.supervisor().choose_reference_clock(reference);
        chosen.map_err(|_| Code::GONE)?.map(|_| ()).ok_or(Code::NO_CLOCK)
    }

    /// Whether the links of the active application are a ring.
    #[inline(always)]
    pub fn is_ring(&self) -> bool {
        self.is_ring.load(Ordering::Relaxed)
    }
}
