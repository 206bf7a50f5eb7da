//! Waiting for a frame or a time, the earlier of both: sleeping, spinning, or spinning first and then sleeping.
//!
//! Input: the sockets of a thread and a time. Output: whether a frame has arrived. Spinning responds within a fraction
//! of a microsecond and occupies a processor; sleeping costs tens of microseconds per wake-up. The hybrid mode
//! sleeps for most of the usual round trip time of frames ([`UsualReturn`]) and spins for the rest.

use std::hint::spin_loop;
use std::time::Duration;

use crate::kernel::{self, Polled};
use crate::monotonic::{now_ns, timespec};
use crate::packet_socket::PacketSocket;
use crate::receive_mode::ReceiveMode;
use crate::wake_up::WakeUp;

/// Maximum number of sockets per wait: two classes on two interfaces, and more for a simulator.
pub const MAX_SOCKETS: usize = 16;

/// Checks of the rings between two readings of the clock; reading the clock costs about 20 ns.
const LOOKS_PER_CLOCK: u32 = 16;

/// Waits until a frame is in one of the rings (true) or the monotonic time has come (false).
///
/// # Panics
/// With more than [`MAX_SOCKETS`] sockets.
pub fn wait(sockets: &[&PacketSocket], until_ns: u64, mode: ReceiveMode) -> bool {
    wait_from(sockets, now_ns(), until_ns, mode)
}

/// As [`wait`], with the time that was read just before.
///
/// # Panics
/// With more than [`MAX_SOCKETS`] sockets.
#[inline(always)]
pub fn wait_from(sockets: &[&PacketSocket], now: u64, until_ns: u64, mode: ReceiveMode) -> bool {
    match mode {
        ReceiveMode::Blocking => sleep(sockets, now, until_ns),
        ReceiveMode::BusyPoll => spin(sockets, until_ns),
        ReceiveMode::Hybrid { spin: limit } => spin_and_sleep(sockets, now, until_ns, limit),
    }
}

fn spin_and_sleep(sockets: &[&PacketSocket], now: u64, until_ns: u64, limit: Duration) -> bool {
    let spin_until = now.saturating_add(u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX));
    if spin_until >= until_ns {
        spin(sockets, until_ns)
    } else {
        spin(sockets, spin_until) || sleep(sockets, spin_until, until_ns)
    }
}

/// How long frames usually take to return, for hybrid waits.
#[derive(Clone, Copy, Debug, Default)]
pub struct UsualReturn {
    ns: u64,
}

impl UsualReturn {
    /// A sleep ends this long before the frame is expected: timers of a host are late by tens of microseconds.
    const LEAD_NS: u64 = 50_000;
    /// A longer return counts by this fraction, so that one late frame is not waited for in the next cycles.
    const LONGER_BY: u64 = 16;

    /// As [`wait_from`] with [`ReceiveMode::Hybrid`] of this limit, for the first frame after one was sent at about
    /// `now`: asleep until it is nearly due.
    pub fn wait(&mut self, sockets: &[&PacketSocket], now: u64, until_ns: u64, limit: Duration) -> bool {
        let due = self.due_ns(now, until_ns);
        let mut found = false;
        let mut woken = now;
        if due > now {
            found = sleep(sockets, now, due);
            woken = now_ns();
        }
        found = found || spin_and_sleep(sockets, woken, until_ns, limit);
        if found {
            self.learn(now_ns().saturating_sub(now));
        }
        found
    }

    /// The end of the sleep: [`Self::LEAD_NS`] before the usual return, and as long before the end of the wait. A cycle
    /// that is shorter than a wake-up never sleeps here; it would begin late each time.
    #[inline(always)]
    fn due_ns(&self, now: u64, until_ns: u64) -> u64 {
        now.saturating_add(self.ns).min(until_ns).saturating_sub(Self::LEAD_NS)
    }

    fn learn(&mut self, took_ns: u64) {
        let longer = took_ns.saturating_sub(self.ns) / Self::LONGER_BY;
        self.ns = took_ns.min(self.ns + longer);
    }
}

#[inline(always)]
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

