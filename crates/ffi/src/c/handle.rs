//! Handles of C: a mark before an object. The mark is erased when the handle ends; the memory is kept for a while, so
//! that late calls find the missing mark. It includes the generation of the process: in a child made by `fork` no
//! handle of its parent is alive, since the threads behind it are missing there. After a panic the handles of its
//! master have another mark, and are refused with a code of their own.

use std::collections::VecDeque;
use std::ffi::c_int;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use super::guard::caught;
use crate::code::{Code, Outcome};
use crate::host::generation;
use crate::locks::OfProcess;

/// Handles that have ended and whose memory is kept.
const KEPT: usize = 4096;
/// Mark of a handle that has ended.
const ENDED: u64 = 0x6465_6164_6865_7265;

/// An object with a handle.
pub trait Kind {
    /// Mark of its living handles.
    const MARK: u64;
}

/// Mark of living handles of this process.
#[inline(always)]
fn living<T: Kind>() -> u64 {
    T::MARK.wrapping_add(generation())
}

/// Mark of handles of this process whose master has failed.
fn failed<T: Kind>() -> u64 {
    (!T::MARK).wrapping_add(generation())
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
    fail: fn(usize),
    free: fn(usize),
}

impl Ending {
    /// Whether it is of this handle.
    pub fn is_of(&self, address: usize) -> bool {
        self.address == address
    }

    /// From now on the handle is refused with [`Code::IO`].
    pub fn fail(&self) {
        (self.fail)(self.address);
    }
}

static ENDED_HANDLES: OfProcess<Mutex<VecDeque<Ending>>> = OfProcess::new();

/// Makes a handle.
pub fn give<T: Kind>(object: T) -> *mut Handle<T> {
    Box::into_raw(Box::new(Handle { mark: AtomicU64::new(living::<T>()), object }))
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
        fail: |address| {
            // SAFETY: as above.
            let mark = unsafe { &(*(address as *const Handle<T>)).mark };
            // One that has ended meanwhile stays ended.
            let _ = mark.compare_exchange(living::<T>(), failed::<T>(), Ordering::AcqRel, Ordering::Relaxed);
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
        let mut ended = ENDED_HANDLES.lock();
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
/// NULL, or the handle has ended, or is of another kind; [`Code::IO`]: its master has failed.
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
    if mark != living::<T>() {
        return Err(refusal::<T>(mark));
    }
    // SAFETY: the mark shows the type.
    Ok(unsafe { &(*handle).object })
}

#[cold]
fn refusal<T: Kind>(mark: u64) -> Code {
    if mark == failed::<T>() { Code::IO } else { Code::INVALID }
}

/// The object of a handle that is to end, and whether its master has failed.
///
/// # Errors
/// As [`alive`], but for a master that has failed.
///
/// # Safety
/// As [`alive`].
pub unsafe fn alive_or_failed<'a, T: Kind>(handle: *const Handle<T>) -> Outcome<(&'a T, bool)> {
    // SAFETY: the caller's promise.
    match unsafe { alive(handle) } {
        Ok(object) => Ok((object, false)),
        // SAFETY: the mark of a failed one shows the type, too.
        Err(Code::IO) => Ok((unsafe { &(*handle).object }, true)),
        Err(code) => Err(code),
    }
}

/// Calls a function of a living handle; the code for C.
///
/// # Safety
/// As [`alive`].
#[inline(always)]
pub unsafe fn call<T: Kind>(handle: *const Handle<T>, work: impl FnOnce(&T) -> Outcome) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { call_for(handle, |object| work(object).map(|()| 0)) }
}

/// Calls a function of a living handle; the number for C, or the code.
///
/// # Safety
/// As [`alive`].
#[inline(always)]
pub unsafe fn call_for<T: Kind>(handle: *const Handle<T>, work: impl FnOnce(&T) -> Outcome<c_int>) -> c_int {
    caught(handle as usize, Code::IO.0, || {
        // SAFETY: the caller's promise.
        unsafe { alive(handle) }.and_then(work).unwrap_or_else(|Code(code)| code)
    })
}

/// Calls a function of a living handle; what it returns, otherwise `refused`.
///
/// # Safety
/// As [`alive`].
#[inline(always)]
pub unsafe fn ask<T: Kind, R: Copy>(handle: *const Handle<T>, refused: R, work: impl FnOnce(&T) -> R) -> R {
    caught(handle as usize, refused, || {
        // SAFETY: the caller's promise.
        unsafe { alive(handle) }.map_or(refused, work)
    })
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
            assert_eq!((call_for(handle, |kept| Ok(kept.0 as c_int)), ask(handle, 1, |kept| kept.0)), (7, 7));
            ending(handle).fail();
            assert_eq!((call(handle, |_| Ok(())), ask(handle, 1, |kept| kept.0)), (Code::IO.0, 1));
            assert_eq!(alive_or_failed(handle).map(|(kept, has_failed)| (kept.0, has_failed)), Ok((7, true)));
            assert_eq!(alive_or_failed(handle.cast::<Handle<Other>>()).err(), Some(Code::INVALID));
            bury(ending(handle));
            ending(handle).fail();
            assert_eq!(call(handle, |_| Ok(())), Code::INVALID.0);
        }
    }
}
