//! The application of a handle between activation and deactivation, for cyclic calls.
//!
//! A bus that the daemon has taken back, because the process was stopped, shows with the next call that receives: from
//! then on all cyclic calls are refused until the handle is deactivated or released.

use std::sync::Arc;
use std::time::Duration;

use ringcat::daemon::OwnershipWatch;
use ringcat::{Application, Instant, SupervisorThread};

use crate::any_links::AnyLinks;
use crate::bus::Bus;
use crate::code::{Code, Outcome};

/// Longer than the wait for any frame.
const LONGEST_WAIT: Duration = Duration::from_secs(10);

/// The application of a handle.
pub type App = Application<AnyLinks, SupervisorThread>;

/// The place of the application.
#[derive(Debug, Default)]
pub enum Slot {
    /// There is no application.
    #[default]
    Empty,
    /// It runs.
    Active(Active),
    /// Its bus was taken back.
    Lost(Active),
}

impl Slot {
    /// Uses the application; `None` if there is none.
    ///
    /// # Errors
    /// [`Code::GONE`]: its bus was taken back.
    #[inline(always)]
    pub fn use_now<R>(&mut self, work: impl FnOnce(&mut Active) -> R) -> Outcome<Option<R>> {
        match self {
            Slot::Active(active) => Ok(Some(work(active))),
            Slot::Empty => Ok(None),
            Slot::Lost(_) => Err(Code::GONE),
        }
    }

    /// Receives the frames that have arrived, as [`Slot::use_now`], and checks whether the bus was taken back.
    ///
    /// # Errors
    /// As [`Slot::use_now`].
    #[inline(always)]
    pub fn receive(&mut self) -> Outcome<Option<()>> {
        match self {
            Slot::Active(active) if active.is_taken_back() => {
                self.lose();
                Err(Code::GONE)
            }
            _ => self.use_now(|active| active.application.receive()),
        }
    }

    #[cold]
    fn lose(&mut self) {
        *self = match std::mem::take(self) {
            Slot::Active(active) => Slot::Lost(active),
            other => other,
        };
    }

    /// Takes the application out.
    pub fn take(&mut self) -> Option<Active> {
        match std::mem::take(self) {
            Slot::Active(active) | Slot::Lost(active) => Some(active),
            Slot::Empty => None,
        }
    }
}

/// The application, and the times of its last cycle.
#[derive(Debug)]
pub struct Active {
    /// The application.
    pub application: App,
    /// The last call of send that distributed time.
    sent_at: Instant,
    /// The previous one: a time that is read from its frame is valid, whether or not the domain was processed since the
    /// last call of receive.
    awaited: Instant,
    /// The next call of send distributes time.
    distributes: bool,
    has_clock: bool,
    /// Of a bus from a daemon.
    ownership: Option<OwnershipWatch>,
    /// Of a bus of this process: it ends after the application, wherever that is dropped, and until then no other bus
    /// opens its links. One from a daemon goes back there.
    _bus: Option<Arc<Bus>>,
}

impl Active {
    /// An application that has not sent anything.
    pub fn new(application: App, has_clock: bool, bus: Arc<Bus>) -> Active {
        let (now, ownership) = (application.now(), bus.ownership());
        let _bus = ownership.is_none().then_some(bus);
        Active { application, sent_at: now, awaited: now, distributes: false, has_clock, ownership, _bus }
    }

    #[inline(always)]
    fn is_taken_back(&self) -> bool {
        self.ownership.as_ref().is_some_and(OwnershipWatch::is_taken_back)
    }

    /// Sends what was queued. Nothing is sent while the acyclic half measures the delays of clocks, for which the wire
    /// must be empty: here frames count as on the wire from one send to the next receive.
    #[inline(always)]
    pub fn send(&mut self) {
        if self.has_clock {
            if self.application.pauses() {
                return;
            }
            if std::mem::take(&mut self.distributes) {
                self.awaited = self.sent_at;
                self.sent_at = self.application.now();
            }
        }
        self.application.send();
    }

    /// The time until receive is to be called so that a frame that is lost by then is sent again; `None` if no frame
    /// is waited for.
    pub fn receive_again_in(&self) -> Option<Duration> {
        let at = self.application.receive_again_at();
        let rest = (at != Instant::NEVER).then(|| at.since(self.application.now()));
        // Before round trips are known the time is far in the future.
        rest.filter(|rest| *rest < LONGEST_WAIT)
    }

    /// The next call of send distributes time.
    pub fn sync_clocks(&mut self) {
        self.application.sync_clocks();
        self.distributes = true;
    }

    /// The time of the reference clock, if one of the last two frames that distributed time has returned.
    pub fn reference_time(&self) -> Option<u64> {
        let read = self.application.exchange().reference_time()?;
        (read.sent_at >= self.awaited).then_some(read.time)
    }
}
