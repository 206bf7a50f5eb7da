//! A master: its links, what is known of its segment, and the process that drives it.
//!
//! The daemon drives it, or an application; while it passes from one to the other nothing does. Fresh links are opened
//! each time it comes back, so that nothing that had it before reaches the segment any more.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat::daemon::{adopt_links, serving};
use ringcat::{
    Activity, AlState, Error, Handover, Knowledge, Options, Retries, Services, StateScope, SupervisorThread,
};
use ringcat_control::message::{Ask, MasterState};
use ringcat_control::{Content, Message, Refusal};

use crate::log::say;
use crate::owner::{Answered, OwnerLink};
use crate::owner_lock::OwnerLock;
use crate::wires::{Opened, Wires};

/// A hand-over waits so long for the end of a scan.
const SCAN: Duration = Duration::from_secs(20);
/// A hand-over waits so long for SubDevices that change their states.
const SETTLE: Duration = Duration::from_secs(3);
/// States that do not change for this time stay as they are.
const STILL: Duration = Duration::from_millis(100);
/// SubDevices reach their safe state within this time.
const LEAD: Duration = Duration::from_secs(10);
/// Interval of looks at a scan.
const LOOK: Duration = Duration::from_millis(1);

/// A master.
#[derive(Debug)]
pub struct Master {
    number: u32,
    links: String,
    safe_state: AlState,
    wires: Mutex<Wires>,
    lock: Mutex<Option<OwnerLock>>,
    driver: Mutex<Driver>,
    /// What is known of the segment while the daemon does not drive it.
    knowledge: Mutex<Vec<u8>>,
}

/// What drives a master.
#[derive(Debug)]
enum Driver {
    /// This daemon, with descriptors for the next owner.
    Daemon(SupervisorThread, Opened),
    /// An application.
    Owner(Arc<OwnerLink>),
    /// It passes from one process to another.
    Changing,
    /// Nothing, because of this.
    Fault(String),
}

/// How the time of an owner has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It has given the master back, with all counters.
    Released,
    /// It sends nothing more. What it knew last is lost.
    Ended,
    /// Its process lives, and may go on to send.
    MayGoOn,
}

/// The time of an owner. It ends by [`Tenancy::end`]; if the thread that watches it fails before, nothing drives the
/// master until the next [`Master::look_after`].
#[derive(Debug)]
#[must_use]
pub struct Tenancy<'a> {
    master: &'a Master,
    opened: Opened,
    is_over: bool,
}

impl Tenancy<'_> {
    /// The daemon drives the master from now on.
    pub fn end(mut self, end: End) {
        self.master.take_back(&self.opened, end);
        self.is_over = true;
    }
}

