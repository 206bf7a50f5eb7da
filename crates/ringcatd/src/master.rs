//! A master: its links, what is known of its segment, and the process that drives it.
//!
//! The daemon drives it, or an application; while it passes from one to the other nothing does. Fresh links are opened
//! each time it comes back, so that nothing that had it before reaches the segment any more.

use std::os::fd::AsRawFd;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use ringcat::daemon::{LastWritten, Lines, serving};
use ringcat::{AlState, Handover, Knowledge};
use ringcat_control::message::{Answer, HandedBus, MasterState, Query, ToolAnswer, ToolQuery};
use ringcat_control::{BusSettings, Content, Message, Refusal};
use ringcat_link::TapInterface;

use crate::debug_interfaces::DebugTaps;
use crate::driver::{CHANGE, Current, Driver};
use crate::driving::{Driving, Lasting};
use crate::ethernet::EthernetInterfaces;
use crate::log::say;
use crate::opened::Opened;
use crate::others::Others;
use crate::owner::{Answered, OwnerLink};
use crate::owner_lock::OwnerLock;
use crate::wires::Wires;

/// The message that the daemon has failed reaches an owner within this time.
const TELL: Duration = Duration::from_millis(100);
/// Text of this message, also for the operator.
const FAILED: &str = "a thread of the daemon has failed";
/// Why the last frames cannot be written.
const NO_RECORD: &str = "no frames are kept: RINGCAT_DEBUG_RING=\"yes\" in /etc/ethercat.conf switches the record on, \
                         from the next start of the service";

/// How a master is driven.
#[derive(Debug)]
pub struct Settings {
    /// Its number.
    pub number: u32,
    /// Its links, as in the option of the daemon.
    pub links: String,
    /// The state of its SubDevices after the end of an application.
    pub safe_state: AlState,
    /// A lock that its owners hold: while one has it from an earlier daemon, this one waits.
    pub lock: Option<OwnerLock>,
    /// Network interfaces of EoE; `None`: none is made.
    pub interfaces: Option<EthernetInterfaces>,
    /// Debug interfaces; `None`: none is made.
    pub debug: Option<DebugTaps>,
    /// Level of messages at the beginning.
    pub debug_level: u32,
    /// Settings, for the daemon and for applications.
    pub bus: BusSettings,
}

impl Settings {
    /// PREOP, without a lock, network interfaces and messages.
    pub fn new(number: u32, links: String) -> Settings {
        let (safe_state, bus) = (AlState::PreOp, BusSettings::default());
        Settings { number, links, safe_state, lock: None, interfaces: None, debug: None, debug_level: 0, bus }
    }
}

