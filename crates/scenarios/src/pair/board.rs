//! What a program shows of itself, and the requests to it.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use ringcat::standby::{ForwardingCounters, RoleRequest};
use ringcat::{Instant, RingState};

use crate::ethernet_peer::EthernetPeer;

/// What a MainDevice does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Phase {
    /// Its program has not begun, or has ended.
    #[default]
    Ended,
    /// It forwards.
    Inactive,
    /// It scans, configures, and brings SubDevices to OP, or stops them: their states change.
    Starting,
    /// It exchanges process data with SubDevices in OP.
    Active,
}

/// What a program has seen.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// What it does.
    pub phase: Phase,
    /// Cycles with process data in OP.
    pub cycles: u64,
    /// Of these, those whose process data was not complete.
    pub incomplete: u64,
    /// Whether that of the last one was.
    pub is_last_complete: bool,
    /// State of the ring in the ACTIVE.
    pub ring: RingState,
    /// What an INACTIVE has forwarded.
    pub forwarded: ForwardingCounters,
    /// Why an ACTIVE could not begin.
    pub failure: Option<String>,
    /// Frames of another MainDevice that the ACTIVE has received.
    pub foreign: u64,
    /// The phase before, and when it ended.
    pub before: (Phase, Instant),
    /// Whether the other MainDevice could take over, as determined by the ACTIVE.
    pub is_other_ready: bool,
    /// Cycles of an INACTIVE that follows, since it began.
    pub followed: u64,
    /// Outputs that an INACTIVE has seen were written so many cycles before, at most.
    pub oldest_followed: u64,
    /// Takeovers in which it has configured all SubDevices again.
    pub cold_takeovers: u32,
    /// Events of MainDevice redundancy, as text.
    pub events: Vec<String>,
    /// Ethernet frames to and from the other one.
    pub ethernet: EthernetPeer,
}

impl Seen {
    /// What it did at a time that is not long ago.
    pub fn phase_at(&self, at: Instant) -> Phase {
        if at < self.before.1 { self.before.0 } else { self.phase }
    }

    /// It does something else from now on.
    pub fn begin(&mut self, phase: Phase, now: Instant) {
        if phase != self.phase {
            self.before = (std::mem::replace(&mut self.phase, phase), now);
        }
    }
}

/// What a program is to request before its next cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// A role.
    Role(RoleRequest),
    /// The role INACTIVE, and permanent standby.
    Hold,
}

/// Shared by a program and the test.
#[derive(Debug, Default)]
pub struct Board {
    seen: Mutex<Seen>,
    is_asked_to_stop: AtomicBool,
    /// Ethernet frames per cycle.
    frames_per_cycle: AtomicUsize,
    request: Mutex<Option<Asked>>,
}

impl Board {
    /// Of a program that begins with this.
    pub fn new(phase: Phase) -> Board {
        let seen = Seen { phase, ..Seen::default() };
        Board { seen: Mutex::new(seen), ..Board::default() }
    }

    /// A copy of what was seen.
    pub fn seen(&self) -> Seen {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Notes something.
    pub fn note(&self, change: impl FnOnce(&mut Seen)) {
        change(&mut self.seen.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// The program is to request something.
    pub fn ask_for(&self, request: Asked) {
        *self.request.lock().unwrap_or_else(PoisonError::into_inner) = Some(request);
    }

    /// Which.
    pub fn take_request(&self) -> Option<Asked> {
        self.request.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// The program is to have Ethernet to the other one, and to send this number of frames in each cycle.
    pub fn set_frames_per_cycle(&self, frames: usize) {
        self.frames_per_cycle.store(frames, Ordering::Relaxed);
    }

    /// That number.
    pub fn frames_per_cycle(&self) -> usize {
        self.frames_per_cycle.load(Ordering::Relaxed)
    }

    /// The program is to stop in order.
    pub fn ask_to_stop(&self) {
        self.is_asked_to_stop.store(true, Ordering::Relaxed);
    }

    /// Whether it is.
    pub fn is_asked_to_stop(&self) -> bool {
        self.is_asked_to_stop.load(Ordering::Relaxed)
    }
}
