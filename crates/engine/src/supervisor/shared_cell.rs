//! The common state behind one access, which notes when the state may have changed.
//!
//! An application with one thread checks in each pass of its waits whether the acyclic half has work. The answer
//! changes only with the state, which changes only through [`SharedCell::borrow_mut`], and with words that others post.

use core::cell::{Cell, Ref, RefCell, RefMut};

use super::shared::Shared;
use crate::time::Instant;

pub(crate) struct SharedCell {
    shared: RefCell<Shared>,
    /// When there is work, posted words aside; `None` if the state may have changed since.
    due: Cell<Option<Due>>,
}

/// When there is work.
#[derive(Clone, Copy)]
struct Due {
    /// Deadline of [`super::Supervisor::poll`].
    deadline: Instant,
    /// Deadline of any work: in the past for work that does not wait for a time.
    any: Instant,
}

impl SharedCell {
    pub(crate) fn new(shared: Shared) -> SharedCell {
        SharedCell { shared: RefCell::new(shared), due: Cell::new(None) }
    }

    /// The state, to be read.
    #[inline]
    pub(crate) fn borrow(&self) -> Ref<'_, Shared> {
        self.shared.borrow()
    }

    /// The state, to be changed.
    #[inline]
    pub(crate) fn borrow_mut(&self) -> RefMut<'_, Shared> {
        self.due.set(None);
        self.shared.borrow_mut()
    }

    /// When there is work: for [`super::Supervisor::poll`], a datagram to send, or a request to the link layer. In the
    /// past for work that does not wait for a time, never without work.
    #[inline(always)]
    pub(crate) fn due_at(&self) -> Instant {
        self.next_of(|due| due.any)
    }

    /// The latest time of the next [`super::Supervisor::poll`], received frames aside; never if it has no work.
    #[inline]
    pub(crate) fn next_deadline(&self) -> Instant {
        self.next_of(|due| due.deadline)
    }

    #[inline(always)]
    fn next_of(&self, kind: impl Fn(Due) -> Instant) -> Instant {
        let shared = self.shared.borrow();
        let due = match self.due.get() {
            Some(known) => known,
            None => self.find_due(&shared),
        };
        if shared.is_posted() { kind(due).min(shared.now) } else { kind(due) }
    }

    #[inline(never)]
    fn find_due(&self, shared: &Shared) -> Due {
        let deadline = shared.own_deadline();
        let due = Due { deadline, any: if shared.has_work() { Instant::default() } else { deadline } };
        self.due.set(Some(due));
        due
    }
}
