//! A log of the logical datagrams that a SubDevice processed: evidence from inside the SubDevice, for checkers.
//!
//! Input: each logical datagram processed by the processing unit, with the marks by which a MainDevice identifies its
//! frame. Output: the data of that datagram when it left the SubDevice. The log is disabled unless a checker enables
//! it, and contains only the newest accesses.

use std::collections::VecDeque;
use std::ops::Range;

use ringcat_wire::command::Command;

use crate::time::SimTime;

/// Capacity.
const KEPT: usize = 256;
/// Offset of the source address, in the second byte of which a MainDevice stores the number of a frame (protocol
/// 9.7.1).
const SOURCE_AT: usize = 6;

/// A logical datagram that a SubDevice processed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogicalAccess {
    /// When the first bit of its frame arrived.
    pub at: SimTime,
    /// The last three bytes of the frame's source address: the identity of its MainDevice (protocol 9.7.1).
    pub identity: [u8; 3],
    /// Byte 1 of the frame's source address, and Idx of the datagram.
    pub frame: (u8, u8),
    /// LRD, LWR or LRW.
    pub command: Command,
    /// Logical address of the first byte.
    pub address: u32,
    /// Whether the SubDevice inserted inputs.
    pub read: bool,
    /// Whether the SubDevice took outputs.
    pub written: bool,
    /// Whether its frame has ended without an error. SyncManagers take no outputs of another one, and do not trigger a
    /// watchdog.
    pub is_valid: bool,
    /// The data when the datagram left the SubDevice.
    pub data: Vec<u8>,
    /// Copied pieces: a SubDevice increments the working counter once for all reads, even if SyncManagers refuse a
    /// part.
    pub moved: Vec<Moved>,
}

/// Data that was moved between a datagram and the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moved {
    /// First byte in the data.
    pub at: usize,
    /// Bytes, including bytes of which only some bits were moved.
    pub len: usize,
    /// Whether data was written to the memory.
    pub write: bool,
}

impl LogicalAccess {
    /// Whether all of these bytes of the data were moved in one direction.
    pub fn has_moved(&self, bytes: Range<usize>, write: bool) -> bool {
        let mut at = bytes.start;
        // The pieces have no particular order.
        while at < bytes.end {
            let holds = |it: &&Moved| it.write == write && it.at <= at && at < it.at + it.len;
            let Some(end) = self.moved.iter().filter(holds).map(|it| it.at + it.len).max() else { return false };
            at = end;
        }
        true
    }
}

/// The newest accesses of a SubDevice.
#[derive(Clone, Debug, Default)]
pub(super) struct LogicalLog {
    kept: Option<VecDeque<LogicalAccess>>,
    /// Moves of the datagram that is being processed.
    moved: Vec<Moved>,
    /// The newest accesses, of the frame that is being processed.
    open: usize,
}

impl LogicalLog {
    pub fn is_on(&self) -> bool {
        self.kept.is_some()
    }

    pub fn turn_on(&mut self) {
        self.kept.get_or_insert_default();
    }

    #[inline]
    pub fn moved(&mut self, at: usize, len: usize, write: bool) {
        if self.kept.is_some() {
            self.moved.push(Moved { at, len, write });
        }
    }

    /// Moves since the last call.
    pub fn take_moved(&mut self) -> Vec<Moved> {
        core::mem::take(&mut self.moved)
    }

    pub fn note(&mut self, access: LogicalAccess) {
        let Some(kept) = &mut self.kept else { return };
        if kept.len() == KEPT {
            kept.pop_front();
        }
        kept.push_back(access);
        self.open += 1;
    }

    /// The frame that is being processed has ended.
    #[inline]
    pub fn end_frame(&mut self, good: bool) {
        let open = core::mem::take(&mut self.open);
        if good && open > 0 {
            let accesses = self.kept.iter_mut().flat_map(|kept| kept.iter_mut().rev());
            accesses.take(open).for_each(|access| access.is_valid = true);
        }
    }

    pub fn accesses(&self) -> impl Iterator<Item = &LogicalAccess> {
        self.kept.iter().flat_map(|kept| kept.iter())
    }
}

/// The identity of a frame's MainDevice, and byte 1 of its source address.
pub(super) fn marks(frame: &[u8]) -> ([u8; 3], u8) {
    let source = frame.get(SOURCE_AT..).and_then(<[u8]>::first_chunk::<6>);
    source.map_or(([0; 3], 0), |[_, id, _, a, b, c]| ([*a, *b, *c], *id))
}
