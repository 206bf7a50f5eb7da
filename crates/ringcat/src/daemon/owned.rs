//! A bus that a daemon has handed over to this process.
//!
//! A thread receives the messages of the daemon ([`Receiver`]): queries of its clients, and the end of the
//! connection. It sends the daemon what is known of the segment after each scan, so that no scan is necessary after a
//! crash of this process.

use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat_control::client::Client;
use ringcat_control::connection::Connection;
use ringcat_control::message::{Content, HandedLinks, Message};
use ringcat_control::settings::BusSettings;
use ringcat_engine::Scan;
use ringcat_engine::event::{LogFilter, LogLevel, Subject, Subjects};
use ringcat_engine::knowledge::{Handover, Knowledge};
use ringcat_link::Taps;

use super::debug_interfaces::{DebugFeed, DebugInterfaces};
use super::error::DaemonError;
use super::ethernet::Ethernet;
use super::links::DaemonLinks;
use super::orders::Orders;
use super::ownership::{Ownership, OwnershipWatch};
use super::query_threads::QueryThreads;
use super::received::Received;
use super::receiver::Receiver;
use super::settings::options_with;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::Options;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;

/// The daemon answers to a release within this time, unless it is stopped.
const RELEASE: Duration = Duration::from_secs(2);
/// Interval of checks for its answer.
const PAUSE: Duration = Duration::from_micros(200);
/// Events of scans that are kept between two checks: one is enough to show that there were any.
const KEPT: usize = 1;

/// A bus that a daemon has handed over. It is given back by [`OwnedBus::release`], or when this is dropped.
#[derive(Debug)]
pub struct OwnedBus {
    supervisor: SupervisorThread,
    pub(super) scan: Option<Scan>,
    handed: HandedLinks,
    settings: BusSettings,
    /// A daemon that is started anew detects by it that this process has the bus.
    _lock: Option<OwnedFd>,
    links: Option<DaemonLinks>,
    _ethernet: Ethernet,
    connection: Arc<Connection>,
    ownership: OwnershipWatch,
    receiver: Option<JoinHandle<()>>,
    /// A child of `fork` has no threads of this: it gives nothing back.
    process: u32,
    taps: Option<Taps>,
    /// Passes frames on to debug interfaces.
    feed: Option<DebugFeed>,
}

impl OwnedBus {
    /// Takes the bus of a master from the daemon at this socket. `program` is the name with which the daemon names this
    /// process to others; `prepare` runs first in each thread: that of the acyclic half, and those for
    /// queries of the daemon. Returns when the SubDevices were found in the knowledge of the daemon; no SII is read.
    ///
    /// # Errors
    /// [`DaemonError::is_no_daemon`]: none answers. The daemon refuses: there is no such master, another process drives
    /// it, or this user may not. No SubDevice answers is no error: the MainDevice waits for some.
    pub fn take(
        socket: &Path,
        master: u32,
        program: &str,
        options: &Options,
        prepare: impl Fn() + Clone + Send + 'static,
    ) -> Result<OwnedBus, DaemonError> {
        OwnedBus::take_with(socket, master, program, options, prepare, |_, links| Ok(links))
    }

