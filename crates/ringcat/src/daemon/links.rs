//! Links whose descriptors a daemon has handed over: packet sockets, or pipes to a simulated segment.

use std::os::fd::OwnedFd;
use std::task::Waker;

use ringcat_control::message::{HandedLink as Handed, HandedLinks};
use ringcat_control::refusal::Refusal;
use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
#[cfg(feature = "eoe")]
use ringcat_link::WakeUp;
use ringcat_link::{HandedSocket, ReceiveMode};
use ringcat_wire::frame::MacAddress;

use super::error::DaemonError;
use crate::links::{Links, PerLink};
use crate::packet::{HandedLink, PacketLinks};
use crate::piped::PipedLinks;

/// Links of one half that a daemon has handed over.
#[derive(Debug)]
#[non_exhaustive]
pub enum DaemonLinks {
    /// Network interfaces.
    Packet(Box<PacketLinks>),
    /// A simulated segment in another process.
    Piped(PipedLinks),
}

impl DaemonLinks {
    /// Links of the cyclic and of the acyclic half.
    ///
    /// # Errors
    /// The descriptors are not those that are described.
    pub fn adopt(links: &HandedLinks, descriptors: Vec<OwnedFd>) -> Result<(DaemonLinks, DaemonLinks), DaemonError> {
        let wrong = || {
            let expected = format!("{} descriptors of links of one kind", links.descriptors());
            DaemonError::from(Refusal::Unexpected { expected })
        };
        if descriptors.len() != links.descriptors() {
            return Err(wrong());
        }
        let mut all = descriptors.into_iter();
        let mut next = || all.next().ok_or_else(wrong);
        let mut half = || Ok::<_, DaemonError>((next()?, links.redundant.as_ref().map(|_| next()).transpose()?));
        let (cyclic, acyclic) = (half()?, half()?);
        match (&links.main, &links.redundant) {
            (Handed::Pipe, None | Some(Handed::Pipe)) => Ok((
                DaemonLinks::Piped(PipedLinks::adopt(cyclic.0, cyclic.1)?),
                DaemonLinks::Piped(PipedLinks::adopt_acyclic(acyclic.0, acyclic.1)?),
            )),
            (Handed::Interface { .. }, None | Some(Handed::Interface { .. })) => {
                let described = |(main, redundant): (OwnedFd, Option<OwnedFd>)| {
                    let redundant = links.redundant.as_ref().zip(redundant).and_then(|(link, fd)| socket(link, fd));
                    Some(PerLink::new(socket(&links.main, main)?, redundant))
                };
                let (cyclic, acyclic) = described(cyclic).zip(described(acyclic)).ok_or_else(wrong)?;
                let (cyclic, acyclic) = PacketLinks::adopt_halves(cyclic, acyclic)?;
                Ok((DaemonLinks::Packet(Box::new(cyclic)), DaemonLinks::Packet(Box::new(acyclic))))
            }
            _ => Err(wrong()),
        }
    }
}

/// A packet socket as it is described.
fn socket(link: &Handed, fd: OwnedFd) -> Option<HandedLink> {
    let Handed::Interface { name, slots } = link else { return None };
    let receive = ReceiveMode::Blocking;
    Some((fd, HandedSocket { interface: name.clone(), slots: *slots, next_slot: None, receive }))
}

macro_rules! either {
    ($self:expr, $links:ident => $call:expr) => {
        match $self {
            DaemonLinks::Packet($links) => $call,
            DaemonLinks::Piped($links) => $call,
        }
    };
}

impl Links for DaemonLinks {
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

    fn knows_arrivals(&self) -> bool {
        either!(self, links => links.knows_arrivals())
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
