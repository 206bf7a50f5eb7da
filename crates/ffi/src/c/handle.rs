//! Handles of C: a mark before an object. The mark is erased when the handle ends; the memory is kept for a while, so
//! that late calls find the missing mark. It includes the generation of the process: in a child made by `fork` no
//! handle of its parent is alive, since the threads behind it are missing there.

use std::collections::VecDeque;
use std::ffi::c_int;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::code::{Code, Outcome, number};
use crate::host::generation;
use crate::locks::locked;

/// Handles that have ended and whose memory is kept.
const KEPT: usize = 4096;
/// Mark of a handle that has ended.
const ENDED: u64 = 0x6465_6164_6865_7265;

/// An object with a handle.
pub trait Kind {
    /// Mark of its living handles.
    const MARK: u64;
}

/// An object behind a mark.
#[repr(C)]
pub struct Handle<T> {
    mark: AtomicU64,
    object: T,
}

/// A handle without its type.
#[derive(Clone, Copy)]
pub struct Ending {
    address: usize,
    end: fn(usize),
    free: fn(usize),
}

static ENDED_HANDLES: Mutex<VecDeque<Ending>> = Mutex::new(VecDeque::new());

/// Makes a handle.
pub fn give<T: Kind>(object: T) -> *mut Handle<T> {
    Box::into_raw(Box::new(Handle { mark: AtomicU64::new(T::MARK.wrapping_add(generation())), object }))
}

/// How a handle ends; to be kept by its owner.
pub fn ending<T: Kind>(handle: *mut Handle<T>) -> Ending {
    Ending {
        address: handle as usize,
        end: |address| {
            // SAFETY: the address came from `give` with this type, and its memory is freed by `bury` only, once, after
            // this call.
            unsafe { (*(address as *const Handle<T>)).mark.store(ENDED, Ordering::Release) }
        },
        free: |address| {
            // SAFETY: as above; `bury` removes the handle from its list before it calls this.
            drop(unsafe { Box::from_raw(address as *mut Handle<T>) });
        },
    }
}

/// Ends a handle. Its memory is freed when many others have ended after it.
pub fn bury(handle: Ending) {
    (handle.end)(handle.address);
    let oldest = {
        let mut ended = locked(&ENDED_HANDLES);
        ended.push_back(handle);
        if ended.len() > KEPT { ended.pop_front() } else { None }
    };
    if let Some(oldest) = oldest {
        (oldest.free)(oldest.address);
    }
}

/// The object of a living handle.
///
/// # Errors
/// NULL, or the handle has ended, or is of another kind.
///
/// # Safety
/// NULL, or a pointer that the library has given; not one that many ended after.
#[inline(always)]
pub unsafe fn alive<'a, T: Kind>(handle: *const Handle<T>) -> Outcome<&'a T> {
    if handle.is_null() {
        return Err(Code::INVALID);
    }
    // SAFETY: the caller's promise: memory of `give`, which also stays readable after the end. All kinds begin with the
    // mark, so a handle of another kind is found out.
    let mark = unsafe { (*handle.cast::<AtomicU64>()).load(Ordering::Acquire) };
    if mark != T::MARK.wrapping_add(generation()) {
        return Err(Code::INVALID);
    }
    // SAFETY: the mark shows the type.
    Ok(unsafe { &(*handle).object })
}

/// Calls a function of a living handle; the value for C.
///
/// # Safety
/// As [`alive`].
#[inline(always)]
pub unsafe fn call<T: Kind>(handle: *const Handle<T>, work: impl FnOnce(&T) -> Outcome) -> c_int {
    // SAFETY: the caller's promise.
    number(unsafe { alive(handle) }.and_then(work))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Kept(u32);

    impl Kind for Kept {
        const MARK: u64 = 1;
    }

    struct Other;

    impl Kind for Other {
        const MARK: u64 = 2;
    }

    // covers: c-interface
    #[test]
    fn a_handle_that_is_null_ended_or_of_another_kind_is_found_out() {
        let handle = give(Kept(7));
        // SAFETY: handles of `give`, and NULL.
        unsafe {
            assert_eq!(alive(handle).map(|kept| kept.0), Ok(7));
            assert_eq!(alive(handle.cast::<Handle<Other>>()).err(), Some(Code::INVALID));
            assert_eq!(call(std::ptr::null::<Handle<Kept>>(), |_| Ok(())), Code::INVALID.0);
            bury(ending(handle));
            assert_eq!(call(handle, |_| Ok(())), Code::INVALID.0);
        }
    }
}
