//! The thread that answers clients of remote access.
//!
//! It works once in each of its cycles, on each connection for one query at most: the time for clients is bounded, and
//! so is their memory.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle, park_timeout};
use std::time::{Duration, Instant};

use ringcat_control::remote::{RemoteAnswer, RemoteCounters, RemoteQuery, RemoteRole, RemoteState};
use ringcat_engine::RingState;
use ringcat_engine::main_device::{MainDeviceRole, SubDeviceState};
use ringcat_engine::role::{RoleControl, RoleRequest};

use super::connection::Connection;
use super::token::RemoteToken;
use crate::error::Error;
use crate::standby::Diagnosis;
use crate::supervisor_thread::SupervisorThread;

/// Stack of the thread.
const STACK_BYTES: usize = 256 << 10;
/// Shortest cycle.
const SHORTEST: Duration = Duration::from_millis(1);
/// Longest one.
const LONGEST: Duration = Duration::from_secs(1);

/// How clients are answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RemoteOptions {
    /// Period at which clients are answered, 10 ms by default, 1 ms to 1 s: the delay of an answer, and the load.
    pub cycle: Duration,
    /// Largest number of clients, 8 by default. A further one replaces the oldest one that has not sent the token; if
    /// all have sent it, the further one is disconnected.
    pub clients: usize,
    /// A client that sends no query for this time is disconnected, 60 s by default.
    pub silence: Duration,
}

impl Default for RemoteOptions {
    fn default() -> RemoteOptions {
        RemoteOptions { cycle: Duration::from_millis(10), clients: 8, silence: Duration::from_secs(60) }
    }
}

impl RemoteOptions {
    /// Sets [`RemoteOptions::cycle`].
    #[must_use]
    pub const fn with_cycle(mut self, cycle: Duration) -> RemoteOptions {
        self.cycle = cycle;
        self
    }

    /// Sets [`RemoteOptions::clients`].
    #[must_use]
    pub const fn with_clients(mut self, clients: usize) -> RemoteOptions {
        self.clients = clients;
        self
    }

    /// Sets [`RemoteOptions::silence`].
    #[must_use]
    pub const fn with_silence(mut self, silence: Duration) -> RemoteOptions {
        self.silence = silence;
        self
    }
}

