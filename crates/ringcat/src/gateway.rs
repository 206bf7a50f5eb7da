//! The mailbox gateway: programs on this host or in the network talk to SubDevices through our mailboxes (facts 10.1,
//! ETG.8200), over UDP and TCP at once.
//!
//! A thread of its own serves the sockets; messages pass to the supervisor's thread and answers back through bounded
//! queues. What may pass, and who has his turn, is decided in the engine ([`ringcat_engine::mail::relay`]). Here a client
//! that does not read its answers, leaves a message unfinished or sends what is no message loses its connection, and
//! nobody else notices.
//!
//! Whoever reaches the port may change SubDevices: there is no password in the protocol. So nobody listens unless that is
//! asked for, and then only on this host unless another address is named.

mod connection;
mod server;

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use mio::Waker;
use ringcat_engine::mail::relay::{RelayCounters, Relayed};
use ringcat_engine::main_device::MainDevice as Engine;
use ringcat_wire::mailbox::gateway::PORT;

use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;
use server::Server;

/// Messages on their way to the supervisor's thread.
const MESSAGES: usize = 256;
/// Answers on their way back.
const ANSWERS: usize = 1024;
/// Messages that the supervisor's thread takes in one go.
const TURN: usize = 64;

/// Where the gateway listens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatewayOptions {
    /// Address and port, of UDP and TCP; port 0 is any that is free.
    pub address: SocketAddr,
    /// TCP connections at a time.
    pub connections: usize,
}

impl Default for GatewayOptions {
    /// This host only, the port of ETG.8200, 32 connections.
    fn default() -> GatewayOptions {
        GatewayOptions { address: SocketAddr::from((Ipv4Addr::LOCALHOST, PORT)), connections: 32 }
    }
}

/// What the gateway has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GatewayCounters {
    /// Connections that were made.
    pub connections: u64,
    /// Connections that were ended because of what their client did or did not.
    pub ended: u64,
    /// Datagrams and messages that were dropped because too many came at once.
    pub dropped: u64,
    /// What became of the messages.
    pub relay: RelayCounters,
}

#[derive(Debug, Default)]
struct Shared {
    ended: AtomicBool,
    counters: Mutex<GatewayCounters>,
}

impl Shared {
    fn count(&self, change: impl FnOnce(&mut GatewayCounters)) {
        change(&mut self.counters.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// For the supervisor's thread.
enum FromClient {
    /// A message with its EtherCAT header.
    Message(u64, Vec<u8>),
    /// The client has gone.
    Gone(u64),
}

/// The gateway; it ends when this is dropped.
#[derive(Debug)]
pub struct Gateway {
    shared: Arc<Shared>,
    waker: Arc<Waker>,
    address: SocketAddr,
    thread: Option<JoinHandle<()>>,
}

impl Gateway {
    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What it has done.
    pub fn counters(&self) -> GatewayCounters {
        *self.shared.counters.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Relaxed);
        // One that cannot be woken looks by itself.
        let _ = self.waker.wake();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been told by the panic handler.
            let _ = thread.join();
        }
    }
}

impl SupervisorThread {
    /// Opens the mailbox gateway. SubDevices answer from activation on.
    ///
    /// # Errors
    /// The address cannot be listened on, or the thread is gone.
    pub fn start_gateway(&self, options: GatewayOptions) -> Result<Gateway, Error> {
        let (to_engine, incoming) = sync_channel(MESSAGES);
        let (outgoing, answers) = sync_channel(ANSWERS);
        let shared = Arc::new(Shared::default());
        let failed = |cause| Error::Gateway { address: options.address, cause };
        let (server, waker, address) = Server::open(options, to_engine, answers, shared.clone()).map_err(failed)?;
        let mut passage = Passage { incoming, outgoing, waker: waker.clone(), shared: shared.clone() };
        self.attend(move |engine, _| passage.work(engine))?;
        let thread = std::thread::Builder::new().name("gateway".into()).spawn(move || server.run());
        let thread = Some(thread.map_err(Error::Thread)?);
        Ok(Gateway { shared, waker, address, thread })
    }
}

/// Runs in the supervisor's thread.
struct Passage {
    incoming: Receiver<FromClient>,
    outgoing: SyncSender<Relayed>,
    waker: Arc<Waker>,
    shared: Arc<Shared>,
}

impl Passage {
    /// Passes messages on; true when the gateway has gone.
    fn work(&mut self, engine: &mut Engine) -> bool {
        let mut any = false;
        for _ in 0..TURN {
            match self.incoming.try_recv() {
                Ok(FromClient::Message(client, bytes)) => engine.relay(client, &bytes),
                Ok(FromClient::Gone(client)) => engine.forget_client(client),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return true,
            }
            any = true;
        }
        while let Some(answer) = engine.pop_relayed() {
            any = true;
            if self.outgoing.try_send(answer).is_err() {
                self.shared.count(|counters| counters.dropped += 1);
            }
        }
        if any {
            let relay = engine.relay_counters();
            self.shared.count(|counters| counters.relay = relay);
            // One that cannot be woken looks by itself.
            let _ = self.waker.wake();
        }
        false
    }
}
