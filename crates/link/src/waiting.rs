//! Waiting for a frame or a time, the earlier of both: sleeping, spinning, or spinning first and then sleeping.
//!
//! Input: the sockets of a thread and a time. Output: whether a frame has arrived. Spinning responds within a fraction
//! of a microsecond and occupies a processor; sleeping costs tens of microseconds per wake-up. The hybrid mode spins
//! for the usual round trip time of frames.

use std::hint::spin_loop;

use crate::kernel;
use crate::monotonic::{now_ns, timespec};
use crate::packet_socket::PacketSocket;
use crate::receive_mode::ReceiveMode;

/// Maximum number of sockets per wait: two classes on two interfaces, and more for a simulator.
pub const MAX_SOCKETS: usize = 16;

/// Checks of the rings between two readings of the clock; reading the clock costs about 20 ns.
const LOOKS_PER_CLOCK: u32 = 16;

/// Waits until a frame is in one of the rings (true) or the monotonic time has come (false).
///
/// # Panics
/// With more than [`MAX_SOCKETS`] sockets.
pub fn wait(sockets: &[&PacketSocket], until_ns: u64, mode: ReceiveMode) -> bool {
    assert!(sockets.len() <= MAX_SOCKETS, "at most {MAX_SOCKETS} sockets are waited for at once");
    match mode {
        ReceiveMode::Blocking => sleep(sockets, until_ns),
        ReceiveMode::BusyPoll => spin(sockets, until_ns),
        ReceiveMode::Hybrid { spin: limit } => {
            let limit = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
            let spin_until = now_ns().saturating_add(limit);
            if spin_until >= until_ns {
                spin(sockets, until_ns)
            } else {
                spin(sockets, spin_until) || sleep(sockets, until_ns)
            }
        }
    }
}

fn any(sockets: &[&PacketSocket]) -> bool {
    sockets.iter().any(|socket| socket.has_frame())
}

fn spin(sockets: &[&PacketSocket], until_ns: u64) -> bool {
    loop {
        for _ in 0..LOOKS_PER_CLOCK {
            if any(sockets) {
                return true;
            }
            spin_loop();
        }
        if now_ns() >= until_ns {
            return any(sockets);
        }
    }
}

fn sleep(sockets: &[&PacketSocket], until_ns: u64) -> bool {
    let mut polled = [libc::pollfd { fd: -1, events: libc::POLLIN, revents: 0 }; MAX_SOCKETS];
    for (place, socket) in polled.iter_mut().zip(sockets) {
        place.fd = socket.fd();
    }
    loop {
        if any(sockets) {
            return true;
        }
        let now = now_ns();
        if now >= until_ns {
            return false;
        }
        let timeout = timespec(until_ns - now);
        // SAFETY: the pointer refers to as many live entries as sockets are passed; the signal mask stays unchanged.
        unsafe { libc::ppoll(polled.as_mut_ptr(), sockets.len() as libc::nfds_t, &timeout, std::ptr::null()) };
        for (place, socket) in polled.iter().zip(sockets) {
            if place.revents & libc::POLLERR != 0 {
                // The interface went down. Clearing the error allows the next poll to sleep until the interface is
                // back.
                kernel::clear_error(&socket.fd());
            }
        }
    }
}
