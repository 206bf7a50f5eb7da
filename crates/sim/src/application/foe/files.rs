//! Non-volatile data of a device: files and the firmware (protocol 6.4).

use std::collections::BTreeMap;

use crate::description::FoeDescription;

/// Maximum number of files.
const MAX_FILES: usize = 64;

/// Files by name, and the running firmware.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileStore {
    files: BTreeMap<Vec<u8>, Vec<u8>>,
    capacity: usize,
    firmware: Firmware,
}

/// Result of the boot loader.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum Firmware {
    /// The original firmware.
    #[default]
    Original,
    /// A written firmware.
    Version(String),
    /// No valid firmware.
    Erased,
}

impl FileStore {
    /// The files on delivery.
    pub fn new(description: &FoeDescription) -> FileStore {
        let files = description.files.iter().map(|(name, data)| (name.clone().into_bytes(), data.clone())).collect();
        FileStore { files, capacity: description.capacity, firmware: Firmware::Original }
    }

    /// A file.
    pub fn file(&self, name: &[u8]) -> Option<&[u8]> {
        self.files.get(name).map(Vec::as_slice)
    }

    /// Names of the files.
    pub fn names(&self) -> impl Iterator<Item = &[u8]> {
        self.files.keys().map(Vec::as_slice)
    }

    /// Largest size of a file of this name, in bytes.
    pub fn room_for(&self, name: &[u8]) -> usize {
        let others: usize = self.files.iter().filter(|(other, _)| *other != name).map(|(_, data)| data.len()).sum();
        self.capacity.saturating_sub(others)
    }

    /// Stores a file and replaces a file of this name; false without a free entry or space.
    pub fn keep(&mut self, name: &[u8], data: Vec<u8>) -> bool {
        let fits = data.len() <= self.room_for(name);
        let fits = fits && (self.files.len() < MAX_FILES || self.files.contains_key(name));
        if fits {
            self.files.insert(name.into(), data);
        }
        fits
    }

    /// Version of the written firmware; `None` for the original one.
    pub fn version(&self) -> Option<&str> {
        match &self.firmware {
            Firmware::Version(version) => Some(version),
            Firmware::Original | Firmware::Erased => None,
        }
    }

    /// Whether there is valid firmware.
    pub fn has_firmware(&self) -> bool {
        self.firmware != Firmware::Erased
    }

    pub(super) fn set_firmware(&mut self, version: String) {
        self.firmware = Firmware::Version(version);
    }

    pub(super) fn erase_firmware(&mut self) {
        self.firmware = Firmware::Erased;
    }
}
