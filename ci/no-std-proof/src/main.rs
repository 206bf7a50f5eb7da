//! A program without std that links the codec and the engine, runs a little of each, and exits 0.
//!
//! Why this proves that they need no std: building a library for the host proves nothing, since std is there and
//! anything below may use it unnoticed. A program with its own `#[panic_handler]` cannot be linked together with std,
//! which brings one too: the compiler refuses the second with E0152, "duplicate lang item `panic_impl`". So if wire or
//! engine, or anything they depend on, ever names std, this build fails; `./check` shows that it does by adding a
//! dependency that uses std. `alloc` is there, on the allocator below.
//!
//! Start code and `memcpy` come from the C library of the host, the only target that can be taken for granted;
//! nothing of wire or engine calls it.
#![no_std]
#![no_main]

extern crate alloc;
#[cfg(feature = "pull-std")]
extern crate pulls_std;

mod bump;
mod codec;
mod engine;

use core::ffi::{c_char, c_int};
use core::panic::PanicInfo;

// Start code, `memcpy` and its like, `abort`.
#[link(name = "c")]
unsafe extern "C" {
    fn abort() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    // SAFETY: `abort` takes nothing and does not return.
    unsafe { abort() }
}

/// The unwind tables of functions that the toolchain delivers compiled for unwinding refer to this symbol, for example
/// the 128-bit division of `compiler_builtins`. Nothing unwinds here, so nothing calls it.
// SAFETY: the only function of this name: std defines it too, but a dependency that uses std does not compile here,
// because of the second panic handler.
#[unsafe(no_mangle)]
pub extern "C" fn rust_eh_personality() {}

/// Called by the start code of the C library; 0 says that codec and engine did what was expected.
// SAFETY: the only function of this name in the program, with the signature that the start code calls.
#[unsafe(no_mangle)]
pub extern "C" fn main(_argc: c_int, _argv: *const *const c_char) -> c_int {
    match codec::works().and_then(|()| engine::works()) {
        Some(()) => 0,
        None => 1,
    }
}
