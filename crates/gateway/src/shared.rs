//! Data shared by the thread of the sockets and the engine's thread.

use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{SyncSender, TrySendError};
use std::sync::{Mutex, PoisonError};
use std::task::Waker;

use ringcat_engine::mail::relay::RelayCounters;

/// Counters of the gateway.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct GatewayCounters {
    /// Accepted connections.
    pub connections: u64,
    /// Connections that the gateway closed because of a fault of the client.
    pub ended: u64,
    /// Datagrams and messages that were dropped because a queue was full.
    pub dropped: u64,
    /// Counters of the messages.
    pub relay: RelayCounters,
}

/// Shared by the thread of the sockets and the rest of the program.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    pub ended: AtomicBool,
    pub counters: Mutex<GatewayCounters>,
}

impl Shared {
    pub fn count(&self, change: impl FnOnce(&mut GatewayCounters)) {
        change(&mut self.counters.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// For the engine.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum FromClient {
    /// A message with its EtherCAT header.
    Message(u64, Vec<u8>),
    /// The connection of the client has ended.
    Gone(u64),
}

/// The queue to the engine's thread.
#[derive(Debug)]
pub(crate) struct ToEngine {
    pub queue: SyncSender<FromClient>,
    /// Wakes that thread.
    pub waker: Waker,
}

impl ToEngine {
    /// Hands a message over and wakes the thread.
    pub fn try_send(&self, message: FromClient) -> Result<(), TrySendError<FromClient>> {
        self.queue.try_send(message)?;
        self.waker.wake_by_ref();
        Ok(())
    }
}
