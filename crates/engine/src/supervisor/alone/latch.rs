//! Sends a frame alone on the wire, and manages the exclusive right to latch times with it.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::future::{Future, poll_fn};
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use crate::link::Link;
use crate::supervisor::bus::Bus;
use crate::supervisor::reply::{BusError, Reply};
use crate::supervisor::shared_cell::SharedCell;
use crate::supervisor::transfer::Request;

impl Bus {
    /// Sends a datagram once, alone on the wire, and returns the reply, whatever its working counter. Copies sent on
    /// the link `no_return` are known not to return.
    ///
    /// The future fails with [`BusError::Busy`] if the wire was never free, with [`BusError::Disturbed`] if a cyclic
    /// frame was sent while this one was on the wire, with [`BusError::Lost`] if a copy of this frame, or of a cyclic
    /// frame, did not return.
    pub(crate) fn alone(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
        no_return: Option<Link>,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        self.submit(Request { alone: Some(no_return.map_or(0, Link::bit)), ..Request::once(command, target, data) })
    }

    /// Waits for the exclusive right to latch receive times.
    pub(crate) async fn latch_turn(&self) -> Turn {
        poll_fn(|_| {
            let shared = &mut *self.shared.borrow_mut();
            if !core::mem::replace(&mut shared.alone.is_taken, true) {
                return Poll::Ready(());
            }
            let task = shared.current;
            if !shared.alone.want_turn.contains(&task) {
                shared.alone.want_turn.push(task);
            }
            Poll::Pending
        })
        .await;
        Turn { shared: self.shared.clone() }
    }

    /// Requests that the cyclic half begins no cycle for a time.
    pub(crate) fn ask_for_pause(&self, time: Duration) {
        let shared = self.shared.borrow();
        if let Some(board) = &shared.board {
            board.traffic.ask_for_pause(shared.now + time);
        }
    }
}

/// The exclusive right to latch receive times, until it is dropped: SubDevices keep the latched times until the next
/// latching datagram.
pub(crate) struct Turn {
    shared: Rc<SharedCell>,
}

impl Drop for Turn {
    fn drop(&mut self) {
        let shared = &mut *self.shared.borrow_mut();
        shared.alone.is_taken = false;
        for task in core::mem::take(&mut shared.alone.want_turn) {
            shared.wake(task);
        }
    }
}
