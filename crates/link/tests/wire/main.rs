//! Tests of the crate on kernel interfaces: veth pairs in namespaces that each test creates and removes.
//!
//! Needs root and RINGCAT_ON_THE_WIRE=1; otherwise each test prints what it needs and passes.

mod bench;
mod binding;
mod exclusive;
mod faults;
mod frames;
mod handed;
mod listening;
mod taps;
mod waits;
