//! The network interfaces of a MainDevice, and its clock.

use std::task::Waker;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
#[cfg(feature = "eoe")]
use ringcat_link::WakeUp;
use ringcat_wire::frame::{MAX_FRAME_VLAN, MacAddress};

/// What there is once for each link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PerLink<T> {
    /// Value of the main link.
    pub main: T,
    /// Value of the redundant link, in a ring.
    pub redundant: Option<T>,
}

impl<T> PerLink<T> {
    /// Of the main link, and of the redundant link if there is one.
    pub const fn new(main: T, redundant: Option<T>) -> PerLink<T> {
        PerLink { main, redundant }
    }
}

/// A frame that has arrived, while its place is held.
#[derive(Debug)]
#[non_exhaustive]
pub struct Arrived<'a> {
    /// The link on which it came.
    pub link: Link,
    /// When it arrived at the interface, or when it was taken if these links do not record that.
    pub at: Instant,
    /// The frame, which may be changed.
    pub frame: &'a mut [u8],
}

impl<'a> Arrived<'a> {
    /// A frame that arrived on a link.
    pub const fn new(link: Link, at: Instant, frame: &'a mut [u8]) -> Arrived<'a> {
        Arrived { link, at, frame }
    }
}

/// Links while a frame of them is held: they send it on.
pub trait SendOn {
    /// Whether a link has a carrier, if these links report it.
    fn is_up(&self, link: Link) -> bool;

    /// Sends a frame, without FCS. False if it certainly does not leave.
    fn send(&mut self, link: Link, frame: &[u8]) -> bool;
}

/// One or two network interfaces with a clock.
///
/// Links belong to one thread, which calls these in turn. [`Links::send`] and [`Links::receive`] are called in the
/// cyclic path and neither allocate nor wait.
pub trait Links {
    /// Host time.
    fn now(&self) -> Instant;

    /// Addresses of the main interface and, if there is one, of the redundant interface.
    fn addresses(&self) -> PerLink<MacAddress>;

    /// Sends a frame, without FCS. A link that is down drops it.
    fn send(&mut self, link: Link, frame: &[u8]);

    /// Passes the oldest frame that has arrived to `take`; false if there is none.
    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool;

    /// Passes the oldest frame that has arrived to `pass`, to be sent on; false if there is none. Where the links can,
    /// it is passed in the place in which it arrived, and not copied. An arrival before `since` is determined again,
    /// because the clock of arrivals may have been set.
    fn receive_and_pass(&mut self, since: Instant, pass: &mut dyn FnMut(Arrived<'_>, &mut dyn SendOn)) -> bool {
        let mut buffer = [0; MAX_FRAME_VLAN];
        let mut received = None;
        let any = self.receive(&mut |link, frame| {
            received = buffer.get_mut(..frame.len()).map(|place| {
                place.copy_from_slice(frame);
                (link, frame.len())
            });
        });
        if let Some((link, length)) = received {
            let now = self.now();
            let at = self.received_at(since, now).unwrap_or(now);
            pass(Arrived { link, at, frame: &mut buffer[..length] }, &mut Sending(self));
        }
        any
    }

    /// Whether a frame may have arrived that was not passed to `take`. Cheap.
    fn has_frame(&self) -> bool {
        true
    }

    /// Whether [`Links::received_at`] returns times, also if it is called later, before the next frame is taken.
    fn has_arrival_times(&self) -> bool {
        false
    }

    /// Arrival time at the interface of the frame that was last passed to `take`; `None` if these links record only the
    /// time at which it was taken. The frame left at `sent_at`, and was taken at about `now`: a time that is not
    /// between them is determined again. Without a system call.
    fn received_at(&mut self, _sent_at: Instant, _now: Instant) -> Option<Instant> {
        None
    }

    /// Whether an interface has a carrier; `None` if these links do not report it. Cheap: reads one or two atomics.
    fn carrier(&self, _link: Link) -> Option<bool> {
        None
    }

    /// A handle with which other threads end [`Links::wait`] and [`Links::wait_from`]; a wake-up before a wait ends it
    /// at once. `None` if these links have none: the acyclic half in its own thread then reads its requests every half
    /// millisecond.
    fn waker(&self) -> Option<Waker> {
        None
    }

    /// The same with descriptors that end a wait; `None` if these links have none.
    #[cfg(feature = "eoe")]
    fn wake_up(&self) -> Option<WakeUp> {
        None
    }

    /// Whether a wait was ended by a wake-up since the last call.
    fn take_call(&mut self) -> bool {
        false
    }

    /// Waits until a frame has arrived or the time has come.
    fn wait(&mut self, until: Instant);

    /// As [`Links::wait`]; `now` was read just before, so these links need not read it again.
    fn wait_from(&mut self, _now: Instant, until: Instant) {
        self.wait(until);
    }

    /// Waits until the time has come. No frame is expected: a frame that arrives may end the wait or not.
    fn sleep(&mut self, until: Instant) {
        self.wait(until);
    }

    /// Takes a link down so that its partner detects it, or brings it up again. False if that is not possible. Not
    /// called in the cyclic path of an application with its halves in two threads.
    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        let _ = (link, disconnect);
        false
    }
}

/// Links whose sent frames count as sent.
struct Sending<'a, L: ?Sized>(&'a mut L);

impl<L: Links + ?Sized> SendOn for Sending<'_, L> {
    fn is_up(&self, link: Link) -> bool {
        self.0.carrier(link) != Some(false)
    }

    fn send(&mut self, link: Link, frame: &[u8]) -> bool {
        self.0.send(link, frame);
        true
    }
}
