//! Floating point numbers in process data: little-endian, at any address.

use super::guard::caught;

/// # Safety
/// `N` bytes can be read at `data`.
unsafe fn read<const N: usize>(data: *const u8) -> [u8; N] {
    if data.is_null() {
        return [0; N];
    }
    // SAFETY: not null; the rest is the caller's promise.
    unsafe { data.cast::<[u8; N]>().read_unaligned() }
}

/// # Safety
/// `N` bytes can be written at `data`.
unsafe fn write<const N: usize>(data: *mut u8, bytes: [u8; N]) {
    if !data.is_null() {
        // SAFETY: not null; the rest is the caller's promise.
        unsafe { data.cast::<[u8; N]>().write_unaligned(bytes) };
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_read_real(data: *const u8) -> f32 {
    // SAFETY: 4 bytes of process data (ecrt.h).
    caught(0, 0.0, || f32::from_le_bytes(unsafe { read(data) }))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_read_lreal(data: *const u8) -> f64 {
    // SAFETY: 8 bytes of process data (ecrt.h).
    caught(0, 0.0, || f64::from_le_bytes(unsafe { read(data) }))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_write_real(data: *mut u8, value: f32) {
    // SAFETY: 4 bytes of process data (ecrt.h).
    caught(0, (), || unsafe { write(data, value.to_le_bytes()) })
}

#[unsafe(no_mangle)]
unsafe extern "C" fn ecrt_write_lreal(data: *mut u8, value: f64) {
    // SAFETY: 8 bytes of process data (ecrt.h).
    caught(0, (), || unsafe { write(data, value.to_le_bytes()) })
}
