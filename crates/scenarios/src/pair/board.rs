//! What a program shows of itself, and what it is asked for.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use ringcat::RingState;
use ringcat::standby::ForwardingCounters;

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
    /// The ring as the ACTIVE sees it.
    pub ring: RingState,
    /// What an INACTIVE has forwarded.
    pub forwarded: ForwardingCounters,
    /// Why an ACTIVE could not begin.
    pub failure: Option<String>,
    /// Frames of another MainDevice that the ACTIVE has received.
    pub foreign: u64,
}

/// Shared by a program and the test.
#[derive(Debug, Default)]
pub struct Board {
    seen: Mutex<Seen>,
    is_asked_to_stop: AtomicBool,
}

impl Board {
    /// Of a program that begins with this.
    pub fn new(phase: Phase) -> Board {
        let seen = Seen { phase, ..Seen::default() };
        Board { seen: Mutex::new(seen), is_asked_to_stop: AtomicBool::new(false) }
    }

    /// A copy of what was seen.
    pub fn seen(&self) -> Seen {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Notes something.
    pub fn note(&self, change: impl FnOnce(&mut Seen)) {
        change(&mut self.seen.lock().unwrap_or_else(PoisonError::into_inner));
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
