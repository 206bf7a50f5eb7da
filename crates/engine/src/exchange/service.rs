//! Supervision and distributed clocks in cycles in which the home domain does not leave.
//!
//! Their datagrams are part of a frame of the home domain ([`Layout::home`]). When that domain is not queued, a frame
//! of another queued domain carries them; when no domain is queued, a separate frame does. While a frame with them is
//! on the wire, no other frame carries them.

use alloc::vec::Vec;

use super::domain::Domain;
use super::flight::CyclicFrame;
use super::image::{Image, InputNumber};
use crate::board::Board;
use crate::layout::Layout;
use crate::ring::Identity;
use crate::time::Instant;

/// Frames with the datagrams of supervision and clocks, besides those of the home domain.
#[derive(Debug)]
pub(super) struct Service {
    home: usize,
    /// Index of the separate frame; `None` without supervision and clocks.
    alone: Option<usize>,
    /// By domain.
    spares: Vec<Option<Spare>>,
    /// No frame of another domain has the datagrams.
    is_home: bool,
    /// The separate frame has no inputs.
    image: Image,
}

/// Frames that replace those of a domain which are loaded without the datagrams, or with them.
#[derive(Debug)]
struct Spare {
    /// Number of the frame in each set.
    at: usize,
    /// One for each set: with process data, and without.
    frames: Vec<[CyclicFrame; 2]>,
}

/// Carrier of the datagrams in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Carrier {
    /// A frame of a domain, or none is needed.
    Domain,
    /// The frame with this index.
    Alone(usize),
}

impl Service {
    /// Builds the frames; appends the separate frame to `frames`.
    pub fn new(identity: &Identity, all_links: u8, layout: &Layout, frames: &mut Vec<CyclicFrame>) -> Service {
        let none = InputNumber { datagram: 0, part: 0 };
        let spares = (0..layout.domains.len()).map(|domain| Spare::new(identity, all_links, layout, domain)).collect();
        let alone = layout.service().map(|planned| {
            frames.push(CyclicFrame::new(identity, all_links, layout.domains.len(), &planned, none));
            frames.len() - 1
        });
        let home = layout.home().unwrap_or_default();
        Service { home, alone, spares, is_home: true, image: Image::new(0, core::iter::empty()) }
    }

    /// Whether the home domain leaves with the datagrams, and no other domain has them.
    #[inline(always)]
    pub fn leaves_at_home(&self, domains: &[Domain]) -> bool {
        self.is_home && domains.get(self.home).is_some_and(Domain::is_queued)
    }

    /// Whether no domain but this one ever has the datagrams.
    pub fn stays_at(&self, domain: usize) -> bool {
        self.home == domain && self.spares.iter().all(Option::is_none)
    }

    /// Gives the datagrams to one of the domains that leave.
    #[cold]
    pub fn place(&mut self, domains: &[Domain], frames: &mut [CyclicFrame], board: &Board, now: Instant) -> Carrier {
        let Some(alone) = self.alone else { return Carrier::Domain };
        let leaves = |domain: usize| domains.get(domain).is_some_and(Domain::is_queued);
        let is_out = |frame: &CyclicFrame| frame.carries_service() && frame.is_waiting() && !frame.overdue(now);
        let mut is_placed = leaves(self.home) || frames.iter().any(is_out);
        self.is_home = true;
        for (number, spare) in self.spares.iter_mut().enumerate() {
            let (Some(spare), Some(domain)) = (spare, domains.get(number)) else { continue };
            if domain.is_queued() {
                spare.exchange(domain, frames, !is_placed, board);
                is_placed = true;
            }
            self.is_home &= !domain.frames().any(|at| frames[at].carries_service());
        }
        if is_placed { Carrier::Domain } else { Carrier::Alone(alone) }
    }

    /// Target of the inputs in the separate frame: none.
    pub fn image_mut(&mut self) -> &mut Image {
        &mut self.image
    }

    /// The domain that has them.
    pub fn home(&self) -> usize {
        self.home
    }
}

impl Spare {
    fn new(identity: &Identity, all_links: u8, layout: &Layout, domain: usize) -> Option<Spare> {
        let (at, with) = layout.substitute(domain)?;
        let planned = layout.domains.get(domain)?;
        let build = |next| {
            let whole = CyclicFrame::new(identity, all_links, domain, &with, next);
            let vacant = whole.vacant(identity, &with);
            [whole, vacant]
        };
        // Numbers of the frame's inputs: behind those of the frames before.
        let datagrams = planned.frames[..at].iter().flat_map(|frame| &frame.datagrams);
        let first = InputNumber {
            datagram: datagrams.clone().count(),
            part: datagrams.map(|datagram| datagram.input_areas.len()).sum(),
        };
        Some(Spare { at, frames: (0..planned.under_way.max(1)).map(|_| build(first)).collect() })
    }

    /// Puts a frame with or without the datagrams in place of the queued one, which has not left.
    fn exchange(&mut self, domain: &Domain, frames: &mut [CyclicFrame], carries: bool, board: &Board) {
        let (set, first) = domain.queued_set();
        let Some(frame) = frames.get_mut(first + self.at).filter(|frame| frame.carries_service() != carries) else {
            return;
        };
        let Some(spare) = self.frames.get_mut(set).map(|pair| &mut pair[usize::from(frame.is_vacant())]) else {
            return;
        };
        if spare.carries_service() != carries {
            return;
        }
        spare.follow(board.taking_part_changes(), board);
        spare.take_over(frame);
        core::mem::swap(spare, frame);
    }
}
