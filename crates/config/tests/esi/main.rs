//! Device descriptions (protocol 12): one file, `../files/acme.xml`, variants of it, generated bad files, and real
//! files if they are beside the repository.

mod bad_files;
mod bounds;
mod commands;
mod differences;
mod editions;
mod images;
mod names;
mod reading;
mod real_files;
mod select;
mod skeletons;
mod slots;

/// A coupler, a terminal without mailbox, one with CoE and a dictionary, a modular drive.
pub const ACME: &str = include_str!("../files/acme.xml");
