//! What is known of the object dictionary of a type of SubDevices.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::vec::Vec;

use ringcat_wire::sii::Identity;

use super::object::{Entry, Object};

/// Memory of an object or entry beside its name and values.
const ITEM_BYTES: usize = 128;
/// Memory of an entry that does not exist.
pub(crate) const MISSING_BYTES: usize = 16;

/// The object dictionary of a type of SubDevices, as far as it was read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct KnownDictionary {
    pub vendor_id: u32,
    pub product_code: u32,
    pub revision: u32,
    /// Bytes of the software version.
    pub version: Option<Vec<u8>>,
    /// Indices of all objects, in the order of the SubDevice.
    pub indices: Vec<u16>,
    /// Objects by index.
    pub objects: BTreeMap<u16, Object>,
    /// Entries by index and subindex.
    pub entries: BTreeMap<u32, Entry>,
    /// Subindices without an entry.
    pub missing: BTreeSet<u32>,
    /// All was read; what is not here was refused.
    pub is_complete: bool,
}

/// Memory of an object.
pub(crate) fn bytes_of_object(object: &Object) -> usize {
    ITEM_BYTES + object.name.len()
}

/// Memory of an entry.
pub(crate) fn bytes_of_entry(entry: &Entry) -> usize {
    let values = [&entry.default, &entry.minimum, &entry.maximum].into_iter().flatten();
    ITEM_BYTES + entry.name.len() + values.map(Vec::len).sum::<usize>()
}

/// Index and subindex as one number.
pub(crate) fn place(index: u16, sub_index: u8) -> u32 {
    u32::from(index) << 8 | u32::from(sub_index)
}

impl KnownDictionary {
    /// A type of which nothing else is known.
    pub(crate) fn new(identity: &Identity, version: Option<Vec<u8>>, indices: &[u16]) -> KnownDictionary {
        let Identity { vendor_id, product_code, revision, .. } = *identity;
        KnownDictionary { vendor_id, product_code, revision, version, indices: indices.to_vec(), ..Self::default() }
    }

    /// Whether SubDevices with this identity may be of the type.
    pub(crate) fn is_of(&self, identity: &Identity) -> bool {
        let Identity { vendor_id, product_code, revision, .. } = *identity;
        (self.vendor_id, self.product_code, self.revision) == (vendor_id, product_code, revision)
    }

    /// Whether both are of the same type.
    pub(crate) fn is_of_type(&self, other: &KnownDictionary) -> bool {
        let identity = |it: &KnownDictionary| (it.vendor_id, it.product_code, it.revision);
        identity(self) == identity(other) && self.version == other.version && self.indices == other.indices
    }

    /// Its memory.
    pub(crate) fn bytes(&self) -> usize {
        let first = ITEM_BYTES + self.version.as_ref().map_or(0, Vec::len) + 2 * self.indices.len();
        let objects: usize = self.objects.values().map(bytes_of_object).sum();
        let entries: usize = self.entries.values().map(bytes_of_entry).sum();
        first + objects + entries + MISSING_BYTES * self.missing.len()
    }

    /// An object.
    pub(crate) fn object(&self, index: u16) -> Option<Object> {
        self.objects.get(&index).cloned()
    }

    /// An entry; `Some(None)` if it does not exist.
    pub(crate) fn entry(&self, (index, sub_index): (u16, u8)) -> Option<Option<Entry>> {
        let at = place(index, sub_index);
        let entry = self.entries.get(&at).cloned();
        if entry.is_none() && !self.missing.contains(&at) { None } else { Some(entry) }
    }

    /// Keeps an object; false if it is there already.
    pub(crate) fn keep_object(&mut self, object: Object) -> bool {
        self.objects.insert(object.index, object).is_none()
    }

    /// Keeps an entry; false if it is there already.
    pub(crate) fn keep_entry(&mut self, entry: Entry) -> bool {
        self.entries.insert(place(entry.index, entry.sub_index), entry).is_none()
    }

    /// Keeps that there is no such entry; false if that is known.
    pub(crate) fn keep_missing(&mut self, (index, sub_index): (u16, u8)) -> bool {
        self.missing.insert(place(index, sub_index))
    }
}
