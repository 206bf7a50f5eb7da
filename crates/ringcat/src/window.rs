//! When frames of the acyclic half may leave: between the frames of two cycles.
//!
//! The cyclic half posts when its next frames leave. Each half posts when its sent frames will have left the interface.
//! Each word has one writer, so the halves may run in different threads. Both links carry the same frames, so one
//! account is enough. The acyclic half also has a budget per cycle, so that a long cycle does not fill the queues of
//! the interface at once.
//!
//! While a frame of a cycle is out that would be sent again, acyclic frames have left the interface by the time at
//! which it would be: a second try never waits for them (decision 0054).

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ringcat_engine::time::Instant;
use ringcat_wire::frame::{BYTE_TIME_NS, MAX_FRAME, MIN_FRAME, WIRE_OVERHEAD, wire_time_ns};

/// Time before a cycle in which no acyclic frame is sent: a frame that was sent before has then left the interface.
const GUARD_NS: u64 = wire_time_ns(MAX_FRAME) / 4;
/// A shorter gap between two cycles has no room for a frame, so there is no window.
pub const SHORTEST: Duration = Duration::from_nanos(wire_time_ns(MAX_FRAME) + wire_time_ns(MAX_FRAME) / 2);
/// A cyclic half that is later than posted by more than this has stopped: no cyclic frames follow.
const SILENCE_NS: u64 = 20_000_000;
/// Interval of the check for room while a cycle is due, because it may begin at any moment.
const LOOK_AGAIN: Duration = Duration::from_micros(50);
/// A second try that is due for this time was not decided in time, and keeps no more time free.
const TRY_OVERDUE: Duration = LOOK_AGAIN;
/// Shortest time between two readings of what the cyclic half posts.
const SHORTEST_READING: Duration = Duration::from_micros(500);

/// The half that sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// Process data.
    Cyclic,
    /// Everything else.
    Acyclic,
}

/// Default number of bytes that the acyclic half may send in a cycle: the wire time of about 10 ms.
pub const DEFAULT_BUDGET: usize = 128 * 1024;

/// Use of the wire by both halves.
#[derive(Debug)]
pub struct Window {
    /// Bytes that the acyclic half may send in a cycle.
    budget: usize,
    /// End of the cycle in which it sent last, and the bytes that it sent in that cycle.
    spent: [AtomicU64; 2],
    /// When frames of the cyclic half leave next; never without a cyclic half.
    next_cycle: AtomicU64,
    /// When a frame of this cycle is sent again if it is not back by then; never if all are back, or if none would be.
    next_try: AtomicU64,
    /// When the sent frames of each half will have left.
    free: [AtomicU64; 2],
}

impl Default for Window {
    fn default() -> Window {
        Window::new(DEFAULT_BUDGET)
    }
}

impl Window {
    /// Windows with this number of bytes per cycle for the acyclic half, at least one longest frame.
    pub fn new(budget: usize) -> Window {
        let zero = || AtomicU64::new(0);
        Window {
            budget: budget.max(MAX_FRAME),
            spent: [zero(), zero()],
            next_cycle: AtomicU64::new(Instant::NEVER.0),
            next_try: AtomicU64::new(Instant::NEVER.0),
            free: [zero(), zero()],
        }
    }

    /// Bytes that the acyclic half may send in a cycle.
    pub const fn budget(&self) -> usize {
        self.budget
    }

    /// Posts when cyclic frames leave next.
    #[inline(always)]
    pub fn expect_cycle(&self, at: Instant) {
        self.next_cycle.store(at.0, Ordering::Relaxed);
    }

    /// Posts when a frame of this cycle is sent again if it is not back by then.
    #[inline(always)]
    pub fn expect_try(&self, at: Instant) {
        self.next_try.store(at.0, Ordering::Relaxed);
    }

    /// Notes a frame of `length` bytes without FCS that leaves now, or as soon as the interface is free.
    #[inline(always)]
    pub fn occupy(&self, half: Half, now: Instant, length: usize) {
        let until = self.free_at(now).0.saturating_add(wire_time_ns(length));
        self.free[half as usize].store(until, Ordering::Relaxed);
        if half == Half::Acyclic {
            let next = self.next_cycle.load(Ordering::Relaxed);
            let spent = self.spent_before(next) + length as u64;
            self.spent[0].store(next, Ordering::Relaxed);
            self.spent[1].store(spent, Ordering::Relaxed);
        }
    }

