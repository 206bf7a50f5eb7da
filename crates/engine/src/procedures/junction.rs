//! Rings behind junctions (facts 9.4): which there are ([`learn()`]), whether
//! those that are declared are where they are said to be ([`refute()`]), what becomes of them ([`watch`]), how they lie in a
//! segment that has changed ([`retrace`]), and where they are broken when nothing comes back ([`look_inside`]).
//!
//! The controllers keep a local ring going by themselves; nothing here is needed for that. It is about knowing: who may
//! be entered from behind without being cabled wrongly, that a cable is broken, and when there must not be another one.

mod learn;
mod look_inside;
mod orders;
mod refute;
mod retrace;
mod watch;

pub(super) use self::learn::learn;
pub(super) use self::orders::note_controls;
pub(crate) use self::orders::{Told, UnderWay, ordering};
pub(crate) use self::refute::refute;
pub(super) use self::retrace::{End, cabling, closings};
pub(super) use self::watch::{JunctionWatch, watch_blocked};

use ringcat_wire::address::StationAddress;

use super::fleet::Fleet;

/// The station address of the member at a place.
fn station_of(fleet: &Fleet, node: usize) -> Option<StationAddress> {
    fleet.members.iter().find(|member| member.node == Some(node)).map(|member| member.station)
}