/// The server. It ends when this is dropped.
#[derive(Debug)]
pub struct RemoteServer {
    address: SocketAddr,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl RemoteServer {
    /// Answers the clients of a listener about the MainDevice of a thread, which goes on as long as the server does.
    ///
    /// # Errors
    /// The listener does not work, the thread of the MainDevice has ended, or no thread can be started.
    pub fn start(
        listener: TcpListener,
        token: RemoteToken,
        options: RemoteOptions,
        supervisor: SupervisorThread,
    ) -> Result<RemoteServer, Error> {
        let control = supervisor.role_control()?;
        let prepared = listener.set_nonblocking(true).and_then(|()| listener.local_addr());
        let (address, ended) = (prepared.map_err(Error::Thread)?, Arc::new(AtomicBool::new(false)));
        let shared = ended.clone();
        let body = move || {
            let served = Served { supervisor, control };
            let mut clients = Clients { listener, token, options, connections: Vec::new() };
            while !shared.load(Ordering::Relaxed) {
                clients.work(&served);
                park_timeout(options.cycle.clamp(SHORTEST, LONGEST));
            }
        };
        let thread = Builder::new().name("remote".into()).stack_size(STACK_BYTES).spawn(body).map_err(Error::Thread)?;
        Ok(RemoteServer { address, ended, thread: Some(thread) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for RemoteServer {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // The panic handler has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}

/// The connections.
struct Clients {
    listener: TcpListener,
    token: RemoteToken,
    options: RemoteOptions,
    /// The oldest first.
    connections: Vec<Connection>,
}

impl Clients {
    /// One cycle.
    fn work(&mut self, served: &Served) {
        let now = Instant::now();
        self.accept(now);
        let token = &self.token;
        self.connections.retain_mut(|connection| connection.work(token, now, |query| served.answer(&query)));
    }

    fn accept(&mut self, now: Instant) {
        for _ in 0..self.options.clients {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                // None, or one that has ended already.
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return,
                Err(_) => continue,
            };
            if self.connections.len() >= self.options.clients {
                let Some(unknown) = self.connections.iter().position(|it| !it.is_admitted()) else { continue };
                self.connections.remove(unknown);
            }
            // One that fails has ended already.
            self.connections.extend(Connection::new(stream, self.options.silence, now));
        }
    }
}

/// The MainDevice.
struct Served {
    supervisor: SupervisorThread,
    control: RoleControl,
}

impl Served {
    fn answer(&self, query: &RemoteQuery) -> RemoteAnswer {
        match query {
            RemoteQuery::State => match self.state() {
                Ok(state) => RemoteAnswer::State(Box::new(state)),
                Err(error) => RemoteAnswer::Refused(error.to_string()),
            },
            RemoteQuery::Request { role, force } => {
                let request = match role {
                    RemoteRole::Active => RoleRequest::Active,
                    RemoteRole::Inactive => RoleRequest::Inactive,
                    RemoteRole::HandOver => RoleRequest::HandOver,
                    _ => return RemoteAnswer::Refused("a role of a later version".to_owned()),
                };
                self.request(request, *force)
            }
            RemoteQuery::Hold { held, force } => {
                match held {
                    // If a write keeps the role, permanent standby does not begin either.
                    true => self.control.request_hold(*force),
                    false => self.control.hold(false),
                }
                RemoteAnswer::Done
            }
            _ => RemoteAnswer::Refused("no query of this version".to_owned()),
        }
    }

    fn request(&self, request: RoleRequest, force: bool) -> RemoteAnswer {
        match force {
            true => self.control.force(request),
            false => self.control.request(request),
        }
        RemoteAnswer::Done
    }

    fn state(&self) -> Result<RemoteState, Error> {
        let (supervisor, control) = (&self.supervisor, &self.control);
        let ring = supervisor.ring_status();
        let mut state = RemoteState::default();
        state.is_active = control.role() == MainDeviceRole::Active;
        state.is_held = control.is_held();
        state.not_ready = control.readiness().reasons().map(str::to_owned).collect();
        state.role_changes = control.changes();
        state.ring = in_words(ring.state).to_owned();
        state.carriers = ring.links.map(|link| link.carrier);
        state.subdevices = supervisor.states().into_iter().map(word).collect();
        if let Some(observer) = supervisor.observer() {
            let cyclic = observer.cyclic_status();
            let (counters, forwarded) = (cyclic.counters(), cyclic.forwarded());
            state.has_application = true;
            state.cycles = cyclic.pace().cycles;
            state.counters = RemoteCounters::new(counters.sent, counters.lost, counters.incomplete, counters.foreign);
            state.forwarded = [forwarded.on_main, forwarded.on_redundant];
            state.sent_back = forwarded.sent_back;
            state.not_forwarded = forwarded.not_forwarded();
        }
        if !state.is_active {
            state.of_active = supervisor.partner_diagnosis()?.map(|diagnosis| {
                let Diagnosis { sent, lost, incomplete, foreign, .. } = diagnosis.counters;
                RemoteCounters::new(sent, lost, incomplete, foreign)
            });
        }
        Ok(state)
    }
}

fn in_words(ring: RingState) -> &'static str {
    match ring {
        RingState::Closed => "closed",
        RingState::Open => "open",
        RingState::Unknown => "unknown",
    }
}

fn word(state: SubDeviceState) -> String {
    match state {
        SubDeviceState::Absent => "absent".to_owned(),
        SubDeviceState::Configuring => "configuring".to_owned(),
        SubDeviceState::Settled(state) => state.to_string(),
        _ => "unknown".to_owned(),
    }
}
