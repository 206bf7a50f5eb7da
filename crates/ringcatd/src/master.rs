//! A master: its links, what is known of its segment, and the process that drives it.
//!
//! The daemon drives it, or an application; while it passes from one to the other nothing does. Fresh links are opened
//! each time it comes back, so that nothing that had it before reaches the segment any more.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat::daemon::{DaemonLinks, serving};
use ringcat::{Activity, Handover, Knowledge, Options, Retries, SupervisorThread};
use ringcat_control::message::{Ask, MasterState};
use ringcat_control::{Content, Message, Refusal};

use crate::log::say;
use crate::owner::{Answered, OwnerLink};
use crate::wires::{Opened, Wires};

/// A hand-over waits so long for the end of a scan.
const SCAN: Duration = Duration::from_secs(20);
/// Interval of looks at a scan.
const LOOK: Duration = Duration::from_millis(1);

/// A master.
#[derive(Debug)]
pub struct Master {
    number: u32,
    links: String,
    wires: Mutex<Wires>,
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
    /// It has given the master back.
    Released,
    /// It has ended without.
    Lost,
    /// It is stopped, and may go on later.
    Stopped,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Master {
    /// A master with these links, driven by the daemon from now on. Links that cannot be opened are tried again by
    /// [`Master::look_after`].
    pub fn new(number: u32, links: String, wires: Wires) -> Master {
        let master = Master {
            number,
            links,
            wires: Mutex::new(wires),
            driver: Mutex::new(Driver::Changing),
            knowledge: Mutex::default(),
        };
        master.drive(Handover::Orderly);
        master
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

    /// Hands the master over: sends the links and what is known of the segment to the new owner. Returns the links, for
    /// [`Master::take_back`] when its time ends.
    ///
    /// # Errors
    /// Why not. The daemon drives the master then, as far as it did before.
    pub fn hand_over(&self, owner: &Arc<OwnerLink>) -> Result<Opened, Refusal> {
        let (supervisor, opened) = self.begin_change()?;
        wait_for_scan(&supervisor);
        // A thread that has ended knows nothing.
        let knowledge = supervisor.hand_over().ok().flatten();
        drop(supervisor);
        let bytes = knowledge.as_ref().map(Knowledge::to_bytes).unwrap_or_default();
        locked(&self.knowledge).clone_from(&bytes);
        let message = Message { content: Content::Taken(opened.links.clone()), bytes };
        let raw: Vec<_> = opened.descriptors.iter().map(std::os::fd::AsRawFd::as_raw_fd).collect();
        let sent = owner.connection().send_with(&message, &raw);
        *locked(&self.driver) = Driver::Owner(owner.clone());
        match sent {
            Ok(()) => Ok(opened),
            Err(error) => {
                self.take_back(&opened, End::Lost);
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

    /// Keeps what an owner knows, for the case that it crashes. What cannot be read is not kept.
    pub fn keep(&self, knowledge: Vec<u8>) {
        if Knowledge::from_bytes(&knowledge).is_ok() {
            *locked(&self.knowledge) = knowledge;
        }
    }

    /// The time of its owner has ended: the daemon drives the master.
    pub fn take_back(&self, opened: &Opened, end: End) {
        if let Driver::Owner(owner) = std::mem::replace(&mut *locked(&self.driver), Driver::Changing) {
            owner.end();
        }
        let handover = match end {
            End::Released => Handover::Orderly,
            End::Lost | End::Stopped => Handover::AfterCrash,
        };
        if end == End::Stopped {
            // Before the daemon's first frame, so that no frame of the owner comes between.
            opened.revoke();
            self.drive(handover);
            return;
        }
        // It sends nothing more, but a child may have its links. The kernel takes milliseconds to take them away.
        std::thread::scope(|scope| {
            scope.spawn(|| opened.revoke());
            self.drive(handover);
        });
    }

    /// Tries again what was not possible before.
    pub fn look_after(&self) {
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
        let opened = locked(&self.wires).open()?;
        let adopted = DaemonLinks::adopt(&opened.links, opened.duplicates()?);
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
