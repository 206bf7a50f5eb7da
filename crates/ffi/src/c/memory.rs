//! Memory of C: arguments that are read, results that are written.

use std::ffi::{CStr, c_char};

use crate::code::{Code, Outcome};

/// Bytes of C.
///
/// # Errors
/// NULL with a length, or an impossible length.
///
/// # Safety
/// `length` bytes can be read at `data`, or it is NULL.
pub unsafe fn bytes<'a>(data: *const u8, length: usize) -> Outcome<&'a [u8]> {
    match length {
        0 => Ok(&[]),
        _ if data.is_null() => Err(Code::FAULT),
        _ if isize::try_from(length).is_err() => Err(Code::INVALID),
        // SAFETY: not null, a possible length; the rest is the caller's promise.
        _ => Ok(unsafe { std::slice::from_raw_parts(data, length) }),
    }
}

/// A list of C.
///
/// # Errors
/// NULL with a length.
///
/// # Safety
/// `length` elements can be read at `list`, or it is NULL.
pub unsafe fn list<'a, T>(list: *const T, length: usize) -> Outcome<&'a [T]> {
    match length {
        0 => Ok(&[]),
        _ if list.is_null() => Err(Code::FAULT),
        // SAFETY: not null; the rest is the caller's promise.
        _ => Ok(unsafe { std::slice::from_raw_parts(list, length) }),
    }
}

/// Writes a result.
///
/// # Errors
/// NULL.
///
/// # Safety
/// A `T` can be written at `to`, or it is NULL.
pub unsafe fn put<T>(to: *mut T, value: T) -> Outcome {
    if to.is_null() {
        return Err(Code::FAULT);
    }
    // SAFETY: not null; the rest is the caller's promise. The memory may have any content before.
    unsafe { to.write(value) };
    Ok(())
}

/// A text of C; bytes that are no UTF-8 are replaced.
///
/// # Errors
/// NULL.
///
/// # Safety
/// A text with a zero at its end, or NULL.
pub unsafe fn text(text: *const c_char) -> Outcome<String> {
    if text.is_null() {
        return Err(Code::FAULT);
    }
    // SAFETY: not null; the rest is the caller's promise.
    Ok(unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}
