//! What a device keeps over a power cycle: files and the firmware (protocol 6.4).

use std::collections::BTreeMap;

use crate::description::FoeDescription;

/// Most files.
const MAX_FILES: usize = 64;

/// Files by name, and which firmware runs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileStore {
    files: BTreeMap<Vec<u8>, Vec<u8>>,
    capacity: usize,
    firmware: Firmware,
}

/// What the boot loader found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum Firmware {
    /// What the device left the factory with.
    #[default]
    Original,
    /// What was written.
    Version(String),
    /// Nothing that can run.
    Erased,
}

impl FileStore {
    /// The files that a device is delivered with.
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

    /// Most bytes that a file of this name may have.
    pub fn room_for(&self, name: &[u8]) -> usize {
        let others: usize = self.files.iter().filter(|(other, _)| *other != name).map(|(_, data)| data.len()).sum();
        self.capacity.saturating_sub(others)
    }

    /// Keeps a file in place of one with this name; false where there are too many or no room.
    pub fn keep(&mut self, name: &[u8], data: Vec<u8>) -> bool {
        let fits = data.len() <= self.room_for(name);
        let fits = fits && (self.files.len() < MAX_FILES || self.files.contains_key(name));
        if fits {
            self.files.insert(name.into(), data);
        }
        fits
    }

    /// Version of the firmware that was written; `None` for the original one.
    pub fn version(&self) -> Option<&str> {
        match &self.firmware {
            Firmware::Version(version) => Some(version),
            Firmware::Original | Firmware::Erased => None,
        }
    }

    /// There is a firmware that can run.
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