    /// Bytes that the acyclic half has sent in the cycle that ends at `next`.
    fn spent_before(&self, next: u64) -> u64 {
        let [of, spent] = &self.spent;
        if of.load(Ordering::Relaxed) == next { spent.load(Ordering::Relaxed) } else { 0 }
    }

    #[inline(always)]
    fn free_at(&self, now: Instant) -> Instant {
        let [cyclic, acyclic] = &self.free;
        Instant(now.0.max(cyclic.load(Ordering::Relaxed)).max(acyclic.load(Ordering::Relaxed)))
    }

    /// Bytes that the acyclic half may still send before the next cycle's frames.
    pub fn bytes(&self, now: Instant) -> usize {
        let next = self.next_cycle.load(Ordering::Relaxed);
        if next == Instant::NEVER.0 || now.0.saturating_sub(next) > SILENCE_NS {
            return usize::MAX;
        }
        let end = Instant(next).min(self.reserved_from(now));
        let free = self.free_at(now).0.saturating_add(GUARD_NS);
        let bytes = end.0.saturating_sub(free) / BYTE_TIME_NS;
        let room = usize::try_from(bytes).unwrap_or(usize::MAX).saturating_sub(WIRE_OVERHEAD);
        let spent = usize::try_from(self.spent_before(next)).unwrap_or(usize::MAX);
        let left = room.min(self.budget.saturating_sub(spent));
        // No frame is shorter on the wire.
        if left < MIN_FRAME { 0 } else { left }
    }

    /// When the wire is kept free for a second try; never if none is expected.
    fn reserved_from(&self, now: Instant) -> Instant {
        let next_try = Instant(self.next_try.load(Ordering::Relaxed));
        if now.since(next_try) > TRY_OVERDUE { Instant::NEVER } else { next_try }
    }

    /// Whether the cyclic half runs: it has announced a cycle, or has sent a moment ago.
    fn is_cyclic(&self, now: Instant) -> bool {
        let next = self.next_cycle.load(Ordering::Relaxed);
        let last =
            if next == Instant::NEVER.0 { self.free[Half::Cyclic as usize].load(Ordering::Relaxed) } else { next };
        now.0.saturating_sub(last) <= SILENCE_NS
    }

    /// When to read again what the cyclic half posts: right after the next cycle has begun, so once per cycle. Never
    /// without cycles, because nothing is posted then.
    pub fn next_reading(&self, now: Instant) -> Instant {
        if !self.is_cyclic(now) {
            return Instant::NEVER;
        }
        let next = Instant(self.next_cycle.load(Ordering::Relaxed));
        let earliest = now + SHORTEST_READING;
        if next == Instant::NEVER { earliest } else { (next + LOOK_AGAIN).max(earliest) }
    }

