//! Links to a simulated segment in another process: a pipe for frames per link and class, in real time.
//!
//! The process with the segment is [`segment::PipedSegment`]. Descriptors of the pipes can be passed on and gone on
//! with, as those of packet sockets: so hand-overs between processes are tested without an interface and without a
//! privilege. Time is `CLOCK_MONOTONIC`. Whether a link has a carrier is not known.

#[cfg(feature = "sim")]
pub mod segment;

use std::os::fd::OwnedFd;
use std::task::Waker;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_link::{FramePipe, LinkError, WakeUp, monotonic, wait_pipes};
use ringcat_wire::frame::MacAddress;

use crate::links::{Links, PerLink};
use crate::simulated_addresses::{MAIN, REDUNDANT};

/// Pipes of one half to a simulated segment.
#[derive(Debug)]
pub struct PipedLinks {
    main: FramePipe,
    redundant: Option<FramePipe>,
    /// Ends waits from other threads; not for the cyclic half.
    wake_up: Option<WakeUp>,
}

impl PipedLinks {
    /// Goes on with pipes of the cyclic half, which another process has made.
    ///
    /// # Errors
    /// A descriptor is no pipe for frames.
    pub fn adopt(main: OwnedFd, redundant: Option<OwnedFd>) -> Result<PipedLinks, LinkError> {
        let redundant = redundant.map(FramePipe::adopt).transpose()?;
        Ok(PipedLinks { main: FramePipe::adopt(main)?, redundant, wake_up: None })
    }

    /// The same for the acyclic half, whose waits other threads can end.
    ///
    /// # Errors
    /// As [`PipedLinks::adopt`], or the process has no more descriptors.
    pub fn adopt_acyclic(main: OwnedFd, redundant: Option<OwnedFd>) -> Result<PipedLinks, LinkError> {
        Ok(PipedLinks { wake_up: Some(WakeUp::new()?), ..PipedLinks::adopt(main, redundant)? })
    }
}

impl Links for PipedLinks {
    fn now(&self) -> Instant {
        Instant(monotonic::now_ns())
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        PerLink::new(MAIN, self.redundant.as_ref().map(|_| REDUNDANT))
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        match link {
            // A frame that is lost here does not come back, as on a cable.
            Link::Main => self.main.send(frame),
            Link::Redundant => self.redundant.as_mut().is_some_and(|pipe| pipe.send(frame)),
        };
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.main.receive(&mut |frame| take(Link::Main, frame))
            || self.redundant.as_mut().is_some_and(|pipe| pipe.receive(&mut |frame| take(Link::Redundant, frame)))
    }

    fn waker(&self) -> Option<Waker> {
        self.wake_up.as_ref().map(WakeUp::waker)
    }

    #[cfg(feature = "eoe")]
    fn wake_up(&self) -> Option<WakeUp> {
        self.wake_up.clone()
    }

    fn take_call(&mut self) -> bool {
        self.wake_up.as_ref().is_some_and(WakeUp::take_call)
    }

    fn wait(&mut self, until: Instant) {
        match &self.redundant {
            Some(redundant) => wait_pipes(&[&self.main, redundant], self.wake_up.as_ref(), until.0),
            None => wait_pipes(&[&self.main], self.wake_up.as_ref(), until.0),
        };
    }

    fn sleep(&mut self, until: Instant) {
        monotonic::sleep_until_ns(until.0);
    }
}
