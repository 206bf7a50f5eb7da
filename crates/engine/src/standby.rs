//! Store-and-forward of an INACTIVE MainDevice (MainDevice redundancy, protocol 9.7).
//!
//! An INACTIVE MainDevice is a part of the ring of the ACTIVE one: it sends each frame of the ACTIVE on at its other
//! interface, and back at the same interface if the other one has no link. A mark per interface in the source address
//! ends the way of each frame. The caller receives and sends; this module decides, and marks the frame in place.
//!
//! Ethernet frames of both MainDevices pass in acyclic master frames: [`PartnerEndpoint`].

mod endpoint;
pub(crate) mod ethernet;
mod frame_queue;

use core::time::Duration;

pub use endpoint::{ETHERNET_QUEUE, NotQueued, PartnerEndpoint, PartnerTraffic};
use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT, MacCodec};

use crate::link::Link;
use crate::ring::{Classified, Identity};
use crate::time::Instant;

/// Offset of the byte of the source address that has the marks.
const MARKS_AT: usize = 6;
/// Own frames may come for this time after the last one was sent: longer than any frame is on its way, with all that
/// store and forward it.
const OWN_FRAMES_COME_FOR: Duration = Duration::from_millis(100);

/// Why an INACTIVE MainDevice does not forward a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum NotForwarded {
    /// A frame of this MainDevice itself, from the time when it was ACTIVE (protocol CF-07).
    Own,
    /// No EtherCAT frame with datagrams (protocol CF-09).
    NotEtherCat,
    /// It was forwarded on this interface before (protocol CF-02).
    Again,
    /// Neither interface has a link.
    NoLink,
}

/// Where a frame goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct Onward {
    /// The link to send it on; the frame has the mark of this link.
    pub link: Link,
    /// The frame has the identity of this MainDevice, which has sent none for long: another MainDevice has the same
    /// bytes 3 to 5 in its address, and neither can distinguish its frames from those of the other (protocol SM-09).
    pub has_own_identity: bool,
}

/// Forwards the frames of the ACTIVE MainDevice.
///
/// ```
/// use ringcat_engine::link::Link;
/// use ringcat_engine::standby::{Forwarder, NotForwarded};
/// use ringcat_engine::time::Instant;
/// use ringcat_wire::frame::MacAddress;
///
/// let forwarder = Forwarder::new(MacAddress([2, 0, 0, 0, 0, 1]), MacAddress([2, 0, 0, 0, 0, 2]));
/// // An EtherCAT frame of another MainDevice with one datagram, after the SubDevices.
/// let mut frame = [0; 60];
/// frame[6..12].copy_from_slice(&[0x02, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
/// frame[12..16].copy_from_slice(&[0x88, 0xA4, 0x0E, 0x10]);
/// let mut forward = || forwarder.forward(&mut frame, Link::Redundant, [true, true], Instant(0)).map(|it| it.link);
/// assert_eq!(forward(), Ok(Link::Main));
/// assert_eq!(forward(), Err(NotForwarded::Again));
/// assert_eq!(frame[6], 0x06);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Forwarder {
    own: Identity,
    /// Frames with the own identity that come until then are own ones.
    own_until: Option<Instant>,
}

impl Forwarder {
    /// With the addresses of the own interfaces, of a MainDevice that has sent nothing.
    pub fn new(main: MacAddress, redundant: MacAddress) -> Forwarder {
        Forwarder { own: Identity::new(MacCodec::FlagsFirst, main, Some(redundant)), own_until: None }
    }

    /// This MainDevice was ACTIVE, and has sent its last frame at this time.
    #[must_use]
    pub fn after_sending(mut self, last_sent: Instant) -> Forwarder {
        self.own_until = Some(last_sent + OWN_FRAMES_COME_FOR);
        self
    }

    /// Whether a received frame is of another MainDevice: one that may be forwarded.
    pub fn is_of_another(&self, frame: &[u8], now: Instant) -> bool {
        match self.own.classify(frame) {
            Classified::Foreign => true,
            Classified::Ours(_) => self.own_until.is_none_or(|until| now > until),
            Classified::Other => false,
        }
    }