#[inline(always)]
fn sleep(sockets: &[&PacketSocket], now: u64, until_ns: u64) -> bool {
    let place = |socket: &PacketSocket| libc::pollfd { fd: socket.fd(), events: libc::POLLIN, revents: 0 };
    // Most have one socket or two: no places for more are filled then.
    match sockets {
        [alone] => sleep_on(sockets, &mut [place(alone)], now, until_ns),
        [main, redundant] => sleep_on(sockets, &mut [place(main), place(redundant)], now, until_ns),
        many => {
            assert!(many.len() <= MAX_SOCKETS, "at most {MAX_SOCKETS} sockets are waited for at once");
            let mut polled = [libc::pollfd { fd: -1, events: libc::POLLIN, revents: 0 }; MAX_SOCKETS];
            polled.iter_mut().zip(many).for_each(|(to, socket)| *to = place(socket));
            sleep_on(sockets, &mut polled[..many.len()], now, until_ns)
        }
    }
}

/// As [`wait_from`], asleep; another thread may end the wait by `wake_up` (false).
///
/// # Panics
/// With more than [`MAX_SOCKETS`] sockets.
pub fn wait_or_wake(sockets: &[&PacketSocket], wake_up: &WakeUp, now: u64, until_ns: u64) -> bool {
    assert!(sockets.len() <= MAX_SOCKETS, "at most {MAX_SOCKETS} sockets are waited for at once");
    let mut polled = [libc::pollfd { fd: -1, events: libc::POLLIN, revents: 0 }; MAX_SOCKETS + 1];
    polled.iter_mut().zip(sockets).for_each(|(to, socket)| to.fd = socket.fd());
    polled[sockets.len()].fd = wake_up.fd();
    sleep_until(sockets, &mut polled[..=sockets.len()], now, until_ns, |polled| {
        let is_woken = polled.last().is_some_and(|place| place.revents & libc::POLLIN != 0);
        if is_woken {
            wake_up.clear();
        }
        is_woken
    })
}

#[inline(always)]
fn sleep_on(sockets: &[&PacketSocket], polled: &mut [libc::pollfd], now: u64, until_ns: u64) -> bool {
    sleep_until(sockets, polled, now, until_ns, |_| false)
}

/// Sleeps until a frame has arrived (true), the time has come, or `ends` finds a reason in the polled places.
#[inline(always)]
fn sleep_until(
    sockets: &[&PacketSocket],
    polled: &mut [libc::pollfd],
    mut now: u64,
    until_ns: u64,
    ends: impl Fn(&[libc::pollfd]) -> bool,
) -> bool {
    loop {
        if any(sockets) {
            return true;
        }
        if now >= until_ns {
            return false;
        }
        let woken = kernel::poll(polled, timespec(until_ns - now));
        if woken == Polled::TimedOut {
            // The kernel never waits for less, so the clock need not be read again.
            return any(sockets);
        }
        if woken == Polled::Ready {
            let ended = ends(polled);
            if any(sockets) {
                return true;
            }
            if ended {
                return false;
            }
            for (place, socket) in polled.iter().zip(sockets) {
                if place.revents & libc::POLLERR != 0 {
                    // The interface went down. Clearing the error allows the next poll to sleep until the interface is
                    // back.
                    kernel::clear_error(&socket.fd());
                }
            }
        }
        now = now_ns();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: links
    #[test]
    fn the_usual_return_follows_early_frames_at_once_and_late_ones_slowly() {
        let mut usual = UsualReturn::default();
        (0..200).for_each(|_| usual.learn(400_000));
        assert!((390_000..=400_000).contains(&usual.ns), "{}", usual.ns);
        usual.learn(2_000_000);
        assert!(usual.ns <= 500_000, "one late frame: {}", usual.ns);
        usual.learn(300_000);
        assert_eq!(usual.ns, 300_000);
        let now = 5_000_000;
        assert_eq!(usual.due_ns(now, now + 1_000_000), now + 250_000);
        assert_eq!(usual.due_ns(now, now + 200_000), now + 150_000, "the wait ends first");
        assert!(usual.due_ns(now, now + 10_000) <= now, "a cycle of 10 us does not sleep");
    }
}
