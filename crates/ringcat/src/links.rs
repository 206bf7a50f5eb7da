//! What a MainDevice sends and receives through, and where its time comes from.

use std::task::Waker;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_wire::frame::MacAddress;

/// One or two network interfaces with a clock.
///
/// Links belong to one thread, which calls these in turn. [`Links::send`] and [`Links::receive`] are called in the
/// cyclic path and neither allocate nor wait.
pub trait Links {
    /// Host time.
    fn now(&self) -> Instant;

    /// Addresses of the main interface and, if there is one, of the redundant interface.
    fn addresses(&self) -> (MacAddress, Option<MacAddress>);

    /// Sends a frame, without FCS. A link that is down swallows it.
    fn send(&mut self, link: Link, frame: &[u8]);

    /// Hands the oldest frame that has arrived to `take`; false where there is none.
    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool;

    /// When the frame that was handed out last arrived at the interface, where these links know that better than by the
    /// time at which it was taken. It left at `sent_at`, and was taken at about `now`: a time that is not between them
    /// is determined anew. Without a system call.
    fn received_at(&mut self, _sent_at: Instant, _now: Instant) -> Option<Instant> {
        None
    }

    /// Whether an interface has a carrier; `None` where these links do not tell. Cheap: an atomic or two.
    fn carrier(&self, _link: Link) -> Option<bool> {
        None
    }

    /// A handle with which other threads end [`Links::wait`] and [`Links::wait_from`]; a wake-up before a wait
    /// ends it at once. `None` where these links have none: the acyclic half in a thread of its own then reads its
    /// requests every half millisecond.
    fn waker(&self) -> Option<Waker> {
        None
    }

    /// Waits until a frame has arrived or the time has come.
    fn wait(&mut self, until: Instant);

    /// As [`Links::wait`]; `now` was read just before, so these links need not read it again.
    fn wait_from(&mut self, _now: Instant, until: Instant) {
        self.wait(until);
    }

    /// Waits until the time has come. No frame is expected: one that arrives all the same may end the wait or not.
    fn sleep(&mut self, until: Instant) {
        self.wait(until);
    }

    /// Takes a link down so that its partner notices, or brings it back. False where that is not possible. Not called
    /// in the cyclic path of an application whose halves have threads of their own.
    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        let _ = (link, disconnect);
        false
    }
}
