//! Rescans that are requested without an application. The watch of idle operation carries them out, so that it does not
//! scan at the same time by itself.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};

use ringcat_wire::address::{Position, StationAddress};

use crate::ring_status::LinkCounts;
use crate::supervisor::{Bus, Signal};

/// What a rescan without an application has found to be different.
#[derive(Clone, Debug, Default)]
pub(crate) struct Differences {
    /// SubDevices on each link.
    pub counts: LinkCounts,
    /// SubDevices that have got an address.
    pub added: Vec<StationAddress>,
    /// SubDevices that do not answer any more.
    pub removed: Vec<StationAddress>,
    /// Those that are at another place among the others, with their positions before.
    pub moved: Vec<(StationAddress, Position)>,
}

/// Requests and the last result.
#[derive(Clone, Debug)]
pub(crate) struct IdleRescans {
    /// Number of the last request.
    asked: Rc<Cell<u64>>,
    /// The requests up to this number have this result.
    ended: Rc<RefCell<(u64, Differences)>>,
    changed: Signal,
}

impl IdleRescans {
    pub(crate) fn new(bus: &Bus) -> IdleRescans {
        IdleRescans { asked: Rc::default(), ended: Rc::default(), changed: bus.signal() }
    }

    /// Requests a rescan that begins from now on, and waits for its result.
    pub(super) async fn request(&self) -> Differences {
        let number = self.asked.get() + 1;
        self.asked.set(number);
        let result = || {
            let ended = self.ended.borrow();
            (ended.0 >= number).then(|| ended.1.clone())
        };
        self.changed.until(result).await
    }

    /// The number of the last request, if it has no result yet.
    pub(super) fn wanted(&self) -> Option<u64> {
        Some(self.asked.get()).filter(|asked| *asked > self.ended.borrow().0)
    }

    /// Ends the requests up to a number.
    pub(super) fn end(&self, number: u64, differences: Differences) {
        *self.ended.borrow_mut() = (number, differences);
        self.changed.notify();
    }
}