    /// Marks a frame that was received on a link as forwarded, and returns the link to send it on. `carriers`: whether
    /// the main and the redundant link are up. The rest of the frame stays as it is, the C bits of its datagrams
    /// included (protocol CF-06).
    ///
    /// # Errors
    /// The frame is not forwarded, and unchanged.
    pub fn forward(
        &self,
        frame: &mut [u8],
        received_on: Link,
        carriers: [bool; 2],
        now: Instant,
    ) -> Result<Onward, NotForwarded> {
        let has_own_identity = match self.own.classify(frame) {
            Classified::Foreign => false,
            Classified::Ours(_) if self.own_until.is_some_and(|until| now <= until) => return Err(NotForwarded::Own),
            Classified::Ours(_) => true,
            Classified::Other => return Err(NotForwarded::NotEtherCat),
        };
        let is_up = |link: &Link| carriers[link.index()];
        let link = [received_on.other(), received_on].into_iter().find(is_up).ok_or(NotForwarded::NoLink)?;
        mark(frame, link)?;
        Ok(Onward { link, has_own_identity })
    }

    /// The link that [`Forwarder::forward`] has chosen could not send the frame: marks it for the way back instead.
    ///
    /// # Errors
    /// The frame cannot go back either.
    pub fn turn_back(&self, frame: &mut [u8], received_on: Link, failed: Onward) -> Result<Onward, NotForwarded> {
        if failed.link == received_on {
            return Err(NotForwarded::NoLink);
        }
        if let Some(marks) = frame.get_mut(MARKS_AT) {
            *marks &= !mark_of(failed.link);
        }
        mark(frame, received_on)?;
        Ok(Onward { link: received_on, ..failed })
    }
}

/// The mark of a frame that was forwarded on a link (protocol CF-01).
const fn mark_of(link: Link) -> u8 {
    match link {
        Link::Main => FORWARDED_ON_MAIN,
        Link::Redundant => FORWARDED_ON_REDUNDANT,
    }
}

