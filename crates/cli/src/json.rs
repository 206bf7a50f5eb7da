//! What `--json` prints, as types: one file per command, and the values that commands share.
//!
//! The documentation of the keys, `docs/json.md`, is made from the comments of these types; `keys.rs` checks it. A
//! change of a key or of its meaning raises [`line::SCHEMA_VERSION`] as `docs/json.md` says.

pub mod bench;
pub mod capture;
pub mod clocks;
pub mod data;
pub mod demo;
#[cfg(feature = "standby")]
pub mod demo_standby;
pub mod doctor;
pub mod eni;
pub mod esi;
#[cfg(all(test, feature = "standby"))]
mod keys;
pub mod line;
pub mod network;
#[cfg(feature = "standby")]
pub mod remote;
pub mod ring;
pub mod run;
pub mod scan;
pub mod sii;
pub mod sim;
#[cfg(feature = "standby")]
pub mod standby;
pub mod values;
