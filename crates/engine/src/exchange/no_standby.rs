//! The exchange without MainDevice redundancy: one MainDevice, which is ACTIVE.

use super::{Exchange, Received};
use crate::link::Link;
use crate::ring::{FrameCopy, Sequence};

/// Nothing.
#[derive(Debug, Default)]
pub(super) struct Standby {}

impl Standby {
    pub const fn is_inactive(&self) -> bool {
        false
    }

    pub const fn awaits_copies(&self) -> bool {
        false
    }
}

impl Exchange {
    pub(super) fn send_master_frames(&mut self, _before: Sequence, _transmit: &mut impl FnMut(Link, &[u8])) {}

    pub(super) fn receive_master(&mut self, _index: u16, _copy: FrameCopy, _bytes: &[u8]) -> Option<Received> {
        None
    }

    pub(super) fn note_foreign(&mut self, _arrived_on: Link, _bytes: &[u8]) {}
}
