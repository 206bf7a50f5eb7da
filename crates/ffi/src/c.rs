//! The functions of `ecrt.h` and `ringcat.h`, one file per subject.
//!
//! Pointers of C are checked here and nowhere else. A handle that is NULL, or was ended by deactivation or release, is
//! found out by its mark. Functions end in a call of the safe modules, which `guard` protects from panics
//! (`tests/programs/guarded.rs` checks each of them). Functions that may wait are called by `waiting`.

mod again;
mod cyclic;
mod data;
mod guard;
mod handle;
mod life;
mod master_queries;
mod memory;
mod network;
mod objects;
mod opened;
mod requests;
mod slave_config;
mod slave_state;
mod soe_voe;
mod transfers;
mod waiting;
