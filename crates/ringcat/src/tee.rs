//! Links with a capture: all frames pass unchanged, and are recorded.
//!
//! Input: any [`Links`] and a [`Tap`]. Output: links. Frames are recorded with the time of the links: sent frames
//! before they are passed on, received frames when they are taken. Interface 0 of the capture is the main link, 1 the
//! redundant one. One tap serves one thread; tees of several threads write into one file. With taps of
//! [`Taps`](ringcat_link::Taps), recording begins and ends while the links are in use, on a call from any thread;
//! without a reader each frame costs one load.

use std::task::Waker;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_link::Tap;
#[cfg(feature = "eoe")]
use ringcat_link::WakeUp;
use ringcat_link::pcapng::Direction;
use ringcat_wire::frame::MacAddress;

use crate::links::{Links, PerLink};

/// Links with or without a tap.
#[derive(Debug)]
pub struct Tee<L> {
    links: L,
    tap: Option<Tap>,
}

impl<L: Links> Tee<L> {
    /// Records the frames of these links; without a tap nothing is recorded.
    pub fn new(links: L, tap: impl Into<Option<Tap>>) -> Tee<L> {
        let mut tap = tap.into();
        if let Some(tap) = &mut tap {
            tap.set_clock(links.now().0);
        }
        Tee { links, tap }
    }

    /// The links below.
    pub fn links(&self) -> &L {
        &self.links
    }

    /// The links below.
    pub fn links_mut(&mut self) -> &mut L {
        &mut self.links
    }
}

impl<L: Links> Tee<L> {
    /// Whether frames are recorded.
    #[inline(always)]
    fn is_read(&self) -> bool {
        self.tap.as_ref().is_some_and(Tap::is_read)
    }

    #[cold]
    fn record_sent(&mut self, link: Link, frame: &[u8]) {
        if let Some(tap) = &mut self.tap {
            tap.record(link.index(), Direction::Out, self.links.now().0, frame);
        }
    }

    #[cold]
    fn receive_recorded(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let Some(tap) = &mut self.tap else { return false };
        let now = self.links.now().0;
        self.links.receive(&mut |link, frame| {
            tap.record(link.index(), Direction::In, now, frame);
            take(link, frame);
        })
    }
}

impl<L: Links> Links for Tee<L> {
    #[inline(always)]
    fn now(&self) -> Instant {
        self.links.now()
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.links.addresses()
    }

    #[inline(always)]
    fn send(&mut self, link: Link, frame: &[u8]) {
        if self.is_read() {
            self.record_sent(link, frame);
        }
        self.links.send(link, frame);
    }

    #[inline(always)]
    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        if self.is_read() { self.receive_recorded(take) } else { self.links.receive(take) }
    }

    #[inline(always)]
    fn has_frame(&self) -> bool {
        self.links.has_frame()
    }

    fn has_arrival_times(&self) -> bool {
        self.links.has_arrival_times()
    }

    #[inline(always)]
    fn received_at(&mut self, sent_at: Instant, now: Instant) -> Option<Instant> {
        self.links.received_at(sent_at, now)
    }

    #[inline(always)]
    fn carrier(&self, link: Link) -> Option<bool> {
        self.links.carrier(link)
    }

    fn waker(&self) -> Option<Waker> {
        self.links.waker()
    }

    #[cfg(feature = "eoe")]
    fn wake_up(&self) -> Option<WakeUp> {
        self.links.wake_up()
    }

    #[inline(always)]
    fn take_call(&mut self) -> bool {
        self.links.take_call()
    }

    fn wait(&mut self, until: Instant) {
        self.links.wait(until);
    }

    #[inline(always)]
    fn wait_from(&mut self, now: Instant, until: Instant) {
        self.links.wait_from(now, until);
    }

    fn sleep(&mut self, until: Instant) {
        self.links.sleep(until);
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        self.links.force_disconnect(link, disconnect)
    }
}