    /// As [`OwnedBus::take`], with something around the links of the acyclic half, such as a [`Tee`](crate::tee::Tee).
    /// `around` also gets what the links are, and comes before the first frame.
    ///
    /// # Errors
    /// As [`OwnedBus::take`]; that of `around`.
    pub fn take_with<L: Links + Send + 'static>(
        socket: &Path,
        master: u32,
        program: &str,
        options: &Options,
        prepare: impl Fn() + Clone + Send + 'static,
        around: impl FnOnce(&HandedLinks, DaemonLinks) -> Result<L, DaemonError>,
    ) -> Result<OwnedBus, DaemonError> {
        // Whatever the daemon does: an application that drives the bus is not taken down because its messages wait.
        let connection = Arc::new(Client::connect(socket, program)?.into_connection().patient());
        let orders = Orders::new()?;
        let received = Received::take(&connection, master, &orders)?;
        let Received { bus: handed, cyclic, acyclic, lock, interfaces, debug_interfaces, taps, knowledge } = received;
        let (in_threads, main) = (prepare.clone(), acyclic.addresses().main);
        let acyclic = around(&handed.links, acyclic)?;
        let (options, is_known) = (options_with(&handed.settings, options), knowledge.is_some());
        let options = options.with_idle_operation(true);
        let supervisor = start(acyclic, &options, knowledge, prepare)?;
        supervisor.set_log_filter(LogFilter::new(LogLevel::from_number(handed.debug_level)))?;
        let ethernet = Ethernet::start(&supervisor, (master, main), interfaces, &orders)?;
        let scans = Subjects::NONE.with(Subject::Scan).with(Subject::Cabling);
        let events = supervisor.register_client(scans, KEPT)?;
        // A segment that does not answer any more is watched as any other.
        let scan = if is_known { supervisor.finish_scan(|| ()).ok() } else { None };
        let queries = QueryThreads::start(&supervisor, &connection, &in_threads).map_err(Error::Thread)?;
        let (ownership, links, settings) = (OwnershipWatch::default(), handed.links, handed.settings);
        let receiver = Receiver {
            supervisor: supervisor.clone(),
            connection: connection.clone(),
            ownership: ownership.clone(),
            queries,
            orders,
            ethernet: ethernet.clone(),
            events,
        };
        let feed = DebugFeed::of(taps.as_ref(), debug_interfaces, in_threads.clone());
        let feed = feed.map_err(Error::Thread)?;
        let receiver = receiver.start(in_threads).map_err(Error::Thread)?;
        let (cyclic, receiver, process) = (Some(cyclic), Some(receiver), std::process::id());
        let (handed, links, _lock, _ethernet) = (links, cyclic, lock, ethernet);
        let bus = OwnedBus {
            supervisor,
            scan,
            handed,
            settings,
            _lock,
            links,
            _ethernet,
            connection,
            ownership,
            receiver,
            process,
            taps,
            feed,
        };
        Ok(bus)
    }

    /// The acyclic half. It has the SubDevices in the knowledge of the daemon.
    pub fn supervisor(&self) -> &SupervisorThread {
        &self.supervisor
    }

    /// What the links are: interfaces with their names, or pipes to a simulated segment.
    pub fn handed(&self) -> &HandedLinks {
        &self.handed
    }

    /// Settings of the master, which the daemon has from its configuration. Those that are options of a MainDevice have
    /// priority over the options of this program.
    pub fn settings(&self) -> &BusSettings {
        &self.settings
    }

    /// Taps of both halves. There are some if the settings require a record ([`FrameRecord`](super::FrameRecord)), and
    /// if there are debug interfaces.
    pub fn taps(&self) -> Option<&Taps> {
        self.taps.as_ref()
    }

    /// Takes the debug interfaces, for a bus log that reads the taps ([`Followed`](super::Followed)). Until then a
    /// thread of this bus passes frames on to them, which is the only reader of the taps while an interface is up.
    pub fn take_debug_interfaces(&mut self) -> Option<DebugInterfaces> {
        self.feed.take().and_then(DebugFeed::end)
    }

    /// Takes the links of the cyclic half, for an activation.
    pub fn take_links(&mut self) -> Option<DaemonLinks> {
        self.links.take()
    }

    /// Gives the links of the cyclic half back after the end of an application.
    pub fn give_links_back(&mut self, links: DaemonLinks) {
        self.links = Some(links);
    }

    /// Whether this process still has the bus: a loss without a release shows here, for any thread.
    pub fn ownership(&self) -> &OwnershipWatch {
        &self.ownership
    }

    /// Gives the bus back, and waits until the daemon has it. An active application is to be ended before; otherwise
    /// its outputs last until the daemon has its SubDevices in PREOP.
    ///
    /// # Errors
    /// The daemon has ended, has taken the bus back already, or has not answered for 2 s. It has the bus when it goes
    /// on.
    pub fn release(mut self) -> Result<(), DaemonError> {
        self.give_back()
    }

    fn give_back(&mut self) -> Result<(), DaemonError> {
        let Some(receiver) = self.receiver.take() else { return Ok(()) };
        self.feed = None;
        if std::process::id() != self.process {
            // A child of `fork`: its parent has the bus, and the threads are not in this process.
            std::mem::forget(receiver);
            return Ok(());
        }
        // The thread of the acyclic half may have ended already.
        let bytes = match self.supervisor.hand_over() {
            Ok(Some(knowledge)) => knowledge.to_bytes(),
            Ok(None) | Err(_) => Vec::new(),
        };
        self.links = None;
        let before = self.ownership.release();
        let begin = Instant::now();
        let sent = self.connection.send_within(&Message { content: Content::Release, bytes }, RELEASE);
        while !receiver.is_finished() && sent.is_ok() && begin.elapsed() < RELEASE {
            std::thread::sleep(PAUSE);
        }
        let is_answered = receiver.is_finished();
        // A daemon that is stopped finds the end of the connection when it goes on. All threads end by it.
        self.connection.shut_down();
        // The panic handler has reported its panic.
        let _ = receiver.join();
        match before {
            Ownership::TakenBack => Err(DaemonError::TakenBack { cause: self.ownership.cause().to_owned() }),
            Ownership::Held if sent.is_ok() && is_answered => Ok(()),
            _ => Err(DaemonError::Lost),
        }
    }
}

/// Starts the acyclic half, and goes on with what is known.
fn start<L: Links + Send + 'static>(
    links: L,
    options: &Options,
    knowledge: Option<Knowledge>,
    prepare: impl FnOnce() + Send + 'static,
) -> Result<SupervisorThread, Error> {
    match knowledge {
        Some(knowledge) => SupervisorThread::start_resumed(links, options, (knowledge, Handover::Orderly), prepare),
        None => SupervisorThread::start(links, options, prepare),
    }
}

impl Drop for OwnedBus {
    fn drop(&mut self) {
        // The daemon takes the bus back at the end of the connection, too.
        let _ = self.give_back();
    }
}
