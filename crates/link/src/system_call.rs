//! The instruction of a system call, for the calls of a cycle.
//!
//! In the C library each of them is a cancellation point, which costs 30 instructions per call in a program with
//! threads; its `syscall` moves all arguments once more and sets `errno`, which costs 12. On processors without a
//! version here it is `syscall`.

use std::ffi::c_long;

/// Calls the kernel with these arguments. Returns its result, negative for an error number.
///
/// # Safety
/// The arguments have to be what the kernel requires of this call; pointers have to be valid for what it does with
/// them.
#[inline(always)]
#[cfg(target_arch = "x86_64")]
pub unsafe fn system_call(number: c_long, [a, b, c, d, e, f]: [usize; 6]) -> isize {
    let result: isize;
    // SAFETY: the kernel changes rax, rcx and r11 only, and what the pointers of the caller refer to; the stack is not
    // used.
    unsafe {
        std::arch::asm!(
            "syscall",
            inlateout("rax") number as isize => result,
            in("rdi") a, in("rsi") b, in("rdx") c, in("r10") d, in("r8") e, in("r9") f,
            lateout("rcx") _, lateout("r11") _,
            options(nostack),
        );
    }
    result
}

/// Calls the kernel with these arguments. Returns its result, negative for an error number.
///
/// # Safety
/// The arguments have to be what the kernel requires of this call; pointers have to be valid for what it does with
/// them.
#[inline(always)]
#[cfg(not(target_arch = "x86_64"))]
pub unsafe fn system_call(number: c_long, [a, b, c, d, e, f]: [usize; 6]) -> isize {
    // SAFETY: as the caller promises.
    let result = unsafe { libc::syscall(number, a, b, c, d, e, f) };
    if result >= 0 {
        return result as isize;
    }
    let error = std::io::Error::last_os_error().raw_os_error().unwrap_or(libc::EIO);
    -(error as isize)
}
