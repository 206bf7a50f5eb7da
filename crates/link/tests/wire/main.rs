//! The crate on interfaces of the kernel: pairs of them in namespaces that each test makes and removes.
//!
//! Needs root; without, each test prints "skipped: needs root" and passes.

mod bench;
mod exclusive;
mod faults;
mod frames;
mod waits;
