//! Process data whose place in an image was fixed when it was registered.

use crate::declared::SubDeviceId;
use crate::info::Direction;

/// A PDO entry by its place: SyncManager, PDO in it, entry in the PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct EntryPlace {
    /// The SyncManager.
    pub sync_manager: u8,
    /// The PDO among those of the SyncManager, from 0.
    pub pdo: usize,
    /// The entry among those of the PDO, gaps included, from 0.
    pub entry: usize,
}

impl EntryPlace {
    /// The entry at this place.
    pub const fn new(sync_manager: u8, pdo: usize, entry: usize) -> EntryPlace {
        EntryPlace { sync_manager, pdo, entry }
    }
}

/// The process data of one SyncManager with its place in the image of a domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RegisteredArea {
    /// Index of the SubDevice in the declaration.
    pub subdevice: SubDeviceId,
    /// The SyncManager.
    pub sync_manager: u8,
    /// Direction.
    pub direction: Direction,
    /// First byte in the image of the domain.
    pub start: u32,
    /// Bytes.
    pub length: u16,
}
