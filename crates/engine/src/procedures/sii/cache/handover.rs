//! The cache for another process.

use alloc::vec::Vec;

use ringcat_wire::sii::{CategoryHeader, SiiHeader};

use super::{Entry, Known, MAX_ENTRIES, Read, SiiCache};
use crate::knowledge::{KnownCategory, KnownContent, KnownEnd, KnownSii, Standing};
use crate::procedures::sii::contents::{ChainEnd, SiiContents};
use crate::procedures::sii::shared_words::SharedWords;

impl SiiCache {
    /// The stored contents.
    pub(crate) fn known(&self) -> Vec<KnownSii> {
        let entries = self.entries.borrow();
        let known = entries.iter().filter_map(|entry| {
            let standing = match &entry.known {
                Known::Once { read: None, .. } => return None,
                Known::Once { read: Some((station, read)), .. } => {
                    Standing::Once { station: *station, content: content(read) }
                }
                Known::Twice(read) => Standing::Twice { content: content(read) },
                Known::Disputed => Standing::Disputed,
            };
            Some(KnownSii { area: entry.area, extent: entry.extent, standing })
        });
        known.collect()
    }

    /// Takes over contents that another process has stored, as far as there is no entry of its own for them.
    pub(crate) fn learn(&self, known: Vec<KnownSii>) {
        if !self.enabled {
            return;
        }
        let mut entries = self.entries.borrow_mut();
        for KnownSii { area, extent, standing } in known.into_iter().take(MAX_ENTRIES) {
            if entries.len() >= MAX_ENTRIES || entries.iter().any(|entry| entry.is_of(&area, extent)) {
                continue;
            }
            let read = |content| (chain(&content), contents(&area, extent, content));
            let known = match standing {
                Standing::Once { station, content } => Known::Once { read: Some((station, read(content))), readers: 0 },
                Standing::Twice { content } => Known::Twice(read(content)),
                Standing::Disputed => Known::Disputed,
            };
            entries.push(Entry { area, extent, known, words: SharedWords::default() });
        }
    }
}

fn content((chain, contents): &Read) -> KnownContent {
    let category = |(kind, at, data): &(_, usize, Vec<u8>)| KnownCategory { kind: *kind, at: *at, data: data.clone() };
    KnownContent {
        chain: chain.iter().map(|header| (header.kind, header.words)).collect(),
        categories: contents.categories.iter().map(category).collect(),
        has_more: contents.has_more,
        end: match contents.end {
            ChainEnd::Sound { at } => KnownEnd::Sound { at },
            ChainEnd::BehindSize { at } => KnownEnd::BehindSize { at },
            ChainEnd::Open { at } => KnownEnd::Open { at },
            ChainEnd::Beyond { kind, at, announced, left } => KnownEnd::Beyond { kind, at, announced, left },
            ChainEnd::Unreadable => KnownEnd::Unreadable,
        },
    }
}

fn chain(content: &KnownContent) -> Vec<CategoryHeader> {
    content.chain.iter().map(|(kind, words)| CategoryHeader { kind: *kind, words: *words }).collect()
}

fn contents(area: &[u8; SiiHeader::LEN], extent: crate::info::SiiExtent, content: KnownContent) -> SiiContents {
    SiiContents {
        header: SiiHeader::decode(area),
        extent,
        categories: content.categories.into_iter().map(|it| (it.kind, it.at, it.data)).collect(),
        has_more: content.has_more,
        end: match content.end {
            KnownEnd::Sound { at } => ChainEnd::Sound { at },
            KnownEnd::BehindSize { at } => ChainEnd::BehindSize { at },
            KnownEnd::Open { at } => ChainEnd::Open { at },
            KnownEnd::Beyond { kind, at, announced, left } => ChainEnd::Beyond { kind, at, announced, left },
            KnownEnd::Unreadable => ChainEnd::Unreadable,
        },
    }
}
