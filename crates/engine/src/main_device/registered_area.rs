//! Process data whose place in an image was fixed when it was registered.

use crate::declared::SubDeviceId;
use crate::info::Direction;

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
