//! Joins fragments to frames as they arrive (protocol 6.5).
//!
//! Frames are distinguished by their number, so fragments of several frames may be interleaved. If a fragment does not
//! continue its frame, the frame is dropped; fragment 0 starts a new frame. A SubDevice can occupy memory for at most
//! one frame per number.

use alloc::vec::Vec;

use ringcat_wire::mailbox::eoe::{BLOCK, EoeFragment};

/// Frame numbers.
const NUMBERS: u8 = 16;

/// Result of a fragment.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The frame is incomplete.
    Part,
    /// The whole frame.
    Frame(Vec<u8>),
    /// The fragment belongs to no frame, or its frame cannot be completed.
    Lost,
    /// The fragment starts a frame, and the previous frame with this number was incomplete.
    Replaced(Option<Vec<u8>>),
}

/// Incomplete frames.
#[derive(Debug, Default)]
pub(super) struct Reassembly {
    /// Parts of frames, with the number of the frame.
    frames: Vec<(u8, Partial)>,
}

#[derive(Debug)]
struct Partial {
    bytes: Vec<u8>,
    /// Number of the next expected fragment.
    next: u8,
    /// Length that fragment 0 announced, rounded up to blocks.
    announced: usize,
}

impl Reassembly {
    /// Takes a fragment.
    pub(super) fn take(&mut self, fragment: &EoeFragment<'_>) -> Outcome {
        let number = fragment.frame % NUMBERS;
        let place = self.frames.iter().position(|(other, _)| *other == number);
        let before = place.map(|place| self.frames.swap_remove(place).1);
        let (mut partial, replaced) = match before {
            before if fragment.number == 0 => {
                let announced = usize::from(fragment.blocks) * BLOCK;
                (Partial { bytes: Vec::new(), next: 0, announced }, before.is_some())
            }
            Some(partial) => (partial, false),
            None => return Outcome::Lost,
        };
        if !partial.append(fragment) {
            return Outcome::Lost;
        }
        let frame = if fragment.last {
            Some(partial.bytes)
        } else {
            self.frames.push((number, partial));
            None
        };
        match (replaced, frame) {
            (true, frame) => Outcome::Replaced(frame),
            (false, Some(frame)) => Outcome::Frame(frame),
            (false, None) => Outcome::Part,
        }
    }

    /// Drops all incomplete frames.
    pub(super) fn clear(&mut self) {
        *self = Reassembly::default();
    }
}

impl Partial {
    /// Appends a fragment; false if it does not continue this frame.
    fn append(&mut self, fragment: &EoeFragment<'_>) -> bool {
        let continues = fragment.number == self.next && fragment.offset() == self.bytes.len();
        let whole = fragment.last || (!fragment.data.is_empty() && fragment.data.len().is_multiple_of(BLOCK));
        let length = self.bytes.len() + fragment.data.len();
        if !continues || !whole || length > self.announced.min(MAX_FRAME) {
            return false;
        }
        self.bytes.extend_from_slice(fragment.data);
        self.next += 1;
        true
    }
}

/// Longest frame without check sequence: 1,500 bytes of payload, header, a VLAN tag.
pub const MAX_FRAME: usize = 1518;

#[cfg(test)]
mod tests {
    use super::super::fragments::Fragments;
    use super::*;
    use ringcat_wire::mailbox::eoe::{EoeBody, EoeMessage};

    fn take(reassembly: &mut Reassembly, payload: &[u8]) -> Outcome {
        match EoeMessage::decode(payload).unwrap().body {
            EoeBody::Fragment(fragment) => reassembly.take(&fragment),
            other => panic!("{other:?}"),
        }
    }

    fn cut(fill: u8, length: usize, number: u8) -> Vec<Vec<u8>> {
        Fragments::new(&alloc::vec![fill; length], number, 128, false).unwrap().collect()
    }

    // covers: 6.5, eoe
    #[test]
    fn interleaved_fragments_of_sixteen_frames_are_joined() {
        let mut reassembly = Reassembly::default();
        let frames: Vec<_> = (0..16).map(|number| cut(number, 100 + usize::from(number), number)).collect();
        for frame in &frames {
            assert_eq!(take(&mut reassembly, &frame[0]), Outcome::Part);
        }
        for (number, frame) in frames.iter().enumerate().rev() {
            let whole = alloc::vec![number as u8; 100 + number];
            assert_eq!(take(&mut reassembly, &frame[1]), Outcome::Frame(whole));
        }
    }

    // covers: 6.5, eoe
    #[test]
    fn a_lost_fragment_drops_only_its_own_frame() {
        let mut reassembly = Reassembly::default();
        let [first, second] = [cut(1, 250, 1), cut(2, 250, 2)];
        take(&mut reassembly, &first[0]);
        take(&mut reassembly, &second[0]);
        assert_eq!(take(&mut reassembly, &first[2]), Outcome::Lost);
        assert_eq!(take(&mut reassembly, &first[1]), Outcome::Lost, "its frame was dropped");
        take(&mut reassembly, &second[1]);
        assert_eq!(take(&mut reassembly, &second[2]), Outcome::Frame(alloc::vec![2; 250]));
        // The last fragment is lost: the frame number is used again sixteen frames later.
        take(&mut reassembly, &first[0]);
        let next = cut(3, 60, 1);
        assert_eq!(take(&mut reassembly, &next[0]), Outcome::Replaced(Some(alloc::vec![3; 60])));
    }

    // covers: eoe
    #[test]
    fn fragments_of_impossible_length_or_offset_are_lost() {
        let mut reassembly = Reassembly::default();
        let fragment = |number, blocks, last, data| EoeFragment {
            frame: 0,
            number,
            blocks,
            last,
            time_requested: false,
            time_ns: None,
            data,
        };
        assert_eq!(reassembly.take(&fragment(0, 1, true, &[0; 64])), Outcome::Lost, "more than announced");
        assert_eq!(reassembly.take(&fragment(0, 63, true, &[0; 1600])), Outcome::Lost, "no frame is so long");
        assert_eq!(reassembly.take(&fragment(0, 4, false, &[0; 31])), Outcome::Lost, "no whole blocks");
        assert_eq!(reassembly.take(&fragment(0, 4, false, &[])), Outcome::Lost, "no data");
        reassembly.take(&fragment(0, 4, false, &[0; 32]));
        assert_eq!(reassembly.take(&fragment(1, 2, true, &[0; 8])), Outcome::Lost, "another offset");
    }
}
