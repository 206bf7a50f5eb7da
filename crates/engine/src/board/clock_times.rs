//! What the two halves exchange about the application's time and that of the clocks.
//!
//! *Application time* is what the application gives, *system time* what the clocks show. They are the same, or differ
//! by a shift: SYNC signals run on with the system time when the application's time jumps.

use core::sync::atomic::{AtomicBool, AtomicI64, AtomicU32, AtomicU64, Ordering};

/// System time of the clocks, as the supervisor posts it for the exchange.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Timeline {
    /// Number of posts.
    pub number: u32,
    /// Sum of all jumps of the system time.
    pub jumped: u64,
    /// Application time minus system time, once all is made up.
    pub shift: u64,
    /// Nanoseconds by which the system time goes back until then; negative: forward.
    pub left: i64,
    /// Nanoseconds by which it had gone back in steps when this was posted.
    pub slid: u64,
    /// System time of the reference clock at host time zero.
    pub epoch: u64,
    /// The shift was read from clocks that another MainDevice has set up, and is as exact as one reading.
    pub is_adopted: bool,
}

/// The time towards which the reference is steered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// Application time at host time zero.
    pub epoch: u64,
    /// The part of a new shift that is in effect: application time minus the system time that is written.
    pub shift: u64,
    /// Number of times that were given.
    pub number: u32,
}

/// The shared words.
#[derive(Debug, Default)]
pub(crate) struct TimeWords {
    /// The first time that the application has set, 0 before, and the same at host time zero.
    first: AtomicU64,
    first_epoch: AtomicU64,
    wanted_epoch: AtomicU64,
    wanted_shift: AtomicU64,
    wanted_number: AtomicU32,
    jumped: AtomicU64,
    shift: AtomicU64,
    left: AtomicI64,
    slid_before: AtomicU64,
    epoch: AtomicU64,
    is_adopted: AtomicBool,
    number: AtomicU32,
    /// Nanoseconds by which the system time has gone back in steps.
    slid: AtomicU64,
    /// Changes to which the supervisor reacts: a first time, a time far from the reference, references taken over.
    posted: AtomicU32,
    /// Number of posts of references that the exchange has taken over.
    taken: AtomicU32,
    is_called: AtomicBool,
}

impl TimeWords {
    /// Posts a time of the application at a host time; only the first counts, and 0 is none.
    pub fn post_application_time(&self, time: u64, now: u64) {
        if self.first.load(Ordering::Relaxed) == 0 && time != 0 {
            self.first_epoch.store(time.wrapping_sub(now), Ordering::Relaxed);
            self.first.store(time, Ordering::Release);
            self.wake_supervisor();
        }
    }

    /// The first time that the application has set.
    pub fn first(&self) -> Option<u64> {
        Some(self.first.load(Ordering::Acquire)).filter(|time| *time != 0)
    }

    /// The same at host time zero.
    pub fn first_epoch(&self) -> Option<u64> {
        self.first().map(|_| self.first_epoch.load(Ordering::Relaxed))
    }

    /// Posts the time towards which the reference is steered, at host time zero, and the shift in effect.
    pub fn post_wanted(&self, epoch: u64, shift: u64) {
        self.wanted_epoch.store(epoch, Ordering::Relaxed);
        self.wanted_shift.store(shift, Ordering::Relaxed);
        let number = self.wanted_number.load(Ordering::Relaxed);
        self.wanted_number.store(number.wrapping_add(1).max(1), Ordering::Release);
    }

    /// The time towards which the reference is steered; `None` if it is not. A time that is being posted may be read
    /// with the shift of another one: single values are compared with others before they count.
    pub fn wanted(&self) -> Option<Wanted> {
        let number = self.wanted_number.load(Ordering::Acquire);
        let (epoch, shift) = (self.wanted_epoch.load(Ordering::Relaxed), self.wanted_shift.load(Ordering::Relaxed));
        (number != 0).then_some(Wanted { epoch, shift, number })
    }

    /// Posts the system time; takes effect with the next post of references.
    pub fn post_timeline(&self, timeline: Timeline) {
        self.jumped.store(timeline.jumped, Ordering::Relaxed);
        self.shift.store(timeline.shift, Ordering::Relaxed);
        self.left.store(timeline.left, Ordering::Relaxed);
        self.slid_before.store(timeline.slid, Ordering::Relaxed);
        self.epoch.store(timeline.epoch, Ordering::Relaxed);
        self.is_adopted.store(timeline.is_adopted, Ordering::Relaxed);
        self.number.store(timeline.number, Ordering::Release);
    }

    /// The posted system time.
    pub fn timeline(&self) -> Timeline {
        Timeline {
            number: self.number.load(Ordering::Acquire),
            jumped: self.jumped.load(Ordering::Relaxed),
            shift: self.shift.load(Ordering::Relaxed),
            left: self.left.load(Ordering::Relaxed),
            slid: self.slid_before.load(Ordering::Relaxed),
            epoch: self.epoch.load(Ordering::Relaxed),
            is_adopted: self.is_adopted.load(Ordering::Relaxed),
        }
    }

    /// The offsets of all clocks are being written: their system time goes back to so many nanoseconds since the
    /// beginning.
    pub fn post_slid(&self, slid: u64) {
        self.slid.store(slid, Ordering::Release);
    }

    /// Nanoseconds by which the system time has gone back in steps.
    pub fn slid(&self) -> u64 {
        self.slid.load(Ordering::Acquire)
    }

    /// Wakes the supervisor: the application's time is far from that of the reference.
    pub fn wake_supervisor(&self) {
        let posted = self.posted.load(Ordering::Relaxed);
        self.posted.store(posted.wrapping_add(1), Ordering::Release);
    }

    /// Number of changes to which the supervisor reacts.
    pub fn posted(&self) -> u32 {
        self.posted.load(Ordering::Acquire)
    }

    /// The exchange has taken over the references with this number: later frames distribute no others.
    pub fn take(&self, references: u32) {
        self.taken.store(references, Ordering::Relaxed);
        self.wake_supervisor();
    }

    /// Number of the references that the exchange has taken over.
    pub fn taken(&self) -> u32 {
        self.taken.load(Ordering::Relaxed)
    }

    /// Sets whether the application calls for each distribution of time.
    pub fn post_called(&self, is_called: bool) {
        self.is_called.store(is_called, Ordering::Relaxed);
    }

    /// Whether the application calls for each distribution of time.
    pub fn is_called(&self) -> bool {
        self.is_called.load(Ordering::Relaxed)
    }
}
