//! Calls of functions that may wait: for a daemon, for a SubDevice, for a file. Within them the thread cannot be
//! cancelled (`pthread_cancel`): cancellation would unwind through a master that is half changed. It takes effect at
//! the next cancellation point of the program.
//!
//! The functions of a cycle have no cancellation points, and are called without this ([`super::handle`]).

use std::ffi::c_int;
use std::ptr::null_mut;

use super::handle::{self, Handle, Kind};
use crate::code::Outcome;

/// `PTHREAD_CANCEL_DISABLE`: 1 in glibc and musl.
const DISABLED: c_int = 1;

unsafe extern "C" {
    safe fn pthread_setcancelstate(state: c_int, before: *mut c_int) -> c_int;
}

/// While it lives, this thread cannot be cancelled.
struct NoCancellation {
    before: c_int,
}

impl NoCancellation {
    fn begin() -> NoCancellation {
        let mut before = 0;
        // It cannot fail: the state is one of both.
        pthread_setcancelstate(DISABLED, &mut before);
        NoCancellation { before }
    }
}

impl Drop for NoCancellation {
    fn drop(&mut self) {
        pthread_setcancelstate(self.before, null_mut());
    }
}

/// [`super::guard::caught`] for a function that may wait.
pub fn caught<R>(handle: usize, refused: R, work: impl FnOnce() -> R) -> R {
    let _held = NoCancellation::begin();
    super::guard::caught(handle, refused, work)
}

/// Runs a part of a function that waits in some phases only.
pub fn uncancelled<R>(work: impl FnOnce() -> R) -> R {
    let _held = NoCancellation::begin();
    work()
}

/// [`handle::call`] for a function that may wait.
///
/// # Safety
/// As [`handle::alive`].
pub unsafe fn call<T: Kind>(handle: *const Handle<T>, work: impl FnOnce(&T) -> Outcome) -> c_int {
    let _held = NoCancellation::begin();
    // SAFETY: the caller's promise.
    unsafe { handle::call(handle, work) }
}

/// [`handle::call_for`] for a function that may wait.
///
/// # Safety
/// As [`handle::alive`].
pub unsafe fn call_for<T: Kind>(handle: *const Handle<T>, work: impl FnOnce(&T) -> Outcome<c_int>) -> c_int {
    let _held = NoCancellation::begin();
    // SAFETY: the caller's promise.
    unsafe { handle::call_for(handle, work) }
}

/// [`handle::ask`] for a function that may wait.
///
/// # Safety
/// As [`handle::alive`].
pub unsafe fn ask<T: Kind, R: Copy>(handle: *const Handle<T>, refused: R, work: impl FnOnce(&T) -> R) -> R {
    let _held = NoCancellation::begin();
    // SAFETY: the caller's promise.
    unsafe { handle::ask(handle, refused, work) }
}
