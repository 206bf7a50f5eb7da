//! Links whose descriptors a daemon has handed over: packet sockets, or pipes to a simulated segment.

use std::os::fd::OwnedFd;

use ringcat_control::message::{HandedLink as Handed, HandedLinks};
use ringcat_control::refusal::Refusal;
use ringcat_link::{HandedSocket, ReceiveMode, Taps};

use super::error::DaemonError;
use crate::either_links::EitherLinks;
use crate::links::{Links, PerLink};
use crate::packet::{HandedLink, PacketLinks};
use crate::piped::PipedLinks;
use crate::tee::Tee;

/// Links of one half that a daemon has handed over: network interfaces, or a simulated segment in another process; with
/// a tap where frames are recorded, or where there are debug interfaces.
pub type DaemonLinks = Tee<EitherLinks<PacketLinks, PipedLinks>>;

/// Links of one half, without a tap.
pub type Adopted = EitherLinks<PacketLinks, PipedLinks>;

/// Memory for the frames of a half on their way to what reads the taps, in which a frame stays for up to 200 ms.
const QUEUE: usize = 4 << 20;

/// A tap of one half.
pub(super) fn tapped<L: Links>(links: L, taps: Option<&Taps>) -> Tee<L> {
    Tee::new(links, taps.map(|taps| taps.tap_with(QUEUE)))
}

/// Links of the cyclic and of the acyclic half, without taps.
///
/// # Errors
/// The descriptors are not those that are described.
pub fn adopt_links(links: &HandedLinks, descriptors: Vec<OwnedFd>) -> Result<(Adopted, Adopted), DaemonError> {
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
            EitherLinks::Second(PipedLinks::adopt(cyclic.0, cyclic.1)?),
            EitherLinks::Second(PipedLinks::adopt_acyclic(acyclic.0, acyclic.1)?),
        )),
        (Handed::Interface { .. }, None | Some(Handed::Interface { .. })) => {
            let described = |(main, redundant): (OwnedFd, Option<OwnedFd>)| {
                let redundant = links.redundant.as_ref().zip(redundant).and_then(|(link, fd)| socket(link, fd));
                Some(PerLink::new(socket(&links.main, main)?, redundant))
            };
            let (cyclic, acyclic) = described(cyclic).zip(described(acyclic)).ok_or_else(wrong)?;
            let (cyclic, acyclic) = PacketLinks::adopt_halves(cyclic, acyclic)?;
            Ok((EitherLinks::First(cyclic), EitherLinks::First(acyclic)))
        }
        _ => Err(wrong()),
    }
}

/// A packet socket as it is described.
fn socket(link: &Handed, fd: OwnedFd) -> Option<HandedLink> {
    let Handed::Interface { name, slots, absent_mac } = link else { return None };
    let (interface, receive) = (name.clone(), ReceiveMode::Blocking);
    Some((fd, HandedSocket { interface, absent_mac: *absent_mac, slots: *slots, next_slot: None, receive }))
}
