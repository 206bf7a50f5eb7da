//! Blocking transfers of objects and IDNs.

use std::ffi::c_int;

use super::memory::{bytes, put};
use super::objects::{MasterObject, ec_master_t};
use super::waiting::call;
use crate::code::{Code, Outcome};
use crate::mailbox::{Failed, download, read_idn, upload, write_idn};

/// The result of a transfer; C gets the reason of a failure, if there is memory for it and there is one.
///
/// # Safety
/// A `T` can be written at `reason`, or it is NULL.
unsafe fn finish<R, T: TryFrom<u32>>(done: Result<R, Failed>, reason: *mut T) -> Outcome<R> {
    done.map_err(|failed| {
        if let (Some(Ok(code)), false) = (failed.reason.map(T::try_from), reason.is_null()) {
            // SAFETY: the caller's promise.
            unsafe { reason.write(code) };
        }
        failed.code
    })
}

/// Gives C what was read.
///
/// # Safety
/// `size` bytes can be written at `target`, and a size at `result`; both may be NULL.
unsafe fn give(data: &[u8], target: *mut u8, size: usize, result: *mut usize) -> Outcome {
    if data.len() > size {
        return Err(Code::OVERFLOW);
    }
    if target.is_null() {
        return Err(Code::FAULT);
    }
    // SAFETY: the caller's promise; the data fits, and is memory of this library.
    unsafe {
        target.copy_from_nonoverlapping(data.as_ptr(), data.len());
        put(result, data.len())
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sdo_download(
    master: *mut ec_master_t,
    slave_position: u16,
    index: u16,
    subindex: u8,
    data: *const u8,
    data_size: usize,
    abort_code: *mut u32,
) -> c_int {
    let write = |MasterObject(owner): &MasterObject| -> Outcome {
        // SAFETY: data of C of this size, memory for the abort code or NULL (ecrt.h).
        unsafe {
            let data = bytes(data, data_size)?.to_vec();
            finish(download(&*owner.master.responder()?, slave_position, (index, Some(subindex)), data), abort_code)
        }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, write) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sdo_download_complete(
    master: *mut ec_master_t,
    slave_position: u16,
    index: u16,
    data: *const u8,
    data_size: usize,
    abort_code: *mut u32,
) -> c_int {
    let write = |MasterObject(owner): &MasterObject| -> Outcome {
        // SAFETY: data of C of this size, memory for the abort code or NULL (ecrt.h).
        unsafe {
            let data = bytes(data, data_size)?.to_vec();
            finish(download(&*owner.master.responder()?, slave_position, (index, None), data), abort_code)
        }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, write) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_sdo_upload(
    master: *mut ec_master_t,
    slave_position: u16,
    index: u16,
    subindex: u8,
    target: *mut u8,
    target_size: usize,
    result_size: *mut usize,
    abort_code: *mut u32,
) -> c_int {
    let read = |MasterObject(owner): &MasterObject| -> Outcome {
        let done = upload(&*owner.master.responder()?, slave_position, index, subindex);
        // SAFETY: memory of C for data, size and abort code (ecrt.h).
        unsafe { give(&finish(done, abort_code)?, target, target_size, result_size) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, read) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_write_idn(
    master: *mut ec_master_t,
    slave_position: u16,
    drive_no: u8,
    idn: u16,
    data: *const u8,
    data_size: usize,
    error_code: *mut u16,
) -> c_int {
    let write = |MasterObject(owner): &MasterObject| -> Outcome {
        // SAFETY: data of C of this size, memory for the error code or NULL (ecrt.h).
        unsafe {
            let data = bytes(data, data_size)?.to_vec();
            finish(write_idn(&*owner.master.responder()?, slave_position, drive_no, idn, data), error_code)
        }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, write) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_master_read_idn(
    master: *mut ec_master_t,
    slave_position: u16,
    drive_no: u8,
    idn: u16,
    target: *mut u8,
    target_size: usize,
    result_size: *mut usize,
    error_code: *mut u16,
) -> c_int {
    let read = |MasterObject(owner): &MasterObject| -> Outcome {
        let done = read_idn(&*owner.master.responder()?, slave_position, drive_no, idn);
        // SAFETY: memory of C for data, size and error code (ecrt.h).
        unsafe { give(&finish(done, error_code)?, target, target_size, result_size) }
    };
    // SAFETY: a handle of the library (ecrt.h).
    unsafe { call(master, read) }
}
