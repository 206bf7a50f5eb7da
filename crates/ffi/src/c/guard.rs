//! The end of every panic: a program in C gets a code, and a master that is half changed is not used any more.
//!
//! All functions for C run in [`caught`]. After a panic the handles of the master are refused with -EIO (NULL,
//! nothing), until `ecrt_release_master` gives it up; other masters of the process go on.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::opened;
use crate::code::report;

/// Runs a function for C. After a panic it returns `refused`, and the master of the handle has failed; a handle of 0
/// is none.
#[inline(always)]
pub fn caught<R>(handle: usize, refused: R, work: impl FnOnce() -> R) -> R {
    // What is half changed is not used again: the master has failed.
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(result) => result,
        Err(panic) => {
            fail(handle, panic);
            refused
        }
    }
}

#[cold]
#[inline(never)]
fn fail(handle: usize, panic: Box<dyn Any + Send>) {
    // A panic in here would end the program.
    let _ = catch_unwind(AssertUnwindSafe(|| {
        let has_failed = opened::fail(handle);
        let what = panic.downcast_ref::<&str>().copied();
        let what = what.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no text");
        let rest = if has_failed { " The master takes no calls until it is released." } else { "" };
        report(format_args!("Internal error: {what}.{rest}"));
    }));
}
