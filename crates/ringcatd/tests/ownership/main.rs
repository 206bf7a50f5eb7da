//! Which process drives a segment: hand-overs between the daemon and real processes, on simulated segments, without a
//! privilege.
//!
//! The segment is simulated in a thread of the test, which looks into its SubDevices; the daemon is in the test's
//! process, the owners that are killed or stopped are processes of their own.

mod application;
mod bench;
mod clients;
mod ends;
mod handover;
mod hostile;
mod install;
mod lines;
mod locks;
mod outputs;
mod owner_process;
mod packaging;
mod program;
mod running;
mod service;
mod users;
mod versions;
