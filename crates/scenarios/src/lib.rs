//! Engine and simulated segment put together in virtual time: [`world`] with its actions, its environment
//! ([`segments`], [`tap`], [`dice`]) and, separate from the scenarios, the checks ([`check`]). The scenarios are in
//! `tests/`, one file per subject.
//!
//! Benches (`src/bin/`) run on [`cyclic_load`] and [`answering_double`], count with [`callgrind`] and
//! [`counting_allocator`] and print [`figures`]; measurements on real interfaces run in [`namespaces`].

pub mod answering_double;
pub mod areas;
pub mod callgrind;
pub mod calls;
pub mod capture;
pub mod check;
pub mod clocks;
pub mod counting_allocator;
pub mod cpu_time;
pub mod cyclic_load;
pub mod cyclic_pair;
pub mod delays;
pub mod dice;
pub mod ethernet_host;
pub mod ethernet_peer;
pub mod figures;
pub mod fuzz_targets;
pub mod live_truth;
pub mod loss;
pub mod mailbox_requests;
pub mod mailbox_users;
pub mod namespaces;
pub mod odd_images;
pub mod once;
pub mod one_buffer;
#[cfg(doctest)]
mod pages;
pub mod pair;
pub mod parts;
pub mod phases;
pub mod pulses;
pub mod recorded_links;
pub mod ring_matrix;
pub mod seeds;
pub mod segments;
pub mod shared_memory;
pub mod short_runs;
pub mod start_lists;
pub mod tampered_links;
pub mod tap;
pub mod terminals;
pub mod truth;
pub mod two;
pub mod uploads;
pub mod witness;
pub mod world;
