//! Passes mailbox messages of gateway clients to SubDevices through the mailboxes of the MainDevice (protocol 10.1).
//!
//! A [`GatewayQueue`] takes whole messages and returns answers, with the address and the counter of the client; towards
//! the SubDevice the router uses its own counter. A message waits for the lane of its protocol like any procedure, so
//! it disturbs no other transfer. While a transfer of a client is in progress (`dialogue` tracks it), the lane is
//! reserved for this client, for a limited time. If the client pauses too long, disconnects, or blocks other clients
//! for too long, the transfer ends, and the SubDevice receives an abort. All queues are bounded, and clients take
//! turns.

mod dialogue;
mod gateway_queue;

pub use gateway_queue::{GatewayQueue, OwnAnswer, Recipient, RelayCounters, Relayed};
