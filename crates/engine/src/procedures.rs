//! Procedures: async functions, each with all steps of a job, one file per job.
//!
//! They access the bus and the time only through [`crate::supervisor::Bus`].

pub mod al_state;
mod assign_pdos;
mod attempt_results;
pub(crate) mod cabling;
pub mod clocks;
pub(crate) mod command_watch;
pub(crate) mod complete_siis;
pub mod configure;
pub(crate) mod data_words;
pub(crate) mod deactivate;
pub(crate) mod dictionary;
pub(crate) mod error_statistics;
pub(crate) mod error_watch;
mod frame_limit;
pub(crate) mod idle;
pub mod inspect;
pub mod inspect_ring;
pub(crate) mod junction;
mod latch;
pub(crate) mod loops;
pub mod mail_watch;
#[cfg(feature = "standby")]
pub(crate) mod mirror;
pub(crate) mod own_objects;
mod presence;
mod read_again;
mod read_state;
pub(crate) mod reconcile;
pub mod recover;
pub(crate) mod request_state;
pub mod request_states;
pub(crate) mod resume;
pub(crate) mod sample;
pub mod scan;
pub mod serve_requests;
pub mod services;
pub(crate) mod shared_segment;
pub mod sii;
pub mod stop;
pub mod supervise;
pub mod unassigned;
pub(crate) mod undeclared;
pub(crate) mod verify;
pub mod visit;
