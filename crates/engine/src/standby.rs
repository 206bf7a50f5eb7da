//! Store-and-forward of an INACTIVE MainDevice (MainDevice redundancy, protocol 9.7).
//!
//! An INACTIVE MainDevice is a part of the ring of the ACTIVE one: it sends each frame of the ACTIVE on at its other
//! interface, and back at the same interface if the other one has no link. A mark per interface in the source address
//! ends the way of each frame. The caller receives and sends; this module decides, and marks the frame in place.

use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT, MacCodec};

use crate::link::Link;
use crate::ring::{Classified, Identity};

/// Offset of the byte of the source address that has the marks.
const MARKS_AT: usize = 6;

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

/// Forwards the frames of the ACTIVE MainDevice.
///
/// ```
/// use ringcat_engine::link::Link;
/// use ringcat_engine::standby::{Forwarder, NotForwarded};
/// use ringcat_wire::frame::MacAddress;
///
/// let forwarder = Forwarder::new(MacAddress([2, 0, 0, 0, 0, 1]), MacAddress([2, 0, 0, 0, 0, 2]));
/// // An EtherCAT frame of another MainDevice with one datagram, after the SubDevices.
/// let mut frame = [0; 60];
/// frame[6..12].copy_from_slice(&[0x02, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
/// frame[12..16].copy_from_slice(&[0x88, 0xA4, 0x0E, 0x10]);
/// assert_eq!(forwarder.forward(&mut frame, Link::Redundant, [true, true]), Ok(Link::Main));
/// assert_eq!(frame[6], 0x06);
/// assert_eq!(forwarder.forward(&mut frame, Link::Redundant, [true, true]), Err(NotForwarded::Again));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Forwarder {
    own: Identity,
}

impl Forwarder {
    /// With the addresses of the own interfaces.
    pub fn new(main: MacAddress, redundant: MacAddress) -> Forwarder {
        Forwarder { own: Identity::new(MacCodec::FlagsFirst, main, Some(redundant)) }
    }

    /// Marks a frame that was received on a link as forwarded, and returns the link to send it on. `carriers`: whether
    /// the main and the redundant link are up. The rest of the frame stays as it is, the C bits of its datagrams
    /// included (protocol CF-06).
    ///
    /// # Errors
    /// The frame is not forwarded, and unchanged.
    pub fn forward(&self, frame: &mut [u8], received_on: Link, carriers: [bool; 2]) -> Result<Link, NotForwarded> {
        match self.own.classify(frame) {
            Classified::Foreign => {}
            Classified::Ours(_) => return Err(NotForwarded::Own),
            Classified::Other => return Err(NotForwarded::NotEtherCat),
        }
        let is_up = |link: &Link| carriers[link.index()];
        let onward = [received_on.other(), received_on].into_iter().find(is_up).ok_or(NotForwarded::NoLink)?;
        let mark = match onward {
            Link::Main => FORWARDED_ON_MAIN,
            Link::Redundant => FORWARDED_ON_REDUNDANT,
        };
        let marks = frame.get_mut(MARKS_AT).ok_or(NotForwarded::NotEtherCat)?;
        if *marks & mark != 0 {
            return Err(NotForwarded::Again);
        }
        *marks |= mark;
        Ok(onward)
    }
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

    fn forwarded(marks: u8, on: Link, carriers: [bool; 2]) -> Result<(Link, u8), NotForwarded> {
        let mut frame = frame(marks);
        forwarder().forward(&mut frame, on, carriers).map(|link| (link, frame[MARKS_AT]))
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

    // covers: CF-07, CF-09
    #[test]
    fn own_frames_and_other_protocols_are_not_forwarded() {
        for own in [OWN, OWN_REDUNDANT] {
            let mut frame = frame(0x02);
            frame[9..12].copy_from_slice(&own.0[3..]);
            assert_eq!(forwarder().forward(&mut frame, Link::Main, BOTH), Err(NotForwarded::Own));
        }
        let mut other = frame(0x02);
        other[12] = 0x08;
        assert_eq!(forwarder().forward(&mut other, Link::Main, BOTH), Err(NotForwarded::NotEtherCat));
        let mut variables = frame(0x02);
        variables[15] = 0x40;
        assert_eq!(forwarder().forward(&mut variables, Link::Main, BOTH), Err(NotForwarded::NotEtherCat));
    }

    proptest! {
        // covers: CF-03, CF-06
        #[test]
        fn any_bytes_keep_all_but_the_mark_and_pass_twice_at_most(
            bytes in proptest::collection::vec(any::<u8>(), 0..80),
            main in any::<bool>(),
            carriers in any::<[bool; 2]>(),
        ) {
            let mut frame = bytes.clone();
            let mut on = if main { Link::Main } else { Link::Redundant };
            let mut passes = 0;
            while let Ok(link) = forwarder().forward(&mut frame, on, carriers) {
                passes += 1;
                on = link;
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
