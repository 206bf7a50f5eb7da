//! Whether a process still has its bus, for any thread of it.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, OnceLock};

/// Whether a process has the bus that a daemon has handed over to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Ownership {
    /// The process has the bus.
    Held,
    /// The process has the bus, and the daemon has ended: a new daemon waits for the end of this process.
    DaemonEnded,
    /// The daemon drives the bus again: what this process sends reaches no SubDevice.
    TakenBack,
    /// The process has given the bus back.
    Released,
}

impl Ownership {
    const ALL: [Ownership; 4] = [Ownership::Held, Ownership::DaemonEnded, Ownership::TakenBack, Ownership::Released];
}

/// Shows whether a process has its bus. Reading is one atomic load, also in a cyclic thread.
#[derive(Clone, Debug, Default)]
pub struct OwnershipWatch(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// Place in [`Ownership::ALL`].
    now: AtomicU8,
    cause: OnceLock<String>,
}

impl OwnershipWatch {
    /// Whether this process has the bus.
    pub fn now(&self) -> Ownership {
        let place = self.0.now.load(Ordering::Acquire);
        Ownership::ALL[usize::from(place) % Ownership::ALL.len()]
    }

    /// Whether the daemon drives the bus again without a release.
    #[inline]
    pub fn is_taken_back(&self) -> bool {
        self.0.now.load(Ordering::Relaxed) == Ownership::TakenBack as u8
    }

    /// Why the daemon has taken the bus back; empty if it has not.
    pub fn cause(&self) -> &str {
        self.0.cause.get().map_or("", String::as_str)
    }

    /// The daemon has taken the bus back.
    pub(super) fn taken_back(&self, cause: String) {
        // The first cause is kept.
        let _ = self.0.cause.set(cause);
        self.leave_held(Ownership::TakenBack);
    }

    /// The connection to the daemon has ended.
    pub(super) fn daemon_ended(&self) {
        self.leave_held(Ownership::DaemonEnded);
    }

    /// The bus is given back; how it was before.
    pub(super) fn release(&self) -> Ownership {
        let before = self.0.now.swap(Ownership::Released as u8, Ordering::AcqRel);
        Ownership::ALL[usize::from(before) % Ownership::ALL.len()]
    }

    /// A bus that was given back stays so.
    fn leave_held(&self, to: Ownership) {
        let (held, to) = (Ownership::Held as u8, to as u8);
        let _ = self.0.now.compare_exchange(held, to, Ordering::AcqRel, Ordering::Acquire);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_loss_is_seen_with_its_cause_and_a_release_is_none() {
        let watch = OwnershipWatch::default();
        assert_eq!((watch.now(), watch.is_taken_back(), watch.cause()), (Ownership::Held, false, ""));
        let other = watch.clone();
        other.taken_back("its process was stopped".to_owned());
        other.daemon_ended();
        assert_eq!((watch.now(), watch.cause()), (Ownership::TakenBack, "its process was stopped"));
        assert!(watch.is_taken_back());
        let watch = OwnershipWatch::default();
        assert_eq!(watch.release(), Ownership::Held);
        watch.daemon_ended();
        assert_eq!(watch.now(), Ownership::Released);
        for (place, state) in Ownership::ALL.into_iter().enumerate() {
            assert_eq!(state as usize, place);
        }
    }
}