/// Marks a frame, once.
fn mark(frame: &mut [u8], link: Link) -> Result<(), NotForwarded> {
    let marks = frame.get_mut(MARKS_AT).ok_or(NotForwarded::NotEtherCat)?;
    if *marks & mark_of(link) != 0 {
        return Err(NotForwarded::Again);
    }
    *marks |= mark_of(link);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OWN: MacAddress = MacAddress([0x02, 0, 0, 0, 0, 0x21]);
    const OWN_REDUNDANT: MacAddress = MacAddress([0x02, 0, 0, 0, 0, 0x22]);
    const BOTH: [bool; 2] = [true, true];

    fn forwarder() -> Forwarder {
        Forwarder::new(OWN, OWN_REDUNDANT)
    }

    /// A frame of the MainDevice of the trace, with these marks.
    fn frame(marks: u8) -> [u8; 60] {
        let mut frame = [0; 60];
        frame[6..12].copy_from_slice(&[marks, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
        frame[12..16].copy_from_slice(&[0x88, 0xA4, 0x0E, 0x10]);
        frame
    }

    const NOW: Instant = Instant(1_000_000_000);

    fn forwarded(marks: u8, on: Link, carriers: [bool; 2]) -> Result<(Link, u8), NotForwarded> {
        let mut frame = frame(marks);
        forwarder().forward(&mut frame, on, carriers, NOW).map(|onward| (onward.link, frame[MARKS_AT]))
    }

    /// As [`forwarded`], where the link that is chosen cannot send.
    fn turned_back(marks: u8, on: Link) -> Result<(Link, u8), NotForwarded> {
        let mut frame = frame(marks);
        let onward = forwarder().forward(&mut frame, on, BOTH, NOW)?;
        forwarder().turn_back(&mut frame, on, onward).map(|onward| (onward.link, frame[MARKS_AT]))
    }

    // covers: 9.7.3, CF-01
    #[test]
    fn the_copies_of_the_trace_get_their_marks() {
        assert_eq!(forwarded(0x08, Link::Main, BOTH), Ok((Link::Redundant, 0x88)));
        assert_eq!(forwarded(0x02, Link::Redundant, BOTH), Ok((Link::Main, 0x06)));
    }

    // covers: CF-02, CF-03, CF-05
    #[test]
    fn a_frame_passes_each_interface_once_and_two_passes_are_possible() {
        assert_eq!(forwarded(0x8A, Link::Redundant, BOTH), Ok((Link::Main, 0x8E)));
        assert_eq!(forwarded(0x8E, Link::Redundant, BOTH), Err(NotForwarded::Again));
        assert_eq!(forwarded(0x8E, Link::Main, BOTH), Err(NotForwarded::Again));
    }

    // covers: 9.7.5
    #[test]
    fn without_a_link_at_the_other_interface_a_frame_goes_back() {
        assert_eq!(forwarded(0x08, Link::Main, [true, false]), Ok((Link::Main, 0x0C)));
        assert_eq!(forwarded(0x02, Link::Redundant, [false, true]), Ok((Link::Redundant, 0x82)));
        assert_eq!(forwarded(0x82, Link::Redundant, [false, true]), Err(NotForwarded::Again));
        assert_eq!(forwarded(0x08, Link::Main, [false, false]), Err(NotForwarded::NoLink));
    }

    // covers: 9.7.5
    #[test]
    fn a_frame_goes_back_at_once_if_the_other_interface_does_not_send() {
        assert_eq!(turned_back(0x08, Link::Main), Ok((Link::Main, 0x0C)));
        assert_eq!(turned_back(0x02, Link::Redundant), Ok((Link::Redundant, 0x82)));
        assert_eq!(turned_back(0x82, Link::Redundant), Err(NotForwarded::Again));
        let mut frame = frame(0x08);
        let onward = forwarder().forward(&mut frame, Link::Main, [true, false], NOW).expect("one link is up");
        assert_eq!(forwarder().turn_back(&mut frame, Link::Main, onward), Err(NotForwarded::NoLink));
    }

    /// A frame with the identity of an own interface.
    fn own(address: MacAddress) -> [u8; 60] {
        let mut frame = frame(0x02);
        frame[9..12].copy_from_slice(&address.0[3..]);
        frame
    }

    // covers: CF-07, CF-09
    #[test]
    fn own_frames_and_other_protocols_are_not_forwarded() {
        let was_active = forwarder().after_sending(NOW);
        for address in [OWN, OWN_REDUNDANT] {
            let left = was_active.forward(&mut own(address), Link::Main, BOTH, NOW + OWN_FRAMES_COME_FOR);
            assert_eq!(left, Err(NotForwarded::Own));
        }
        let mut other = frame(0x02);
        other[12] = 0x08;
        assert_eq!(forwarder().forward(&mut other, Link::Main, BOTH, NOW), Err(NotForwarded::NotEtherCat));
        let mut variables = frame(0x02);
        variables[15] = 0x40;
        assert_eq!(forwarder().forward(&mut variables, Link::Main, BOTH, NOW), Err(NotForwarded::NotEtherCat));
    }

    // covers: SM-09
    #[test]
    fn frames_of_a_maindevice_with_the_same_identity_are_counted_and_forwarded() {
        let late = NOW + OWN_FRAMES_COME_FOR + Duration::from_nanos(1);
        for (forwarder, now) in [(forwarder(), Instant(0)), (forwarder().after_sending(NOW), late)] {
            let onward = forwarder.forward(&mut own(OWN_REDUNDANT), Link::Redundant, BOTH, now);
            assert_eq!(onward, Ok(Onward { link: Link::Main, has_own_identity: true }));
            let foreign = forwarder.forward(&mut frame(0x02), Link::Redundant, BOTH, now);
            assert_eq!(foreign, Ok(Onward { link: Link::Main, has_own_identity: false }));
        }
    }

    proptest! {
        // covers: CF-03, CF-06
        #[test]
        fn any_bytes_keep_all_but_the_mark_and_pass_twice_at_most(
            bytes in proptest::collection::vec(any::<u8>(), 0..80),
            main in any::<bool>(),
            carriers in any::<[bool; 2]>(),
            sends in any::<[bool; 2]>(),
        ) {
            let mut frame = bytes.clone();
            let mut on = if main { Link::Main } else { Link::Redundant };
            let mut passes = 0;
            let pass = |frame: &mut [u8], on| {
                let onward = forwarder().forward(frame, on, carriers, NOW)?;
                if sends[onward.link.index()] { Ok(onward) } else { forwarder().turn_back(frame, on, onward) }
            };
            while let Ok(onward) = pass(&mut frame, on) {
                passes += 1;
                on = onward.link;
                prop_assert!(passes <= 2);
            }
            let marks = FORWARDED_ON_MAIN | FORWARDED_ON_REDUNDANT;
            for (at, (before, after)) in bytes.iter().zip(&frame).enumerate() {
                let changed = before ^ after;
                prop_assert_eq!(changed & !(if at == MARKS_AT { marks } else { 0 }), 0);
            }
        }
    }
}
