//! C programs that are compiled against `ecrt.h` and the archive of this crate, and run on simulated segments.
//!
//! The libraries are installed by `crates/ffi/install`. Without a C compiler the tests print a line and pass.

mod arguments;
mod beside;
mod conformance;
mod cut;
mod daemon;
mod exits;
mod fake;
mod guarded;
mod hosts;
mod inside;
mod library;
mod linking;
mod lossless;
mod lost;
mod machine;
mod network;
mod operator;
mod readme;
mod realtime;
mod record;
mod shape;
mod switches;
mod tables;
