//! SubDevices that answer but have no station address of ours. One that is no declared one keeps a temporary address
//! and is looked at again when a declared one is lost.

use alloc::rc::Rc;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};

use super::owners::Owners;
use crate::info::SubDeviceInfo;
use crate::time::Instant;

/// So long the others of a gap wait for one that is being read.
pub(super) const HOLD: Duration = Duration::from_secs(1);

/// What is known about a SubDevice without a declaration.
#[derive(Clone, Debug)]
pub enum Knowledge {
    /// It is being read since then.
    Reading(Instant),
    /// Its SII cannot be read; this was reported last.
    Unreadable(String),
    /// Which one it is, with its temporary address.
    Known(Rc<SubDeviceInfo>),
}

/// A SubDevice that answers and is no declared one yet.
#[derive(Clone, Debug)]
pub struct UnassignedSubDevice {
    /// Its temporary address.
    pub station: StationAddress,
    /// Index of the nearest member before it, and behind it, in the order of positions. Those of groups are left out.
    pub(super) between: (Option<usize>, Option<usize>),
    /// Index of the member right before it.
    pub(super) behind: Option<usize>,
    /// Where it is.
    pub position: Position,
    /// The copy on the main link reaches it.
    pub(super) from_main: bool,
    /// It was reported as unexpected.
    pub reported: bool,
    /// It is not known since then which of several members it is.
    pub(super) held_since: Option<Instant>,
    /// What is known about it.
    pub knowledge: Knowledge,
}

/// The place of a SubDevice in the order of positions.
pub(super) struct At<'a> {
    /// Its position.
    pub position: usize,
    /// The members at all positions.
    pub owners: &'a Owners,
    /// Positions that the main copy reaches.
    pub main_count: usize,
}

impl UnassignedSubDevice {
    /// One that a scan has found among the owners of all positions, of which the main copy reaches the first
    /// `main_count`.
    pub fn new(info: SubDeviceInfo, owners: &Owners, main_count: usize, reported: bool) -> UnassignedSubDevice {
        let (station, position) = (info.station, usize::from(info.position.0));
        let knowledge = Knowledge::Known(Rc::new(info));
        UnassignedSubDevice::at(station, &At { position, owners, main_count }, reported, knowledge)
    }

    pub(super) fn at(
        station: StationAddress,
        at: &At<'_>,
        reported: bool,
        knowledge: Knowledge,
    ) -> UnassignedSubDevice {
        let (between, behind) = (at.owners.neighbours(at.position), at.owners.before(at.position));
        let (position, from_main) = (Position(at.position as u16), at.position < at.main_count);
        UnassignedSubDevice { station, between, behind, position, from_main, reported, held_since: None, knowledge }
    }

    /// It is known to be none of the declared ones, or cannot be read.
    pub fn is_settled(&self) -> bool {
        self.reported || matches!(self.knowledge, Knowledge::Unreadable(_))
    }

    /// It is being read, and those around it should wait.
    pub(super) fn is_awaited(&self, now: Instant) -> bool {
        matches!(self.knowledge, Knowledge::Reading(since) if now.since(since) < HOLD)
    }
}

/// Which members unassigned SubDevices are.
#[derive(Clone, Debug, Default)]
pub struct Matches {
    /// Those of which it is known: the absent member that one is, or `None` where it is none of them.
    pub matched: Vec<(UnassignedSubDevice, Option<usize>)>,
    /// Those that may be this member, or another one of the same kind.
    pub held: Vec<(StationAddress, usize)>,
}
