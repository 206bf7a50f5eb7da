//! SubDevices that answer but have no assigned station address. If such a SubDevice is not declared it keeps a
//! temporary address. When a declared SubDevice is lost it is evaluated again, unless it was known to be undeclared
//! while the declared one answered.

use alloc::vec::Vec;
use core::ops::Deref;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};

use super::key::SubDeviceKey;
use super::knowledge::Knowledge;
use super::owners::Owners;
use super::undeclared::Upkeep;
use crate::info::PdoSource;
use crate::time::Instant;

/// Maximum wait for a SubDevice that is being read, before the others of the gap are matched.
pub(super) const HOLD: Duration = Duration::from_secs(1);

/// Members that were present together with a SubDevice without a declaration: it is none of these.
#[derive(Clone, Debug, Default)]
pub(super) struct Presence {
    /// Number of the first round in which it answered.
    pub since: Option<u64>,
    /// Members that answered while it was present, or was known to be none of them, and have left since.
    beside: Vec<usize>,
}

impl Presence {
    /// A member has left that had answered in this round.
    pub fn exclude_from_place(&mut self, index: usize, answered: u64) {
        if self.since.is_some_and(|since| since <= answered) {
            self.is_beside(index);
        }
    }

    /// It was present together with a member.
    pub fn is_beside(&mut self, index: usize) {
        if !self.beside.contains(&index) {
            self.beside.push(index);
        }
    }

    /// Whether it was present together with a member.
    pub fn was_beside(&self, index: usize) -> bool {
        self.beside.contains(&index)
    }
}

/// The state of a SubDevice that is not matched with a declaration.
#[derive(Clone, Debug)]
pub struct Unassigned {
    /// Index of the nearest member before it, and behind it, in the order of positions. Those of groups are left out.
    pub(super) between: (Option<usize>, Option<usize>),
    /// Index of the member directly before it.
    pub(super) behind: Option<usize>,
    /// Its position.
    pub position: Position,
    /// It processes the copy of the main link.
    pub(super) from_main: bool,
    /// It is certainly not declared, or its fault was reported.
    pub reported: bool,
    /// Since this time several members are possible.
    pub(super) held_since: Option<Instant>,
    /// Members that were present together with it.
    pub(super) presence: Presence,
    /// Where the PDOs of its SII are known from when it is read.
    pub(super) pdo_source: PdoSource,
    /// Its requested state and the attempts to reach it; `None` without a request.
    pub upkeep: Option<Upkeep>,
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

impl Unassigned {
    /// A SubDevice at a position, of which nothing was reported.
    pub(super) fn at(at: &At<'_>) -> Unassigned {
        Unassigned {
            between: at.owners.neighbours(at.position),
            behind: at.owners.before(at.position),
            position: Position(at.position as u16),
            from_main: at.position < at.main_count,
            reported: false,
            held_since: None,
            presence: Presence::default(),
            pdo_source: PdoSource::Outdated,
            upkeep: None,
        }
    }
}

impl Unassigned {
    /// It is known to be undeclared, and no state was requested of it. `knowledge`: what is known of it.
    pub(super) fn is_untouched(&self, knowledge: &Knowledge) -> bool {
        self.reported && knowledge.info().is_some() && self.upkeep.is_none()
    }
}

/// An unassigned SubDevice: its state, and what is known of it.
#[derive(Clone, Copy, Debug)]
pub struct UnassignedView<'a> {
    /// Its key, with its temporary address.
    pub key: SubDeviceKey,
    /// Its identity and features, as far as known.
    pub knowledge: &'a Knowledge,
    /// Its state.
    pub unassigned: &'a Unassigned,
}

impl Deref for UnassignedView<'_> {
    type Target = Unassigned;

    fn deref(&self) -> &Unassigned {
        self.unassigned
    }
}

impl UnassignedView<'_> {
    /// It is known to be undeclared, or cannot be read.
    pub fn is_settled(&self) -> bool {
        self.reported || matches!(self.knowledge, Knowledge::Unreadable(_))
    }

    /// It is known, and known to be undeclared.
    pub fn is_undeclared(&self) -> bool {
        self.reported && self.knowledge.info().is_some()
    }

    /// It is being read, and SubDevices around it should wait.
    pub(super) fn is_awaited(&self, now: Instant) -> bool {
        matches!(self.knowledge, Knowledge::Awaited(since) if now.since(*since) < HOLD)
    }
}

/// What the cables show of unassigned SubDevices.
#[derive(Clone, Debug, Default)]
pub struct ByCables {
    /// SubDevices that are members.
    pub members: Vec<(StationAddress, usize)>,
    /// SubDevices at the places of those that were there without a declaration.
    pub others: Vec<StationAddress>,
}

/// Unassigned SubDevices identified as members.
#[derive(Clone, Debug, Default)]
pub struct Matches {
    /// Identified SubDevices: the absent member, or `None` if it is none of them.
    pub matched: Vec<(SubDeviceKey, Option<usize>)>,
    /// SubDevices that may be this member, or another one of the same type.
    pub held: Vec<(SubDeviceKey, usize)>,
}
