//! Links whose own use of memory does not count: a simulated segment allocates, the cyclic path must not.

use std::cell::Cell;

use ringcat::{Instant, Link, Links, PerLink};
use ringcat_wire::frame::MacAddress;
use scenarios::counting_allocator::counts;

thread_local! {
    /// Allocations and deallocations of this thread within its links.
    static INSIDE: Cell<u64> = const { Cell::new(0) };
}

/// Allocations and deallocations of this thread so far.
fn all() -> u64 {
    let counts = counts();
    counts.allocations + counts.deallocations
}

/// Those outside of its links.
pub fn used() -> u64 {
    all() - INSIDE.get()
}

/// Runs what belongs to the links.
fn inside<T>(work: impl FnOnce() -> T) -> T {
    let before = all();
    let result = work();
    INSIDE.set(INSIDE.get() + all() - before);
    result
}

/// Links whose own use of memory does not count.
#[derive(Debug)]
pub struct OutsideLinks<L>(pub L);

impl<L: Links> Links for OutsideLinks<L> {
    fn now(&self) -> Instant {
        self.0.now()
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.0.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        inside(|| self.0.send(link, frame));
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let mut taking = 0;
        let any = inside(|| {
            self.0.receive(&mut |link, frame| {
                let before = all();
                take(link, frame);
                taking += all() - before;
            })
        });
        INSIDE.set(INSIDE.get() - taking);
        any
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.0.carrier(link)
    }

    fn wait(&mut self, until: Instant) {
        inside(|| self.0.wait(until));
    }
}
