//! Waiting for a frame or a moment, whichever comes first: asleep, spinning, or first one and then the other.
//!
//! In go the sockets of a thread and a time, out comes whether a frame is there. Spinning answers within a fraction of
//! a microsecond and takes a whole processor; sleeping costs tens of microseconds a wake-up; the hybrid spins for as
//! long as frames usually take to return.

use std::hint::spin_loop;

use crate::kernel;
use crate::monotonic::{now_ns, timespec};
use crate::packet_socket::PacketSocket;
use crate::receive_mode::ReceiveMode;

/// At most this many sockets are waited for at once: two classes on two interfaces, and some more for a simulator.
pub const MAX_SOCKETS: usize = 16;

/// Looks at the rings between two looks at the clock; a look at the clock costs about 20 ns.
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
        // SAFETY: as many places as sockets are passed, all of them live; the signal mask stays as it is.
        unsafe { libc::ppoll(polled.as_mut_ptr(), sockets.len() as libc::nfds_t, &timeout, std::ptr::null()) };
        for (place, socket) in polled.iter().zip(sockets) {
            if place.revents & libc::POLLERR != 0 {
                // The interface went down. Taking the error off lets the next poll sleep until it is back.
                kernel::clear_error(&socket.fd());
            }
        }
    }
}