impl Drop for Tenancy<'_> {
    fn drop(&mut self) {
        if !self.is_over {
            self.opened.revoke();
            self.master.fail("a thread of the daemon has failed");
        }
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Master {
    /// A master with these links, driven by the daemon from now on. Links that cannot be opened are tried again by
    /// [`Master::look_after`].
    pub fn new(number: u32, links: String, wires: Wires) -> Master {
        Master::begin(number, links, wires, None)
    }

    /// The same with a lock that its owners hold: while one has it from an earlier daemon, this one waits.
    pub fn with_lock(number: u32, links: String, wires: Wires, lock: OwnerLock) -> Master {
        Master::begin(number, links, wires, Some(lock))
    }

    fn begin(number: u32, links: String, wires: Wires, lock: Option<OwnerLock>) -> Master {
        let master = Master {
            number,
            links,
            safe_state: AlState::PreOp,
            wires: Mutex::new(wires),
            lock: Mutex::new(lock),
            driver: Mutex::new(Driver::Changing),
            knowledge: Mutex::default(),
        };
        master.drive(Handover::Orderly);
        master.prepare();
        master
    }

    /// Prepares sockets for the next time that the daemon takes the master back. Takes tens of milliseconds, without a
    /// lock.
    pub fn prepare(&self) {
        loop {
            let Some(lacking) = locked(&self.wires).lacking() else { return };
            // Without them the links are opened when they are needed, which also reports why they cannot be.
            let Ok(prepared) = lacking.prepare() else { return };
            locked(&self.wires).keep(prepared);
        }
    }

    /// The state of its SubDevices after the end of an application, in place of PREOP.
    #[must_use]
    pub fn with_safe_state(mut self, state: AlState) -> Master {
        self.safe_state = state;
        self
    }

    /// Its number.
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Its links, and what drives it.
    pub fn state(&self) -> MasterState {
        let (owner, fault) = match &*locked(&self.driver) {
            Driver::Owner(owner) => (Some(owner.owner().clone()), None),
            Driver::Fault(cause) => (None, Some(cause.clone())),
            Driver::Daemon(..) | Driver::Changing => (None, None),
        };
        MasterState { master: self.number, links: self.links.clone(), owner, fault }
    }

    /// Answers a question, from the process that drives it.
    pub fn ask(&self, what: Ask, bytes: Vec<u8>) -> Answered {
        let master = self.number;
        let supervisor = match &*locked(&self.driver) {
            Driver::Daemon(supervisor, _) => Ok(supervisor.clone()),
            Driver::Owner(owner) => Err(owner.clone()),
            Driver::Changing => return Err(Refusal::Changing { master }),
            Driver::Fault(cause) => return Err(Refusal::Fault { master, cause: cause.clone() }),
        };
        let supervisor = match supervisor {
            Ok(supervisor) => supervisor,
            Err(owner) => return owner.ask(what, bytes),
        };
        let answered = serving::answer(&supervisor, what, bytes);
        // A hand-over in between has ended it.
        if answered.is_err() && !matches!(&*locked(&self.driver), Driver::Daemon(..)) {
            return Err(Refusal::Changing { master });
        }
        answered
    }

    /// Hands the master over: sends the links and what is known of the segment to the new owner. Returns its
    /// time.
    ///
    /// # Errors
    /// Why not. The daemon drives the master then, as far as it did before.
    pub fn hand_over(&self, owner: &Arc<OwnerLink>) -> Result<Tenancy<'_>, Refusal> {
        let (supervisor, opened) = self.begin_change()?;
        let tenancy = Tenancy { master: self, opened, is_over: false };
        wait_for_scan(&supervisor);
        wait_until_settled(&supervisor);
        // A thread that has ended knows nothing.
        let knowledge = supervisor.hand_over().ok().flatten();
        drop(supervisor);
        let bytes = knowledge.as_ref().map(Knowledge::to_bytes).unwrap_or_default();
        locked(&self.knowledge).clone_from(&bytes);
        let message = Message { content: Content::Taken(tenancy.opened.links.clone()), bytes };
        let mut raw: Vec<_> = tenancy.opened.descriptors.iter().map(std::os::fd::AsRawFd::as_raw_fd).collect();
        if let Some(lock) = &mut *locked(&self.lock) {
            lock.note(owner.owner());
            raw.push(lock.descriptor());
        }
        let sent = owner.connection().send_with(&message, &raw);
        *locked(&self.driver) = Driver::Owner(owner.clone());
        match sent {
            Ok(()) => Ok(tenancy),
            Err(error) => {
                // It may have got them.
                tenancy.end(End::MayGoOn);
                Err(Refusal::Failed(format!("the links cannot be sent: {error}")))
            }
        }
    }

    /// Takes what the daemon drives out of its hands.
    fn begin_change(&self) -> Result<(SupervisorThread, Opened), Refusal> {
        let master = self.number;
        let mut driver = locked(&self.driver);
        match std::mem::replace(&mut *driver, Driver::Changing) {
            Driver::Daemon(supervisor, opened) => Ok((supervisor, opened)),
            Driver::Changing => Err(Refusal::Changing { master }),
            Driver::Owner(owner) => {
                let by = owner.owner().clone();
                *driver = Driver::Owner(owner);
                Err(Refusal::Owned { master, by })
            }
            Driver::Fault(cause) => {
                *driver = Driver::Fault(cause.clone());
                Err(Refusal::Fault { master, cause })
            }
        }
    }

    /// Keeps what an owner knows, for the case that it crashes. False if it cannot be read and is not kept.
    pub fn keep(&self, knowledge: Vec<u8>) -> bool {
        let is_usable = Knowledge::from_bytes(&knowledge).is_ok();
        if is_usable {
            *locked(&self.knowledge) = knowledge;
        }
        is_usable
    }

    /// Nothing drives the master, because of this.
    fn fail(&self, cause: &str) {
        say(format_args!("master {} is not driven: {cause}", self.number));
        if let Driver::Owner(owner) = std::mem::replace(&mut *locked(&self.driver), Driver::Fault(cause.to_owned())) {
            owner.end();
        }
    }

    /// The time of its owner has ended: the daemon drives the master.
    fn take_back(&self, opened: &Opened, end: End) {
        if let Driver::Owner(owner) = std::mem::replace(&mut *locked(&self.driver), Driver::Changing) {
            owner.end();
        }
        let handover = match end {
            End::Released => Handover::Orderly,
            End::Ended | End::MayGoOn => Handover::AfterCrash,
        };
        if end == End::MayGoOn {
            // Before the daemon's first frame, so that no frame of the owner comes between.
            opened.revoke();
            self.drive(handover);
            self.lead_to_safe_state();
            return;
        }
        // It sends nothing more, but a child may have its links. The kernel takes milliseconds to take them away.
        std::thread::scope(|scope| {
            let revoke = || opened.revoke();
            if std::thread::Builder::new().name("revoke".into()).spawn_scoped(scope, revoke).is_err() {
                opened.revoke();
            }
            self.drive(handover);
        });
        self.lead_to_safe_state();
    }

    /// Brings all SubDevices to the safe state, in a thread: PREOP needs none.
    fn lead_to_safe_state(&self) {
        let (state, number) = (self.safe_state, self.number);
        let supervisor = match &*locked(&self.driver) {
            Driver::Daemon(supervisor, _) if state != AlState::PreOp => supervisor.clone(),
            _ => return,
        };
        let lead = move || {
            wait_for_scan(&supervisor);
            match supervisor.request_state_of_all(state, StateScope::All, LEAD) {
                // The next application has the master already.
                Ok(()) | Err(Error::Gone) => {}
                Err(error) => say(format_args!("master {number}: not all SubDevices are in {state}: {error}")),
            }
        };
        if let Err(error) = std::thread::Builder::new().name("safe state".into()).spawn(lead) {
            say(format_args!("master {number}: all SubDevices stay in PREOP: {error}"));
        }
    }

    /// Tries again what was not possible before, and prepares sockets for the next owner's end.
    pub fn look_after(&self) {
        self.prepare();
        let is_faulty = matches!(&*locked(&self.driver), Driver::Fault(_));
        if is_faulty {
            self.drive(Handover::AfterCrash);
        }
    }

    /// Drives the master on fresh links, and goes on with what is known.
    fn drive(&self, handover: Handover) {
        let driver = match self.start(handover) {
            Ok((supervisor, opened)) => Driver::Daemon(supervisor, opened),
            Err(cause) => {
                if !matches!(&*locked(&self.driver), Driver::Fault(before) if *before == cause) {
                    say(format_args!("master {} is not driven: {cause}", self.number));
                }
                Driver::Fault(cause)
            }
        };
        *locked(&self.driver) = driver;
    }

    fn start(&self, handover: Handover) -> Result<(SupervisorThread, Opened), String> {
        // Never beside a process that may still drive it.
        locked(&self.lock).as_mut().map_or(Ok(()), OwnerLock::hold)?;
        let opened = locked(&self.wires).open()?;
        let adopted = adopt_links(&opened.links, opened.duplicates()?);
        let (_cyclic, acyclic) = adopted.map_err(|error| error.to_string())?;
        let options = Options::default().with_idle_operation(true).with_retries(Retries::OnRequest);
        let supervisor = match Knowledge::from_bytes(&locked(&self.knowledge)) {
            Ok(knowledge) => SupervisorThread::start_resumed(acyclic, &options, (knowledge, handover), || ()),
            // Nothing is known yet.
            Err(_) => SupervisorThread::start(acyclic, &options, || ()),
        };
        let supervisor = supervisor.map_err(|error| error.to_string())?;
        Ok((supervisor, opened))
    }
}

