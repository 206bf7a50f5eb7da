//! Work whose result is asked for from another thread: the work stays here, a ticket travels.

use alloc::boxed::Box;
use alloc::collections::BTreeMap;
use core::any::Any;
use core::fmt;
use core::marker::PhantomData;

use super::pending::Pending;

/// Stands for work that is parked; it may go to another thread.
pub struct Ticket<T> {
    number: u64,
    result: PhantomData<fn() -> T>,
}

impl<T> fmt::Debug for Ticket<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Ticket({})", self.number)
    }
}

/// Work that is parked.
#[derive(Default)]
pub(super) struct Cloakroom {
    last: u64,
    parked: BTreeMap<u64, Box<dyn Any>>,
}

impl fmt::Debug for Cloakroom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Cloakroom({})", self.parked.len())
    }
}

impl Cloakroom {
    pub(super) fn park<T: 'static>(&mut self, pending: Pending<T>) -> Ticket<T> {
        self.last += 1;
        self.parked.insert(self.last, Box::new(pending));
        Ticket { number: self.last, result: PhantomData }
    }

    /// Gives work up.
    pub(super) fn discard<T>(&mut self, ticket: &Ticket<T>) {
        self.parked.remove(&ticket.number);
    }

    /// The result, once; `Some(None)` where there will be none, `None` while the work goes on.
    pub(super) fn collect<T: 'static>(&mut self, ticket: &Ticket<T>) -> Option<Option<T>> {
        let Some(pending) = self.parked.get_mut(&ticket.number).and_then(|any| any.downcast_mut::<Pending<T>>()) else {
            return Some(None);
        };
        let running = pending.is_running();
        let result = pending.take();
        if result.is_none() && running {
            return None;
        }
        self.parked.remove(&ticket.number);
        Some(result)
    }
}
