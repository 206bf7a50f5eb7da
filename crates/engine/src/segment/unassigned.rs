//! SubDevices that answer but have no assigned station address. If such a SubDevice is not declared it keeps a
//! temporary address, and is evaluated again when a declared one is lost.

use alloc::rc::Rc;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};

use super::owners::Owners;
use crate::info::SubDeviceInfo;
use crate::time::Instant;

/// Maximum wait for a SubDevice that is being read, before the others of the gap are matched.
pub(super) const HOLD: Duration = Duration::from_secs(1);

/// Knowledge about a SubDevice without a declaration.
#[derive(Clone, Debug)]
pub enum Knowledge {
    /// It is being read, since this time.
    Reading(Instant),
    /// Its SII cannot be read; the last reported reason.
    Unreadable(String),
    /// Its data, with its temporary address.
    Known(Rc<SubDeviceInfo>),
}

/// A SubDevice that answers and is not matched with a declaration yet.
#[derive(Clone, Debug)]
pub struct UnassignedSubDevice {
    /// Its temporary address.
    pub station: StationAddress,
    /// The version of the addresses in which it got this address.
    pub(super) since: u32,
    /// Index of the nearest member before it, and behind it, in the order of positions. Those of groups are left out.
    pub(super) between: (Option<usize>, Option<usize>),
    /// Index of the member directly before it.
    pub(super) behind: Option<usize>,
    /// Its position.
    pub position: Position,
    /// It processes the copy of the main link.
    pub(super) from_main: bool,
    /// It was reported as unexpected.
    pub reported: bool,
    /// Since this time several members are possible.
    pub(super) held_since: Option<Instant>,
    /// Its identity, as far as known.
    pub knowledge: Knowledge,
}

/// The place of a SubDevice in the order of positions.
pub(super) struct At<'a> {
    /// Its position.
    pub position: usize,
    /// The members at all positions.
    pub owners: &'a Owners,
    /// Positions on the main link.
    pub main_count: usize,
}

impl UnassignedSubDevice {
    /// A SubDevice found by a scan. `owners` has all positions; the first `main_count` are on the main link.
    pub fn new(info: Rc<SubDeviceInfo>, owners: &Owners, main_count: usize, reported: bool) -> UnassignedSubDevice {
        let (station, position) = (info.station, usize::from(info.position.0));
        let knowledge = Knowledge::Known(info);
        UnassignedSubDevice::at((station, 0), &At { position, owners, main_count }, reported, knowledge)
    }

    /// `station` contains its address, and the version of the addresses in which it got the address.
    pub(super) fn at(
        (station, since): (StationAddress, u32),
        at: &At<'_>,
        reported: bool,
        knowledge: Knowledge,
    ) -> UnassignedSubDevice {
        let (between, behind) = (at.owners.neighbours(at.position), at.owners.before(at.position));
        let (position, from_main) = (Position(at.position as u16), at.position < at.main_count);
        let held_since = None;
        UnassignedSubDevice { station, since, between, behind, position, from_main, reported, held_since, knowledge }
    }

    /// It is known to be undeclared, or cannot be read.
    pub fn is_settled(&self) -> bool {
        self.reported || matches!(self.knowledge, Knowledge::Unreadable(_))
    }

    /// It is being read, and SubDevices around it should wait.
    pub(super) fn is_awaited(&self, now: Instant) -> bool {
        matches!(self.knowledge, Knowledge::Reading(since) if now.since(since) < HOLD)
    }
}

/// Unassigned SubDevices identified as members.
#[derive(Clone, Debug, Default)]
pub struct Matches {
    /// Identified SubDevices: the absent member, or `None` if it is none of them.
    pub matched: Vec<(UnassignedSubDevice, Option<usize>)>,
    /// SubDevices that may be this member, or another one of the same type.
    pub held: Vec<(StationAddress, usize)>,
}
