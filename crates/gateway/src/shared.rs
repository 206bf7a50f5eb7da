//! What passes between the thread of the sockets and the engine's thread.

use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};

use ringcat_engine::mail::relay::RelayCounters;

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

/// What the thread of the sockets and the rest of the program share.
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
    /// The client has gone.
    Gone(u64),
}
