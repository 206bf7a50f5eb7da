//! Kinds of logical datagrams that were compiled, and the moves of memory that each of them makes.

use ringcat_wire::command::Command;

/// Number of datagrams remembered: those of a cycle.
const REMEMBERED: usize = 4;

/// Most pieces of one.
pub(super) const PIECES: usize = 4;

/// In place of a SyncManager's number: none is there.
pub(super) const FREE: u8 = u8::MAX;

/// In place of a SyncManager's number: it is the first byte of AL_STATUS, which MainDevices like to have with process
/// data.
pub(super) const AL_STATUS: u8 = u8::MAX - 1;

/// A piece of a datagram's data and where it lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Move {
    pub(super) write: bool,
    /// SyncManager whose area it lies in, [`FREE`] or [`AL_STATUS`].
    pub(super) sync_manager: u8,
    /// Offset in the datagram's data.
    pub(super) at: u16,
    pub(super) len: u16,
    /// First byte by address.
    pub(super) physical: u16,
}

/// Result for a kind of datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Known {
    pub(super) command: Command,
    pub(super) address: u32,
    pub(super) len: u16,
    /// Number of its moves; `None` where each datagram must be evaluated.
    pub(super) count: Option<u8>,
    pub(super) moves: [Move; PIECES],
}

/// The most recent kinds of datagrams.
#[derive(Clone, Debug, Default)]
pub(in crate::controller) struct Compiled {
    known: [Option<Known>; REMEMBERED],
    oldest: usize,
}

impl Compiled {
    /// The results are no longer valid.
    pub fn forget(&mut self) {
        self.known = [None; REMEMBERED];
    }

    pub(super) fn find(&self, command: Command, address: u32, len: u16) -> Option<&Known> {
        let is = |known: &&Known| known.address == address && known.len == len && known.command == command;
        self.known.iter().flatten().find(is)
    }

    pub(super) fn keep(&mut self, known: Known) {
        self.known[self.oldest] = Some(known);
        self.oldest = (self.oldest + 1) % REMEMBERED;
    }
}
