//! Kinds of precomputed logical datagrams, and the memory moves of each.

use ringcat_wire::command::Command;

/// Number of stored datagrams: those of a cycle.
const REMEMBERED: usize = 4;

/// Maximum number of pieces of a datagram.
pub(super) const PIECES: usize = 4;

/// In place of a SyncManager number: no SyncManager.
pub(super) const FREE: u8 = u8::MAX;

/// In place of a SyncManager number: the first byte of AL_STATUS, which MainDevices often map with process data.
pub(super) const AL_STATUS: u8 = u8::MAX - 1;

/// A piece of a datagram's data and its address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Move {
    pub(super) write: bool,
    /// SyncManager of its area, [`FREE`] or [`AL_STATUS`].
    pub(super) sync_manager: u8,
    /// Offset in the datagram's data.
    pub(super) at: u16,
    pub(super) len: u16,
    /// Physical address of the first byte.
    pub(super) physical: u16,
}

/// Result for a kind of datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Known {
    pub(super) command: Command,
    pub(super) address: u32,
    pub(super) len: u16,
    /// Number of moves; `None` if each datagram must be evaluated.
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
    /// Discards the results.
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
