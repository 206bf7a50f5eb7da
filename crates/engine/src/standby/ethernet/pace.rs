//! When acyclic master frames of the ACTIVE leave, and how long they are.
//!
//! Frames and answers that are known to wait leave at once, at most a number of master frames per period. Otherwise a
//! poll leaves in each period while there is traffic, and now and then without any.

use core::time::Duration;

use ringcat_wire::master_frame::MAX_ETHERNET;

use crate::time::Instant;

/// Most master frames per period.
pub(crate) const MOST_PER_PERIOD: u8 = 16;
/// Period of an ACTIVE that has no application.
pub(super) const PERIOD: Duration = Duration::from_millis(1);
/// Between two polls without traffic, or a period if that is longer.
const IDLE: Duration = Duration::from_millis(5);
/// Room in each poll: a frame that fits needs no poll of its own.
const ROOM: usize = 128;

/// When the Ethernet of this MainDevice has work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EthernetDue {
    /// The next time, if nothing is to be sent now.
    pub at: Instant,
    /// A master frame is to be sent now.
    pub is_now: bool,
}

/// Departures of the ACTIVE.
#[derive(Debug)]
pub(super) struct Pace {
    pub most: u8,
    pub period: Duration,
    pub is_active: bool,
    /// The first departure in this role.
    pub from: Instant,
    /// When the period began in which a master frame left last, and their number in it.
    pub begun_at: Instant,
    pub count: u8,
    pub sent_at: Option<Instant>,
    /// Number of the last master frame.
    pub poll: u32,
    /// The newest one with an answer.
    pub answered: Option<u32>,
    /// Bytes of the next frame of the other MainDevice; 0 without one.
    pub owed: usize,
    /// The last master frame had no frame of this MainDevice.
    pub has_yielded: bool,
    /// Frames waited when it was determined last what is due.
    pub had_frames: bool,
    /// Since when the next master frame does not fit the window.
    pub blocked_since: Option<Instant>,
}

impl Pace {
    pub fn new(most: u8) -> Pace {
        Pace {
            most: most.clamp(1, MOST_PER_PERIOD),
            period: PERIOD,
            is_active: false,
            from: Instant::default(),
            begun_at: Instant::default(),
            count: 0,
            sent_at: None,
            poll: 0,
            answered: None,
            owed: 0,
            has_yielded: false,
            had_frames: false,
            blocked_since: None,
        }
    }

    /// Notes the answer in a copy of a master frame; false if it is not newer than the ones before.
    pub fn note_answer(&mut self, poll: u32, next: u16) -> bool {
        let is_new = self.answered.is_none_or(|answered| poll.wrapping_sub(answered) as i32 > 0);
        if is_new {
            self.answered = Some(poll);
            self.owed = usize::from(next).min(MAX_ETHERNET);
        }
        is_new
    }

    /// When the next master frame leaves.
    pub fn next_at(&self, now: Instant, has_frames: bool, is_busy: bool) -> Instant {
        let has_room = self.count < self.most || now >= self.begun_at + self.period;
        let allowed = if has_room { self.from } else { self.begun_at + self.period };
        if has_frames || self.owed > 0 {
            return allowed;
        }
        let pause = if is_busy { self.period } else { IDLE.max(self.period) };
        self.sent_at.map_or(allowed, |at| (at + pause).max(allowed))
    }

    /// Bytes of the own frame and of the room for the other one in the next master frame.
    pub fn plan(&self, next: Option<usize>) -> (usize, usize) {
        let own = next.unwrap_or(0);
        let beside = MAX_ETHERNET - own;
        let least = ROOM.min(beside);
        match self.owed {
            // Both in turn.
            owed if owed > beside && !self.has_yielded => (0, owed.max(ROOM)),
            owed if owed > beside => (own, least),
            owed => (own, owed.max(least)),
        }
    }

    pub fn note_sent(&mut self, now: Instant, (own, room): (usize, usize)) {
        self.has_yielded = own == 0;
        if now >= self.begun_at + self.period {
            (self.begun_at, self.count) = (now, 0);
        }
        self.count += 1;
        self.sent_at = Some(now);
        self.blocked_since = None;
        if room >= self.owed {
            // The answer shows whether there is another one.
            self.owed = 0;
        }
    }
}
