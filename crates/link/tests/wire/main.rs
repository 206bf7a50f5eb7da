//! The crate on interfaces of the kernel: pairs of them in namespaces that each test makes and removes.
//!
//! Needs root and RINGCAT_ON_THE_WIRE=1; without, each test prints what it needs and passes.

mod bench;
mod exclusive;
mod faults;
mod frames;
mod listening;
mod taps;
mod waits;
