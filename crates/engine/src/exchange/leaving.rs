//! Departure of frames that leave on two links or carry datagrams of distributed clocks.

use super::evidence::Evidence;
use super::flight::CyclicFrame;
use crate::board::Board;
use crate::link::{Link, LinkSet};
use crate::ring::{Identity, Sequence};
use crate::time::Instant;

/// Data for frames that leave on two links or carry datagrams of distributed clocks.
pub(super) struct Leaving<'a> {
    pub identity: &'a Identity,
    pub links: LinkSet,
    pub board: &'a Board,
    pub now: Instant,
}

impl Leaving<'_> {
    /// Sends a frame; returns its length.
    #[inline(never)]
    pub fn send(
        &self,
        frame: &mut CyclicFrame,
        sequence: Sequence,
        deadline: Instant,
        evidence: &mut Evidence,
        transmit: &mut impl FnMut(Link, &[u8]),
    ) -> usize {
        let clocks = frame.clocks().map(|places| {
            let payloads = evidence.clocks.depart(self.board, self.now);
            frame.clocks_leave(self.now, evidence.clocks.changes(), payloads[0].monitors);
            (places, payloads)
        });
        let bytes = frame.depart(self.identity, sequence, deadline);
        if let Some((places, payloads)) = &clocks {
            places.write(bytes, &payloads[0]);
        }
        transmit(Link::Main, bytes);
        if self.links == LinkSet::Ring {
            if let Some((places, payloads)) = &clocks {
                places.write(bytes, &payloads[1]);
            }
            Identity::mark_redundant(bytes, true);
            transmit(Link::Redundant, bytes);
            Identity::mark_redundant(bytes, false);
        }
        bytes.len()
    }
}

/// Sends a frame without clocks on both links; returns its length.
#[inline(never)]
pub(super) fn send_twice(
    identity: &Identity,
    frame: &mut CyclicFrame,
    sequence: Sequence,
    deadline: Instant,
    transmit: &mut impl FnMut(Link, &[u8]),
) -> usize {
    let bytes = frame.depart(identity, sequence, deadline);
    transmit(Link::Main, bytes);
    Identity::mark_redundant(bytes, true);
    transmit(Link::Redundant, bytes);
    Identity::mark_redundant(bytes, false);
    bytes.len()
}
