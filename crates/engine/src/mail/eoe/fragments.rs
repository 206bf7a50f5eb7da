//! Cuts Ethernet frames into payloads of mailbox messages (protocol 6.5).

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::mailbox::eoe::{BLOCK, EoeBody, EoeFragment, EoeMessage};

/// Iterates over the payloads of a frame's fragments.
#[derive(Debug)]
pub(super) struct Fragments<'a> {
    frame: &'a [u8],
    /// Frame number.
    number: u8,
    /// Data bytes of each fragment but the last.
    piece: usize,
    wants_time: bool,
    next: usize,
}

impl<'a> Fragments<'a> {
    /// The fragments of a frame for a mailbox of this size (header included); `None` if a fragment does not fit.
    pub(super) fn new(frame: &'a [u8], number: u8, mailbox_size: usize, wants_time: bool) -> Option<Fragments<'a>> {
        let piece = EoeFragment::max_data(mailbox_size);
        (piece > 0).then_some(Fragments { frame, number, piece, wants_time, next: 0 })
    }
}

impl Iterator for Fragments<'_> {
    type Item = Vec<u8>;

    fn next(&mut self) -> Option<Vec<u8>> {
        let begin = self.next * self.piece;
        let data = self.frame.get(begin..).filter(|rest| !rest.is_empty())?;
        let data = &data[..data.len().min(self.piece)];
        let last = begin + data.len() == self.frame.len();
        let blocks = if self.next == 0 { self.frame.len().div_ceil(BLOCK) } else { begin / BLOCK };
        let fragment = EoeFragment {
            frame: self.number,
            // The encoder refuses a number or offset beyond six bits, which ends the frame.
            number: u8::try_from(self.next).unwrap_or(u8::MAX),
            blocks: u8::try_from(blocks).unwrap_or(u8::MAX),
            last,
            time_requested: self.wants_time,
            time_ns: None,
            data,
        };
        self.next += 1;
        let mut payload = vec![0; EoeMessage::OVERHEAD + data.len()];
        let length = EoeMessage { port: 0, body: EoeBody::Fragment(fragment) }.encode(&mut payload)?;
        payload.truncate(length);
        Some(payload)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(length: usize, mailbox_size: usize) -> Vec<Vec<u8>> {
        let frame: Vec<u8> = (0..length).map(|at| at as u8).collect();
        Fragments::new(&frame, 5, mailbox_size, false).map(Iterator::collect).unwrap_or_default()
    }

    // covers: 6.5, eoe
    #[test]
    fn all_fragments_but_the_last_are_whole_blocks_with_their_offset() {
        // 128 bytes of mailbox, 10 of headers, 96 of data.
        let fragments = cut(200, 128);
        assert_eq!(fragments.iter().map(Vec::len).collect::<Vec<_>>(), [100, 100, 12]);
        // Fragment 0 contains the length of the frame in blocks, the others their offset. Frame 5.
        assert_eq!(fragments[0][..6], [0x00, 0x00, 0xC0, 0x51, 0, 1], "7 blocks");
        assert_eq!(fragments[1][..6], [0x00, 0x00, 0xC1, 0x50, 96, 97], "from block 3");
        assert_eq!(fragments[2][..6], [0x00, 0x01, 0x82, 0x51, 192, 193], "from block 6, the last");
    }

    #[test]
    fn a_frame_that_fits_is_one_fragment_and_a_small_mailbox_takes_none() {
        assert_eq!(cut(60, 1486), [[&[0x00, 0x01, 0x80, 0x50][..], &(0..60).collect::<Vec<u8>>()].concat()]);
        assert_eq!(cut(1514, 1486).iter().map(Vec::len).collect::<Vec<_>>(), [1476, 4 + 42]);
        assert_eq!(cut(96, 128).len(), 1);
        assert!(cut(60, 41).is_empty());
        assert_eq!(cut(1518, 42).len(), 48);
    }
}
