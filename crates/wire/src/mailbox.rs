//! Mailbox messages (facts 6.1, 6.3).
//!
//! [`Header`] stands before every message, [`Message`] is header and payload together; [`ErrorReply`] is the payload of
//! protocol 0. [`coe`] and [`sdo`] read and write CoE. Who sends what when, counters and repeats are the engine's
//! matter.

pub mod coe;
mod error_reply;
mod header;
pub mod sdo;

pub use error_reply::ErrorReply;
pub use header::{Header, MAX_COUNTER, Message, MessageError, Protocol, next_counter};