/// Waits until no SubDevice changes its state any more: after the end of an application, or when they have just got
/// power, they are on their way to PREOP, and what leads them there is not interrupted. OP does not depend on it
/// any more. It stays because an application that asks for mailboxes first finds them in use.
fn wait_until_settled(supervisor: &SupervisorThread) {
    let settled = AlState::PreOp.code();
    let (begin, mut last, mut since) = (Instant::now(), 0, Instant::now());
    while let Ok(seen) = serving::look(supervisor) {
        if seen.al_states != last {
            (last, since) = (seen.al_states, Instant::now());
        }
        // Some may be in a safe state, or in an error that nothing ends.
        let is_still = since.elapsed() >= STILL || begin.elapsed() >= SETTLE;
        if seen.al_states == settled || seen.responding() == 0 || is_still {
            return;
        }
        std::thread::sleep(LOOK);
    }
}

/// Waits for the end of a scan that runs.
fn wait_for_scan(supervisor: &SupervisorThread) {
    let begin = Instant::now();
    while begin.elapsed() < SCAN {
        match supervisor.with(|engine| engine.snapshot().activity) {
            Ok(Activity::Scanning) => std::thread::sleep(LOOK),
            _ => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;
    use std::path::Path;

    use ringcat::piped::segment::PipedSegment;
    use ringcat::sim::network::Network;
    use ringcat::sim::segment::Segment;

    use super::*;
    use crate::owner::for_tests;
    use crate::segment_process;

    // covers: daemon
    #[test]
    fn a_thread_that_fails_leaves_the_master_to_the_daemon() {
        let (near, far) = UnixStream::pair().expect("a pair");
        // It ends with the daemon's socket and pipes.
        std::thread::spawn(move || {
            let described = Segment::from_toml("[segment]\n[[device]]\ntype = \"servo\"\n", Path::new("."));
            let network = Network::from_description(described.expect("it is right")).expect("it is right");
            segment_process::serve(&mut PipedSegment::new(network), &far, |_| true).expect("a socket");
        });
        let master = Master::new(0, "test".to_owned(), Wires::to_segment(near).expect("it is right"));
        let (owner, _far) = for_tests().expect("a pair");
        let owner = Arc::new(owner);
        let failed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let _tenancy = master.hand_over(&owner).expect("the daemon drives it");
            panic!("expected by the test");
        }));
        assert!(failed.is_err());
        assert!(matches!(owner.ask(Ask::State, Vec::new()), Err(Refusal::Changing { .. })));
        let fault = master.state().fault.expect("nothing drives it");
        assert_eq!(fault, "a thread of the daemon has failed");
        master.look_after();
        assert_eq!((master.state().fault, master.state().owner), (None, None));
        master.hand_over(&owner).expect("the daemon drives it").end(End::Ended);
        assert_eq!((master.state().fault, master.state().owner), (None, None));
    }
}
