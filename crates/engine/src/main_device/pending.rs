//! A procedure whose result is fetched later.

use alloc::rc::Rc;
use core::cell::{Cell, RefCell};
use core::fmt;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use crate::supervisor::{Bus, Signal};

struct Slot<T> {
    result: RefCell<Option<T>>,
    given_up: Cell<bool>,
    signal: Signal,
}

/// A procedure under way. When it is dropped the procedure is cancelled: an SDO transfer is aborted, other mail is not
/// affected.
pub struct Pending<T> {
    slot: Rc<Slot<T>>,
    running: Rc<Cell<bool>>,
}

impl<T: 'static> Pending<T> {
    /// Starts a procedure.
    pub(super) fn start(bus: &Bus, work: impl Future<Output = T> + 'static) -> Pending<T> {
        let slot = Rc::new(Slot { result: RefCell::new(None), given_up: Cell::new(false), signal: bus.signal() });
        let running = Rc::new(Cell::new(true));
        let (own, still) = (slot.clone(), Running(running.clone()));
        bus.spawn(async move {
            let _still = still;
            let mut work = pin!(work);
            let mut stop = pin!(own.signal.until(|| own.given_up.get().then_some(())));
            let result = poll_fn(|context| {
                if stop.as_mut().poll(context).is_ready() {
                    return Poll::Ready(None);
                }
                work.as_mut().poll(context).map(Some)
            });
            *own.result.borrow_mut() = result.await;
            own.signal.notify();
        });
        Pending { slot, running }
    }
}

/// Marks the procedure as ended, also if its task is dropped.
struct Running(Rc<Cell<bool>>);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.set(false);
    }
}

impl<T> Pending<T> {
    /// The result, once; `None` while the procedure runs, and after the result was taken.
    pub fn take(&mut self) -> Option<T> {
        self.slot.result.borrow_mut().take()
    }

    /// Waits for the result, in another procedure of the same MainDevice.
    pub async fn ended(self) -> T {
        self.slot.signal.until(|| self.slot.result.borrow_mut().take()).await
    }

    /// Whether the procedure runs. A procedure that was ended by a stop of the MainDevice, or because it is INACTIVE
    /// now, has no result.
    pub fn is_running(&self) -> bool {
        self.running.get()
    }
}

impl<T> Drop for Pending<T> {
    fn drop(&mut self) {
        self.slot.given_up.set(true);
        if self.running.get() {
            self.slot.signal.notify();
        }
    }
}

impl<T> fmt::Debug for Pending<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pending").field("running", &self.running.get()).finish_non_exhaustive()
    }
}
