//! Mailboxes: one router per SubDevice, and the protocols that share it (protocol 6, decision 0007).
//!
//! A [`Mailbox`] is the handle to a SubDevice's router. Procedures take a [`Lane`] of it, one per protocol, and talk: a
//! request goes out with the next counter, what comes back goes to the lane to which it belongs. All lanes run side by
//! side. What nobody asked for (emergencies, Ethernet frames, notifications) is kept in bounded rings. The parts:
//!
//! * `writer`, `reader`: the two directions, each a task that lives as long as it has something to do;
//! * `delivery`: whose a mail is; `recent`: mail that came twice;
//! * `talk`: a lane while somebody has it; `answer_time`: when to look for an answer;
//! * [`coe`], [`eoe`], [`foe`], [`soe`], [`aoe`], [`voe`]: the protocols; [`relay`]: messages of others; [`raw`]: those
//!   of the application's own making.

mod answer_time;
pub mod aoe;
pub mod coe;
mod counters;
mod delivery;
pub mod eoe;
mod error;
pub mod foe;
mod lane;
mod mailbox;
mod protocol_error;
pub mod raw;
mod reader;
mod recent;
pub mod relay;
mod ring;
mod room;
pub mod soe;
pub mod stream;
mod talk;
mod unsolicited;
pub mod voe;
mod writer;

#[cfg(test)]
mod tests;

pub use counters::MailCounters;
pub use error::MailboxError;
pub use lane::Lane;
pub use mailbox::Mailbox;
pub use talk::{Limits, Talk};
pub use unsolicited::{Unclaimed, Unsolicited};
