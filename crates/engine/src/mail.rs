//! Mailboxes: one router per SubDevice, and the protocols that share it (protocol 6, decision 0007).
//!
//! A [`Mailbox`] is the handle to a SubDevice's router. Each protocol has a [`Lane`]; a procedure that exchanges
//! messages holds the lane as a [`Conversation`]. A request is written with the next counter, and a received mail is
//! delivered to its lane. All lanes work in parallel. Unsolicited mail (emergencies, Ethernet frames, notifications) is
//! kept in bounded queues. The parts:
//!
//! * `emergencies`: a ring per SubDevice, for any thread;
//! * `writer`, `reader`: the two directions, each a task that lives as long as it has work;
//! * `delivery`: assigns mail to its lane; `recent`: detects duplicate mail;
//! * `handover`: a mailbox in use goes on in another process;
//! * `conversation`: holds a lane, sends and waits for answers; `answer_time`: when to poll for an answer;
//! * [`coe`], [`eoe`], [`foe`], [`soe`], [`aoe`], [`voe`]: the protocols; [`relay`]: messages of gateway clients;
//!   [`raw`]: messages that the application composes.

mod answer_time;
pub mod aoe;
mod bounded_queue;
pub mod coe;
mod conversation;
mod counters;
mod delivery;
mod emergencies;
pub mod eoe;
mod error;
pub mod foe;
mod handover;
mod lane;
mod lanes;
mod mailbox;
mod protocol_error;
pub mod raw;
mod reader;
mod recent;
pub mod relay;
mod shared;
pub mod soe;
pub mod stream;
mod unsolicited;
pub mod voe;
mod writer;

#[cfg(test)]
mod tests;

pub use conversation::{Conversation, Limits, MailboxSizes};
pub use counters::MailCounters;
pub(crate) use emergencies::EmergencyRings;
pub use emergencies::{EmergencyRing, ReceivedEmergency};
pub use error::MailboxError;
pub(crate) use handover::InUse;
pub use lane::Lane;
pub use mailbox::Mailbox;
pub use unsolicited::{Unclaimed, Unsolicited};
