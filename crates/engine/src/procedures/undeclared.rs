//! SubDevices without a declaration: all of them while no application is active, otherwise those that its declaration
//! does not name. The model (`segment::upkeep`) has their requested states and attempts.

mod attempt;
mod bring;
mod dictionaries;
mod keep;
mod mail;
mod mailboxes;
mod request;

pub(super) use attempt::bring_undeclared;
pub(super) use bring::{keep_outputs, read_pdos, unmap};
pub(super) use dictionaries::read_dictionaries;
pub(super) use keep::{keep, settle};
pub(super) use mail::watch_undeclared_mail;
pub(crate) use mailboxes::UndeclaredMailboxes;
pub(crate) use request::{request, until_decided};