    /// When to check again for room on the wire.
    pub fn look_again(&self, now: Instant) -> Instant {
        if self.reserved_from(now) != Instant::NEVER {
            // Mostly the frame comes back long before.
            return now + LOOK_AGAIN;
        }
        let next = Instant(self.next_cycle.load(Ordering::Relaxed));
        next.max(now) + LOOK_AGAIN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    // covers: threads
    #[test]
    fn acyclic_frames_end_before_the_next_cycle_begins() {
        let window = Window::default();
        assert_eq!(window.bytes(Instant(0)), usize::MAX, "no cyclic frames are sent");
        window.expect_cycle(Instant(MS));
        let bytes = window.bytes(Instant(0));
        assert!(wire_time_ns(bytes) <= MS && wire_time_ns(bytes) > MS * 9 / 10, "{bytes}");
        window.occupy(Half::Cyclic, Instant(0), 1_000);
        window.occupy(Half::Acyclic, Instant(0), 1_000);
        let left = window.bytes(Instant(0));
        assert!(bytes - left >= 2_000, "two frames stand in the queue of the interface: {left}");
        assert_eq!(window.bytes(Instant(MS - 10_000)), 0);
        assert_eq!(window.bytes(Instant(MS + 10_000)), 0, "the cycle is due");
        assert!(window.look_again(Instant(MS - 10_000)) > Instant(MS));
    }

    // covers: byte-budget
    #[test]
    fn a_budget_is_for_a_cycle_and_never_less_than_a_frame() {
        let window = Window::new(4_000);
        window.occupy(Half::Acyclic, Instant(0), 9_000);
        window.expect_cycle(Instant(10 * MS));
        assert_eq!(window.bytes(Instant(MS)), 4_000, "what was sent before the cycles is not counted");
        window.occupy(Half::Acyclic, Instant(MS), 1_514);
        window.occupy(Half::Acyclic, Instant(MS), 1_514);
        assert_eq!(window.bytes(Instant(MS)), 972);
        window.occupy(Half::Cyclic, Instant(MS), 1_514);
        assert_eq!(window.bytes(Instant(MS)), 972, "process data has no budget");
        window.occupy(Half::Acyclic, Instant(MS), 1_514);
        assert_eq!(window.bytes(Instant(2 * MS)), 0);
        window.expect_cycle(Instant(20 * MS));
        assert_eq!(window.bytes(Instant(10 * MS)), 4_000);
        let least = Window::new(0);
        least.expect_cycle(Instant(10 * MS));
        assert_eq!(least.bytes(Instant(0)), MAX_FRAME);
    }

    // covers: threads
    #[test]
    fn posted_words_are_read_once_per_cycle_and_never_without_cycles() {
        let window = Window::default();
        assert_eq!(window.next_reading(Instant(50 * MS)), Instant::NEVER);
        window.expect_cycle(Instant(54 * MS));
        assert_eq!(window.next_reading(Instant(50 * MS)), Instant(54 * MS) + LOOK_AGAIN);
        assert_eq!(window.next_reading(Instant(54 * MS)), Instant(54 * MS) + SHORTEST_READING, "the cycle is late");
        assert_eq!(window.next_reading(Instant(54 * MS + SILENCE_NS + 1)), Instant::NEVER, "the cycles have ended");
        window.expect_cycle(Instant::NEVER);
        assert_eq!(window.next_reading(Instant(50 * MS)), Instant::NEVER);
        window.occupy(Half::Cyclic, Instant(50 * MS), 60);
        assert_eq!(window.next_reading(Instant(50 * MS)), Instant(50 * MS) + SHORTEST_READING, "cycles back to back");
    }

    // covers: threads, lost-frames
    #[test]
    fn acyclic_frames_end_before_a_second_try_unless_it_is_overdue() {
        let window = Window::default();
        window.expect_cycle(Instant(MS));
        let whole = window.bytes(Instant(0));
        window.expect_try(Instant(MS / 4));
        let before = window.bytes(Instant(0));
        assert!(wire_time_ns(before) <= MS / 4 && before > 1_514, "{before}");
        assert_eq!(window.bytes(Instant(MS / 4 - 10_000)), 0, "the second try leaves soon");
        assert_eq!(window.look_again(Instant(MS / 4)), Instant(MS / 4) + LOOK_AGAIN);
        assert_eq!(window.bytes(Instant(MS / 4) + TRY_OVERDUE), 0, "it leaves late");
        let late = Instant(MS / 4 + 1) + TRY_OVERDUE;
        assert!(window.bytes(late) > 1_514, "nothing decides on it");
        assert!(window.look_again(late) > Instant(MS));
        window.expect_try(Instant::NEVER);
        assert_eq!(window.bytes(Instant(0)), whole, "all frames are back");
    }

    // covers: threads
    #[test]
    fn a_silent_cyclic_half_does_not_block_acyclic_frames() {
        let window = Window::default();
        window.expect_cycle(Instant(MS));
        assert_eq!(window.bytes(Instant(MS + SILENCE_NS)), 0);
        assert_eq!(window.bytes(Instant(MS + SILENCE_NS + 1)), usize::MAX);
    }
}
