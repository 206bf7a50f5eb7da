//! The EtherCAT MainDevice as a pure machine: frames, time and requests go in; frames, deadlines and events come out.
//!
//! No socket, thread, clock or log sink is in here; `now` is always an argument. So the same code runs on a network
//! interface in a real-time thread and in a test with a thousand SubDevices in virtual time.
//!
//! Two halves share nothing but the wire, a few atomics ([`board`]) and a bounded queue ([`queue`]):
//!
//! * [`exchange`]: the cyclic half. Process data and one supervision datagram. After activation it neither allocates
//!   nor locks nor waits, and its work per call is bounded.
//! * [`supervisor`]: everything else, as async [`procedures`] over an executor with injected time: scan, configuration,
//!   state changes, recovery. Mailboxes have a router each: [`mail`].
//!
//! Both send through [`ring`], which marks frames, pairs the copies that travel both ways, and merges them.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
#[cfg(test)]
extern crate std;

mod bell;
pub mod board;
pub mod clocks;
pub mod config;
pub mod declared;
pub mod direction;
pub mod domain;
pub mod event;
pub mod exchange;
pub mod info;
pub mod junction;
pub mod knowledge;
pub mod layout;
pub mod link;
pub mod mail;
pub mod main_device;
pub mod plan;
pub mod procedures;
pub mod queue;
pub mod request;
pub mod ring;
pub mod ring_status;
pub(crate) mod segment;
pub mod supervisor;
pub mod time;
pub mod topology;
