//! SubDevices without a declaration: all of them while no application is active, otherwise those that its declaration
//! does not name. Each has a mailbox and a requested state, PREOP unless another one is requested.

mod bring;
mod keep;
mod mail;
mod registry;
mod request;

pub(crate) use bring::{keep_outputs, unmap};
pub(crate) use keep::{follow_unassigned, keep, report_left, run_due, without_declaration};
pub(crate) use mail::watch_undeclared_mail;
pub(crate) use registry::handover::Kept;
pub use registry::{Retries, Undeclared};
pub(crate) use request::request;
