//! Procedures: async functions, each the whole story of a job, one file per job.
//!
//! They see the bus through [`crate::supervisor::Bus`] and time through nothing else.

pub mod al_state;
pub mod configure;
pub mod fleet;
pub mod inspect;
mod junction;
pub mod mail_watch;
pub mod recover;
pub(crate) mod request_state;
pub mod scan;
pub mod serve_requests;
pub mod services;
pub mod sii;
pub mod stop;
pub mod strangers;
pub mod supervise;
mod verify;
pub mod visit;
