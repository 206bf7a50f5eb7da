//! Frames for the datagrams that do not depend on a domain: supervision and distributed clocks.
//!
//! They are part of a frame of the home domain, which has the shortest period. When the home domain does not leave, a
//! frame of another domain with enough room carries them; when no domain leaves, a separate frame does.

use ringcat_wire::datagram::{MAX_DATA, OVERHEAD};

use super::plan::PlannedFrame;
use super::{CLOCKS, CLOCKS_LEN, Layout, SUPERVISION_LEN};

impl Layout {
    /// The home domain, by its index: that with the shortest period; domains without a period come last.
    pub fn home(&self) -> Option<usize> {
        let by_period = |index: &usize| {
            let period = self.domains[*index].period;
            (period.is_zero(), period)
        };
        (0..self.domains.len()).min_by_key(by_period)
    }

    /// A frame of supervision and clocks alone; `None` where neither was added.
    pub fn service(&self) -> Option<PlannedFrame> {
        let frames = || self.domains.iter().flat_map(|domain| &domain.frames);
        let supervision = frames().any(|frame| frame.supervision);
        let clocks = frames().any(|frame| frame.clocks);
        (supervision || clocks).then(|| PlannedFrame { supervision, clocks, ..PlannedFrame::default() })
    }

    /// The frame of another domain than the home domain that can carry supervision and clocks in addition: its index
    /// among the frames of the domain, and its plan with them.
    pub fn substitute(&self, domain: usize) -> Option<(usize, PlannedFrame)> {
        let service = self.service().filter(|_| self.home() != Some(domain))?;
        let (bytes, datagrams) = if service.clocks { (CLOCKS_LEN, CLOCKS) } else { (0, 0) };
        let (bytes, datagrams) = match service.supervision {
            true => (bytes + OVERHEAD + SUPERVISION_LEN, datagrams + 1),
            false => (bytes, datagrams),
        };
        let has_room =
            |frame: &PlannedFrame| frame.used() + bytes <= MAX_DATA + OVERHEAD && frame.takes(datagrams, self.most);
        let (at, frame) = self.domains.get(domain)?.frames.iter().enumerate().find(|(_, frame)| has_room(frame))?;
        let PlannedFrame { supervision, clocks, .. } = service;
        Some((at, PlannedFrame { supervision, clocks, ..frame.clone() }))
    }
}
