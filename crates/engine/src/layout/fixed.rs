//! Places in the image that were given before the layout, independent of the order of areas on the wire.
//!
//! Input: the areas of a domain, and first bytes for them. Output: the areas in an order that a frame can carry, and
//! the place of each.

use alloc::borrow::Cow;
use alloc::collections::BTreeMap;

use super::plan::PlannedDomain;
use super::spec::{AreaSpec, DomainSpec, ImageOrder};
use crate::order::InOrder;

/// Given first bytes of a domain's areas, and the bytes of its image; empty where the image follows the wire.
pub(super) struct Starts {
    starts: BTreeMap<(usize, u8), u32>,
    bytes: u32,
}

impl Starts {
    pub fn new(spec: &DomainSpec) -> Starts {
        match &spec.image {
            ImageOrder::Packed => Starts { starts: BTreeMap::new(), bytes: 0 },
            ImageOrder::Fixed(image) => {
                let key = |area: &AreaSpec| (area.subdevice, area.sync_manager);
                Starts {
                    starts: spec.areas.iter().map(key).zip(image.starts.iter().copied()).collect(),
                    bytes: image.bytes,
                }
            }
        }
    }

    /// The given first byte of an area.
    pub fn of(&self, area: &AreaSpec) -> Option<u32> {
        self.starts.get(&(area.subdevice, area.sync_manager)).copied()
    }

    /// The specification with the areas of each SubDevice next to each other: frames hold them together.
    pub fn wire_order<'a>(&self, spec: &'a DomainSpec) -> Cow<'a, DomainSpec> {
        if self.starts.is_empty() {
            return Cow::Borrowed(spec);
        }
        let mut first = BTreeMap::new();
        for (number, area) in spec.areas.iter().enumerate() {
            first.entry(area.subdevice).or_insert(number);
        }
        let mut ordered = spec.clone();
        ordered.areas.put_in_order_by_key(|area| first[&area.subdevice]);
        Cow::Owned(ordered)
    }

    /// Bytes of the image: those given, also behind the last area on the wire.
    pub fn image_len(&self, domain: &PlannedDomain) -> u32 {
        let ends = domain.areas.iter().map(|placed| placed.image_offset + u32::from(placed.area.length));
        ends.max().unwrap_or(0).max(self.bytes)
    }
}
