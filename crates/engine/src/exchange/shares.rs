//! Share of each SubDevice in the working counters, posted for readers in any thread.
//!
//! Input: the frames of an evaluated cycle. Output: per SubDevice the sum of its increments over all datagrams
//! ([`crate::board::live`]). A cycle with the results of the one before changes nothing, and is not evaluated here.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::again::Again;
use super::flight::CyclicFrame;
use crate::board::Board;
use crate::layout::Layout;

/// Increment of one SubDevice in one datagram; `None` where it is unknown.
pub(super) type Increment = Option<u16>;

/// The posted increments. A datagram has one place here, whatever the number of its cycles under way.
#[derive(Debug)]
pub(super) struct Shares {
    /// By domain and datagram: the place of its first SubDevice.
    first: Box<[Box<[usize]>]>,
    posted: Box<[Increment]>,
}

impl Shares {
    /// The shares of a layout; posts what is expected.
    pub fn new(layout: &Layout, board: &Board) -> Shares {
        let mut count = 0;
        let mut first = Vec::new();
        for domain in &layout.domains {
            let mut places = Vec::new();
            for datagram in domain.frames.iter().flat_map(|frame| &frame.datagrams) {
                places.push(count);
                count += datagram.contributions.len();
                for (subdevice, wkc) in &datagram.contributions {
                    board.live.change_share(*subdevice, |share| share.expected = share.expected.saturating_add(wkc.0));
                }
            }
            first.push(places.into_boxed_slice());
        }
        Shares { first: first.into_boxed_slice(), posted: vec![Some(0); count].into_boxed_slice() }
    }

    /// Posts what a frame of an evaluated cycle has shown, and its further tries.
    #[cold]
    pub fn post(&mut self, frame: &CyclicFrame, again: Option<&Again>, board: &Board) {
        let Some(first) = self.first.get(frame.domain()) else { return };
        let again = again.filter(|again| again.was_sent(frame.left()));
        frame.each_increment(|at, subdevice, increment| {
            let Some(posted) = first.get(at.number).and_then(|first| self.posted.get_mut(first + at.contribution))
            else {
                return;
            };
            let proved = again.and_then(|again| again.proved(at.datagram, at.contribution));
            let increment = proved.or(increment);
            if *posted != increment {
                board.live.change_share(subdevice, |share| {
                    match *posted {
                        Some(before) => share.counted -= before.min(share.counted),
                        None => share.unknown = share.unknown.saturating_sub(1),
                    }
                    match increment {
                        Some(now) => share.counted = share.counted.saturating_add(now),
                        None => share.unknown = share.unknown.saturating_add(1),
                    }
                });
                *posted = increment;
            }
        });
    }
}
