//! A driver of the shape of IgH's `ecrt.h`, over the Rust API: request, configure, register, activate, the calls of a
//! cycle in any order, deactivate, release. Scenarios call it as public programs do (facts of `ecrt.h` clients).
//!
//! In: calls, faults of the segment, virtual time. Out: the return values that `ecrt.h` has where the engine decides
//! them. After each call [`witness::Witness`] looks into the simulated SubDevices. A call that does not wait lets no
//! virtual time pass, and one that waits keeps its limit; both are checked here.
//!
//! The MainDevice of the driver goes on without a reservation, as the kernel's master does after `release`.

pub mod configure;
pub mod cycle;
pub mod errno;
pub mod faults;
pub mod links;
pub mod mail;
pub mod master;
pub mod plan;
pub mod side;
pub mod witness;
