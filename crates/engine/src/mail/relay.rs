//! Mailbox messages of somebody else: clients of a gateway talk to SubDevices through our mailboxes (protocol 10.1).
//!
//! A [`Desk`] takes whole messages and gives out answers, with the address and the counter that the client used;
//! towards the SubDevice the router counts for itself. A message waits for the lane of its protocol like any procedure
//! of ours, so it disturbs nobody's transfer; while a transfer of its client is under way (`dialogue` knows) the lane
//! stays with that client, for a while: one that pauses too long, leaves, or keeps others waiting loses its transfer,
//! and the SubDevice is told so. All queues are bounded, and clients take turns.

mod desk;
mod dialogue;

pub use desk::{Asked, Desk, OwnAnswer, RelayCounters, Relayed};
