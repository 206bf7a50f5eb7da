//! How well an unassigned SubDevice matches an absent member.

use crate::config::ConfigAddress;
use crate::segment::matching::Fit;
use crate::segment::model::Segment;
use crate::segment::unassigned::UnassignedView;

/// How well an unassigned SubDevice matches an absent member.
pub(super) fn fit(segment: &Segment, it: UnassignedView<'_>, index: usize) -> Fit {
    let Some(member) = segment.member(index) else { return Fit::No };
    let Some(info) = it.knowledge.info() else { return Fit::Unreadable };
    if it.presence.was_beside(index) {
        return Fit::No;
    }
    let identity = &info.identity;
    let mark_fits = match member.config.address {
        // One that was here before is known by its identity, wherever positions are counted from meanwhile.
        ConfigAddress::Alias { alias: 0, offset } => member.info.is_some() || it.position.0 == offset,
        address @ (ConfigAddress::Alias { offset: 0, .. }
        | ConfigAddress::Identification { offset: 0, .. }
        | ConfigAddress::DataWord { offset: 0, .. }) => address.is_mark_of(info),
        ConfigAddress::Alias { .. }
        | ConfigAddress::Identification { .. }
        | ConfigAddress::DataWord { .. }
        | ConfigAddress::Position(_) => true,
    };
    if !mark_fits || member.config.expected.mismatch(info).is_some() {
        return Fit::No;
    }
    let Some(known) = member.info.map(|info| info.identity) else { return Fit::NeverSeen };
    if (known.vendor_id, known.product_code) != (identity.vendor_id, identity.product_code) {
        Fit::No
    } else if identity.serial != 0 && identity.serial == known.serial {
        Fit::Serial
    } else {
        Fit::Seen
    }
}
