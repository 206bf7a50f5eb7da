//! Frames that are sent again within their cycle: check 10 of [`crate::capture`].
//!
//! Input: the sent cyclic frames of one link, in the order of time. A cycle begins with a frame that carries a datagram
//! with a physical address (supervision, clocks). A later frame of the cycle with process data alone is a further try
//! if all of it lies in logical addresses that the cycle has addressed before with the same command, or with LRW.

use super::ethercat::{Datagram, Frame};

const LRD: u8 = 10;
const LWR: u8 = 11;
const LRW: u8 = 12;

/// A logical datagram of a first try.
#[derive(Debug)]
struct Addressed {
    command: u8,
    first: u32,
    data: Vec<u8>,
}

/// The logical datagrams of a cycle on one link.
#[derive(Debug, Default)]
pub struct Cycle {
    addressed: Vec<Addressed>,
}

impl Cycle {
    /// Takes a frame. `None` if it is a first try; for a further try whether its outputs are those of the first one.
    pub fn take(&mut self, frame: &Frame<'_>) -> Option<bool> {
        let is_logical = |datagram: &Datagram<'_>| [LRD, LWR, LRW].contains(&datagram.command);
        if !frame.datagrams.iter().all(is_logical) {
            self.addressed.clear();
        } else if !self.addressed.is_empty() {
            let alike: Option<Vec<bool>> = frame.datagrams.iter().map(|datagram| self.is_alike(datagram)).collect();
            if let Some(alike) = alike {
                return Some(alike.into_iter().all(|alike| alike));
            }
        }
        for datagram in frame.datagrams.iter().filter(|datagram| is_logical(datagram)) {
            let (command, data) = (datagram.command, datagram.data.to_vec());
            self.addressed.push(Addressed { command, first: datagram.address(), data });
        }
        None
    }

    /// Whether the cycle has sent the same outputs there; `None` if it has not addressed these bytes.
    fn is_alike(&self, datagram: &Datagram<'_>) -> Option<bool> {
        self.addressed.iter().find_map(|before| {
            let at = usize::try_from(datagram.address().checked_sub(before.first)?).ok()?;
            let sent = before.data.get(at..at + datagram.data.len())?;
            let covers = before.command == datagram.command || before.command == LRW;
            covers.then(|| datagram.command == LRD || sent == datagram.data)
        })
    }
}
