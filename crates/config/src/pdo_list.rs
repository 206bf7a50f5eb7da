//! A PDO assignment or PDO mapping object of a dictionary (protocol 6.3), with its content after downloads.

use std::collections::BTreeMap;

use ringcat_engine::config::SdoDownload;
use ringcat_wire::mailbox::coe::pdo_objects::is_mapping;

/// An object with a count at subindex 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct PdoList {
    /// Value of subindex 0; `None` if it is not known.
    count: Option<u8>,
    /// Known entries by subindex.
    entries: BTreeMap<u8, u32>,
}

impl PdoList {
    /// An object with these entries.
    pub(crate) fn new(described: Vec<u32>) -> PdoList {
        let count = u8::try_from(described.len()).unwrap_or(u8::MAX);
        PdoList { count: Some(count), entries: (1..=u8::MAX).zip(described).collect() }
    }

    /// The object after this write.
    pub(crate) fn with(mut self, download: &SdoDownload) -> PdoList {
        let SdoDownload { index, sub_index, complete_access, data, .. } = download;
        let size = if is_mapping(*index) { 4 } else { 2 };
        let mut rest = &data[..];
        if *sub_index == 0 {
            let Some(count) = rest.first() else { return self };
            self.count = Some(*count);
            // With complete access the count has 16 bits.
            rest = rest.get(2..).unwrap_or_default();
        }
        let last = if *complete_access { u8::MAX } else { *sub_index };
        for (sub, bytes) in ((*sub_index).max(1)..=last).zip(rest.chunks_exact(size)) {
            let value = bytes.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
            self.entries.insert(sub, value);
        }
        self
    }

    /// The entries up to the count at subindex 0; `None` if one of them, or the count, is not known.
    pub(crate) fn values(&self) -> Option<Vec<u32>> {
        (1..=self.count?).map(|sub| self.entries.get(&sub).copied()).collect()
    }
}
