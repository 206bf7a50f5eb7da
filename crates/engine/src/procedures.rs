//! Procedures: async functions, each the whole story of a job, one file per job.
//!
//! They see the bus through [`crate::supervisor::Bus`] and time through nothing else.

pub mod al_state;
mod cabling;
pub mod clocks;
pub mod configure;
pub mod dictionary;
mod error_watch;
pub mod fleet;
mod frame_limit;
pub mod inspect;
pub(crate) mod junction;
mod latch;
pub mod look_at_ring;
pub mod mail_watch;
pub(crate) mod own_objects;
pub(crate) mod presence;
pub mod recover;
pub(crate) mod request_state;
mod ring_watch;
pub mod scan;
pub mod serve_requests;
pub mod services;
pub mod sii;
pub mod stop;
pub mod strangers;
pub mod supervise;
mod verify;
pub mod visit;
pub(crate) mod watch_groups;
