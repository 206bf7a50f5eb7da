//! Sends a frame alone on the wire, and manages the exclusive right to latch times with it.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use crate::link::Link;
use crate::supervisor::bus::Bus;
use crate::supervisor::reply::{BusError, Reply};
use crate::supervisor::shared::Shared;
use crate::supervisor::transfer::Request;

/// Pause between two checks whether another procedure has read its latched times.
const TURN_LOOK: Duration = Duration::from_micros(100);

impl Bus {
    /// Sends a datagram once, alone on the wire, and returns the reply, whatever its working counter. Copies on the
    /// link `deaf` are known not to return.
    ///
    /// The future fails with [`BusError::Busy`] where the wire was never free, with [`BusError::Disturbed`] where a
    /// cyclic frame left while it was on the wire, with [`BusError::Lost`] where a copy of it, or of cyclic frames, did
    /// not return.
    pub(crate) fn alone(
        &self,
        command: Command,
        target: Target,
        data: Vec<u8>,
        deaf: Option<Link>,
    ) -> impl Future<Output = Result<Reply, BusError>> {
        self.submit(Request { alone: Some(deaf.map_or(0, Link::bit)), ..Request::once(command, target, data) })
    }

    /// Waits for the exclusive right to latch.
    pub(crate) async fn latch_turn(&self) -> Turn {
        while core::mem::replace(&mut self.shared.borrow_mut().alone.is_taken, true) {
            self.sleep(TURN_LOOK).await;
        }
        Turn { shared: self.shared.clone() }
    }

    /// Asks the cyclic half to begin no cycle for a time.
    pub(crate) fn ask_for_pause(&self, time: Duration) {
        let shared = self.shared.borrow();
        if let Some(board) = &shared.board {
            board.traffic.ask_for_pause(shared.now + time);
        }
    }
}

/// The exclusive right to latch, until it is dropped: latched times hold until the next frame of this kind.
pub(crate) struct Turn {
    shared: Rc<RefCell<Shared>>,
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.shared.borrow_mut().alone.is_taken = false;
    }
}
