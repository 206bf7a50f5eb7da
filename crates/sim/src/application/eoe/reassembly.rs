//! Joins fragments to frames (protocol 6.5).
//!
//! Input: fragments in order of arrival, with frames distinguished by their number. Output: whole frames. A fragment 0
//! starts a frame; a fragment out of order discards its frame.

use ringcat_wire::mailbox::eoe::{BLOCK, EoeFragment};

/// Longest frame including a VLAN tag, rounded up to blocks.
const MAX_FRAME: usize = 48 * BLOCK;
/// Frame numbers.
const FRAMES: usize = 16;

/// Incomplete frames.
#[derive(Clone, Debug, Default)]
pub struct Reassembly {
    frames: [Option<Partial>; FRAMES],
}

#[derive(Clone, Debug)]
struct Partial {
    data: Vec<u8>,
    next: u8,
    /// Length announced by fragment 0, rounded up to blocks.
    announced: usize,
}

impl Reassembly {
    /// Adds a fragment; returns the frame if the fragment completes it.
    pub fn take(&mut self, fragment: &EoeFragment<'_>) -> Option<Vec<u8>> {
        let place = &mut self.frames[usize::from(fragment.frame) % FRAMES];
        if fragment.number == 0 {
            let announced = usize::from(fragment.blocks) * BLOCK;
            *place = Some(Partial { data: Vec::new(), next: 0, announced });
        }
        let partial = place.as_mut()?;
        let follows = fragment.number == partial.next && fragment.offset() == partial.data.len();
        let whole_blocks = fragment.last || fragment.data.len().is_multiple_of(BLOCK);
        let end = partial.data.len() + fragment.data.len();
        if !follows || !whole_blocks || end > MAX_FRAME.min(partial.announced) {
            *place = None;
            return None;
        }
        partial.data.extend_from_slice(fragment.data);
        partial.next += 1;
        if fragment.last { place.take().map(|partial| partial.data) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fragment(frame: u8, number: u8, blocks: u8, last: bool, data: &[u8]) -> EoeFragment<'_> {
        EoeFragment { frame, number, blocks, last, time_requested: false, time_ns: None, data }
    }

    // covers: 6.5
    #[test]
    fn frames_with_interleaved_fragments_are_distinguished() {
        let mut reassembly = Reassembly::default();
        assert_eq!(reassembly.take(&fragment(1, 0, 2, false, &[1; 32])), None);
        assert_eq!(reassembly.take(&fragment(2, 0, 2, false, &[2; 32])), None);
        let second = reassembly.take(&fragment(2, 1, 1, true, &[2; 5])).unwrap();
        assert_eq!(second, [2; 37]);
        assert_eq!(reassembly.take(&fragment(1, 1, 1, true, &[1; 1])).unwrap(), [1; 33]);
    }

    // covers: 6.5
    #[test]
    fn a_new_fragment_0_discards_an_unfinished_frame() {
        let mut reassembly = Reassembly::default();
        assert_eq!(reassembly.take(&fragment(1, 0, 2, false, &[1; 32])), None);
        assert_eq!(reassembly.take(&fragment(1, 0, 1, true, &[3; 20])).unwrap(), [3; 20]);
        assert_eq!(reassembly.take(&fragment(1, 1, 1, true, &[1; 1])), None);
    }

    #[test]
    fn out_of_order_or_oversized_fragments_are_discarded() {
        let mut reassembly = Reassembly::default();
        reassembly.take(&fragment(1, 0, 3, false, &[1; 32]));
        assert_eq!(reassembly.take(&fragment(1, 2, 2, true, &[1; 1])), None);
        reassembly.take(&fragment(1, 0, 3, false, &[1; 32]));
        assert_eq!(reassembly.take(&fragment(1, 1, 2, true, &[1; 1])), None, "wrong offset");
        assert_eq!(reassembly.take(&fragment(1, 0, 1, true, &[1; 64])), None, "more than announced");
        assert_eq!(reassembly.take(&fragment(1, 0, 63, true, &[1; 1600])), None, "longer than any frame");
        assert_eq!(reassembly.take(&fragment(1, 0, 3, false, &[1; 31])), None, "no whole blocks");
        assert_eq!(reassembly.take(&fragment(1, 1, 1, true, &[1; 1])), None);
    }
}
