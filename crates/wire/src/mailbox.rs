//! Mailbox messages (protocol 6, 10.1).
//!
//! [`Header`] precedes every message, [`Message`] is header and payload together; [`ErrorReply`] is the payload of
//! protocol 0. One module per protocol reads and writes the others: [`coe`] with [`sdo`], [`foe`], [`eoe`], [`soe`],
//! [`aoe`], [`voe`]; [`gateway`] is a message in UDP or TCP. Sequences, counters, repetitions and the reassembly of
//! fragments are handled by MainDevice and SubDevice.

pub mod aoe;
pub mod coe;
pub mod eoe;
mod error_reply;
pub mod foe;
pub mod gateway;
mod header;
mod payload;
pub mod sdo;
pub mod soe;
pub mod voe;

pub use error_reply::ErrorReply;
pub use header::{Header, MAX_COUNTER, Message, MessageError, Protocol, next_counter};
pub use payload::PayloadError;