/// A master.
#[derive(Debug)]
pub struct Master {
    number: u32,
    links: String,
    safe_state: AlState,
    wires: Mutex<Wires>,
    lock: Mutex<Option<OwnerLock>>,
    driver: Current,
    /// Network interfaces of EoE; `None`: none is to be made.
    interfaces: Option<Arc<EthernetInterfaces>>,
    /// Debug interfaces; `None`: none is to be made.
    debug: Option<DebugTaps>,
    /// What is known of the segment while the daemon does not drive it.
    knowledge: Mutex<Vec<u8>>,
    /// What was printed of the bus.
    lines: Arc<Mutex<Lines>>,
    /// When frames before a fault were written last.
    last_written: LastWritten,
    /// Level of messages, whatever drives the master.
    debug_level: AtomicU32,
    /// Settings, for the daemon and for applications.
    bus: BusSettings,
    others: Others,
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
/// master until the next [`Master::supervise`].
#[derive(Debug)]
#[must_use]
pub struct Tenancy<'a> {
    master: &'a Master,
    opened: Arc<Opened>,
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
            self.master.fail(FAILED);
        }
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Master {
    /// A master with these links, driven by the daemon from now on, without a lock and network interfaces.
    pub fn new(number: u32, links: String, wires: Wires) -> Master {
        Master::start(Settings::new(number, links), wires)
    }

    /// The same with settings. Links that cannot be opened are tried again by [`Master::supervise`].
    pub fn start(settings: Settings, wires: Wires) -> Master {
        let Settings { number, links, safe_state, lock, interfaces, debug, debug_level, bus } = settings;
        let is_shared = wires.are_shared();
        let master = Master {
            number,
            links,
            safe_state,
            wires: Mutex::new(wires),
            lock: Mutex::new(lock),
            driver: Current::default(),
            interfaces: interfaces.map(Arc::new),
            debug,
            knowledge: Mutex::default(),
            lines: Arc::default(),
            last_written: LastWritten::default(),
            debug_level: AtomicU32::new(debug_level),
            bus,
            others: Others::new(number, is_shared),
        };
        master.drive(Handover::Orderly);
        master.prepare();
        master
    }

    /// The end of the daemon: network interfaces last as long as an application has them.
    pub fn end(&self) {
        self.interfaces.iter().for_each(|interfaces| interfaces.end());
        self.debug.iter().for_each(DebugTaps::end);
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

    /// Its number.
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Its links, and what drives it.
    pub fn state(&self) -> MasterState {
        let (owner, fault) = match &*self.driver.lock() {
            Driver::Owner(owner, _) => (Some(owner.owner().clone()), None),
            Driver::Fault(cause) => (None, Some(cause.clone())),
            Driver::Daemon(..) => (None, self.others.cause()),
            Driver::Changing => (None, None),
        };
        let mut state = MasterState::new(self.number, self.links.clone());
        (state.owner, state.fault) = (owner, fault);
        state
    }

    /// Waits until it is known whether another MainDevice drives the segment, if a link has a carrier.
    pub fn listen(&self) {
        self.others.listen();
    }

    /// Answers a query, from the process that drives the master.
    pub fn ask(&self, what: Query, bytes: Vec<u8>) -> Answered {
        let level = match what {
            Query::Tool(ToolQuery::SetDebugLevel { level }) => Some(level),
            _ => None,
        };
        if matches!(what, Query::Tool(ToolQuery::Record)) && !self.bus.debug_ring.is_on {
            return Err(Refusal::Failed(NO_RECORD.to_owned()));
        }
        let mut answered = self.ask_driver(what, bytes);
        if let Ok((Answer::Tool(ToolAnswer::Master(report)), _)) = &mut answered {
            report.is_orphaned = self.opened().is_none_or(|opened| opened.is_without_device());
        }
        // If no process drives the master, the level takes effect as soon as one does.
        if let Some(level) = level.filter(|_| matches!(answered, Ok(_) | Err(Refusal::Fault { .. }))) {
            self.debug_level.store(level, Ordering::Release);
        }
        answered
    }

    fn ask_driver(&self, what: Query, bytes: Vec<u8>) -> Answered {
        let master = self.number;
        // These send no frame: they are permitted with another MainDevice on the segment.
        let sends = !matches!(what, Query::Tool(ToolQuery::SetDebugLevel { .. } | ToolQuery::Record));
        let supervisor = match &*self.driver.lock() {
            Driver::Daemon(driving, opened) => match self.others.cause().filter(|_| sends) {
                Some(cause) => return Err(Refusal::Fault { master, cause }),
                None => Ok((driving.supervisor().clone(), opened.clone())),
            },
            Driver::Owner(owner, _) => Err(owner.clone()),
            Driver::Changing => return Err(Refusal::Changing { master }),
            Driver::Fault(cause) => return Err(Refusal::Fault { master, cause: cause.clone() }),
        };
        let (supervisor, opened) = match supervisor {
            Ok(daemon) => daemon,
            Err(owner) => return owner.ask(what, bytes),
        };
        let answered = serving::answer(&supervisor, what, bytes);
        // A hand-over in between has ended it, also if the daemon has the master again.
        let is_same = || matches!(&*self.driver.lock(), Driver::Daemon(_, now) if Arc::ptr_eq(now, &opened));
        if answered.is_err() && !is_same() {
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
        self.others.permit()?;
        let (driving, opened) = self.driver.take_from_daemon(self.number, CHANGE)?;
        let tenancy = Tenancy { master: self, opened, is_over: false };
        let bytes = driving.hand_over();
        locked(&self.knowledge).clone_from(&bytes);
        self.others.is_ours();
        let sent = self.send_bus(owner, &tenancy.opened, bytes);
        self.driver.set(Driver::Owner(owner.clone(), tenancy.opened.clone()));
        match sent {
            Ok(()) => Ok(tenancy),
            Err(error) => {
                // It may have got them.
                tenancy.end(End::MayGoOn);
                Err(Refusal::Failed(format!("the links cannot be sent: {error}")))
            }
        }
    }

    /// Sends links, lock, network interfaces and what is known of the segment.
    fn send_bus(&self, owner: &OwnerLink, opened: &Opened, knowledge: Vec<u8>) -> std::io::Result<()> {
        let interfaces = match &self.interfaces {
            Some(interfaces) if owner.moves_ethernet() => interfaces.all(),
            Some(interfaces) => {
                interfaces.leave();
                Vec::new()
            }
            None => Vec::new(),
        };
        let debug = self.debug.as_ref().map(|debug| debug.all(opened.links().names().len())).unwrap_or_default();
        let mut lock = locked(&self.lock);
        lock.iter_mut().for_each(|lock| lock.note(owner.owner()));
        let mut handed = HandedBus::new(opened.links().clone());
        handed.has_lock = lock.is_some();
        handed.interfaces = interfaces.iter().map(|(name, _)| name.clone()).collect();
        handed.debug_interfaces = debug.iter().map(|(name, _)| name.clone()).collect();
        handed.can_switch = opened.can_switch();
        handed.settings = self.bus.clone();
        handed.debug_level = self.debug_level.load(Ordering::Acquire);
        let mut raw: Vec<_> = opened.descriptors().iter().map(AsRawFd::as_raw_fd).collect();
        raw.extend(lock.iter().map(OwnerLock::descriptor));
        raw.extend(interfaces.iter().chain(&debug).map(|(_, descriptor)| descriptor.as_raw_fd()));
        owner.connection().send_with(&Message { content: Content::Taken(handed), bytes: knowledge }, &raw)
    }

    /// An owner needs a network interface: its descriptor.
    ///
    /// # Errors
    /// Why there is none.
    pub fn make_interface(&self, name: &str, mac: [u8; 6]) -> Result<TapInterface, String> {
        let interfaces = self.interfaces.as_ref().ok_or_else(|| "ringcatd makes no network interfaces".to_owned())?;
        interfaces.make(name, mac).map_err(|error| error.to_string())
    }

    /// An owner orders a link down or up.
    ///
    /// # Errors
    /// Why it stays as it is.
    pub fn switch_link(&self, is_redundant: bool, up: bool) -> Result<(), String> {
        let opened = self.opened().ok_or_else(|| "nothing drives the master".to_owned())?;
        opened.switch(usize::from(is_redundant), up)
    }

    /// Keeps the knowledge of an owner, in case it crashes. False if it cannot be read and is not kept.
    pub fn keep(&self, knowledge: Vec<u8>) -> bool {
        let is_usable = Knowledge::from_bytes(&knowledge).is_ok();
        if is_usable {
            *locked(&self.knowledge) = knowledge;
        }
        is_usable
    }

    /// From now on the master is not driven, for this reason.
    fn fail(&self, cause: &str) {
        say(format_args!("master {} is not driven: {cause}", self.number));
        let fault = Driver::Fault(cause.to_owned());
        if let Driver::Owner(owner, _) = self.driver.set(fault) {
            owner.end();
            // An owner that has ended gets no message.
            let content = Content::TakenBack { cause: cause.to_owned() };
            let _ = owner.connection().send_within(&content.into(), TELL);
        }
    }

    /// The time of its owner has ended: the daemon drives the master.
    fn take_back(&self, opened: &Opened, end: End) {
        if let Driver::Owner(owner, _) = self.driver.set(Driver::Changing) {
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

    /// Tries again what was not possible before, prepares sockets for the next owner's end, and gives interfaces that
    /// have come back to the process that drives the master.
    pub fn supervise(&self) {
        self.prepare();
        self.leave_alone();
        self.others.tell();
        let is_faulty = matches!(&*self.driver.lock(), Driver::Fault(_));
        if is_faulty {
            self.drive(Handover::AfterCrash);
        }
        for change in self.opened().map(|opened| opened.follow_interfaces()).unwrap_or_default() {
            say(format_args!("master {}: {change}", self.number));
        }
        let changes = match &*self.driver.lock() {
            Driver::Daemon(driving, _) => driving.changes(),
            _ => Vec::new(),
        };
        for change in changes {
            say(format_args!("master {}: {change}", self.number));
        }
    }

    /// An interface that was not named, but chosen, is left alone when the host begins to use it. One that an
    /// application drives stays: a machine may run with it.
    fn leave_alone(&self) {
        if !matches!(&*self.driver.lock(), Driver::Daemon(..)) {
            return;
        }
        let Some(cause) = locked(&self.wires).misfit() else { return };
        let before = {
            let mut driver = self.driver.lock();
            match &*driver {
                Driver::Daemon(..) => {
                    locked(&self.wires).leave();
                    self.others.forget();
                    std::mem::replace(&mut *driver, Driver::Fault(cause.clone()))
                }
                // An application has got it meanwhile.
                Driver::Owner(..) | Driver::Changing | Driver::Fault(_) => return,
            }
        };
        say(format_args!("master {} is not driven: {cause}", self.number));
        if let Driver::Daemon(_, opened) = &before {
            opened.revoke();
        }
    }

    /// The links of the process that drives it; `None` while nothing does.
    fn opened(&self) -> Option<Arc<Opened>> {
        match &*self.driver.lock() {
            Driver::Daemon(_, opened) | Driver::Owner(_, opened) => Some(opened.clone()),
            Driver::Changing | Driver::Fault(_) => None,
        }
    }

    /// Drives the master on fresh links, and goes on with what is known.
    fn drive(&self, handover: Handover) {
        let driver = match self.try_to_drive(handover) {
            Ok((driving, opened)) => Driver::Daemon(driving, opened),
            Err(cause) => {
                if !matches!(&*self.driver.lock(), Driver::Fault(before) if *before == cause) {
                    say(format_args!("master {} is not driven: {cause}", self.number));
                }
                Driver::Fault(cause)
            }
        };
        self.driver.set(driver);
    }

    fn try_to_drive(&self, handover: Handover) -> Result<(Driving, Arc<Opened>), String> {
        // Never beside a process that may still drive it.
        locked(&self.lock).as_mut().map_or(Ok(()), OwnerLock::hold)?;
        let opened = Arc::new(locked(&self.wires).open()?);
        let knowledge = locked(&self.knowledge);
        let (lines, debug_level) = (self.lines.clone(), self.debug_level.load(Ordering::Acquire));
        let (interfaces, debug) = (self.interfaces.clone(), self.debug.as_ref());
        let listened = self.others.listened();
        let (number, settings, last_written) = (self.number, &self.bus, self.last_written.clone());
        let knowledge = &knowledge[..];
        let lasting =
            Lasting { number, knowledge, lines, last_written, debug_level, settings, interfaces, debug, listened };
        let driving = Driving::start(&opened, &lasting, handover)?;
        for absent in opened.absent() {
            say(format_args!("master {}: interface {absent} is not there; the ring goes on without it", self.number));
        }
        Ok((driving, opened))
    }

    /// Brings all SubDevices to the safe state, if the daemon drives the master.
    fn lead_to_safe_state(&self) {
        if let Driver::Daemon(driving, _) = &*self.driver.lock() {
            driving.lead_to(self.safe_state, self.number);
        }
    }
}

#[cfg(test)]
mod tests;
