//! Links of one kind or of another, chosen at run time.

use std::task::Waker;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
#[cfg(feature = "eoe")]
use ringcat_link::WakeUp;
use ringcat_wire::frame::MacAddress;

use crate::links::{Links, PerLink};

/// Links of one kind or of another. More kinds: one of the two is an `EitherLinks` again.
#[derive(Debug)]
pub enum EitherLinks<A, B> {
    /// Of the first kind.
    First(A),
    /// Of the second kind.
    Second(B),
}

macro_rules! either {
    ($self:expr, $links:ident => $call:expr) => {
        match $self {
            EitherLinks::First($links) => $call,
            EitherLinks::Second($links) => $call,
        }
    };
}

impl<A: Links, B: Links> Links for EitherLinks<A, B> {
    #[inline(always)]
    fn now(&self) -> Instant {
        either!(self, links => links.now())
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        either!(self, links => links.addresses())
    }

    #[inline(always)]
    fn send(&mut self, link: Link, frame: &[u8]) {
        either!(self, links => links.send(link, frame));
    }

    #[inline(always)]
    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        either!(self, links => links.receive(take))
    }

    #[inline(always)]
    fn has_frame(&self) -> bool {
        either!(self, links => links.has_frame())
    }

    fn has_arrival_times(&self) -> bool {
        either!(self, links => links.has_arrival_times())
    }

    #[inline(always)]
    fn received_at(&mut self, sent_at: Instant, now: Instant) -> Option<Instant> {
        either!(self, links => links.received_at(sent_at, now))
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        either!(self, links => links.carrier(link))
    }

    fn waker(&self) -> Option<Waker> {
        either!(self, links => links.waker())
    }

    #[cfg(feature = "eoe")]
    fn wake_up(&self) -> Option<WakeUp> {
        either!(self, links => links.wake_up())
    }

    fn take_call(&mut self) -> bool {
        either!(self, links => links.take_call())
    }

    fn wait(&mut self, until: Instant) {
        either!(self, links => links.wait(until));
    }

    fn wait_from(&mut self, now: Instant, until: Instant) {
        either!(self, links => links.wait_from(now, until));
    }

    fn sleep(&mut self, until: Instant) {
        either!(self, links => links.sleep(until));
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        either!(self, links => links.force_disconnect(link, disconnect))
    }
}
