//! C programs that are compiled against `ecrt.h` and the archive of this crate, and run on simulated segments.
//!
//! The shared library is linked as `crates/ffi/install` does it. Without a C compiler the tests print a line and pass.

mod conformance;
mod daemon;
mod library;
mod machine;
mod shape;
