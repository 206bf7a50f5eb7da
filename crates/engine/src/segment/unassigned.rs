//! SubDevices that answer but have no station address of ours: which declared SubDevice they are, if any. One that is
//! none keeps a temporary address and is looked at again when a declared one is lost.

use alloc::format;
use alloc::rc::Rc;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};

use super::Segment;
use super::effect::{Check, Effects, Task};
use super::group_matching;
use super::matching::{Fit, assign};
use super::member::Phase;
use super::owners::{Owners, owners_of, ranks};
use super::setup::Setup;
use super::start::Start;
use super::view::View;
use crate::config::ConfigAddress;
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::time::Instant;

/// So long the others of a gap wait for one that is being read.
const HOLD: Duration = Duration::from_secs(1);

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
    between: (Option<usize>, Option<usize>),
    /// Index of the member right before it.
    pub(super) behind: Option<usize>,
    /// Where it is.
    pub position: Position,
    /// The copy on the main link reaches it.
    from_main: bool,
    /// It was reported as unexpected.
    pub reported: bool,
    /// It is not known since then which of several members it is.
    held_since: Option<Instant>,
    /// What is known about it.
    pub knowledge: Knowledge,
}

/// The place of a SubDevice in the order of positions.
struct At<'a> {
    position: usize,
    owners: &'a Owners,
    main_count: usize,
}

impl UnassignedSubDevice {
    /// One that a scan has found among the owners of all positions, of which the main copy reaches the first
    /// `main_count`.
    pub fn new(info: SubDeviceInfo, owners: &Owners, main_count: usize, reported: bool) -> UnassignedSubDevice {
        let (station, position) = (info.station, usize::from(info.position.0));
        let knowledge = Knowledge::Known(Rc::new(info));
        UnassignedSubDevice::at(station, &At { position, owners, main_count }, reported, knowledge)
    }

    fn at(station: StationAddress, at: &At<'_>, reported: bool, knowledge: Knowledge) -> UnassignedSubDevice {
        let (between, behind) = (at.owners.neighbours(at.position), at.owners.before(at.position));
        let (position, from_main) = (Position(at.position as u16), at.position < at.main_count);
        UnassignedSubDevice { station, between, behind, position, from_main, reported, held_since: None, knowledge }
    }

    /// It is known, as well as it will be for now, that it is none of the declared ones.
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

impl Segment {
    /// The member at each position.
    pub fn owners(&self, stations: &[StationAddress]) -> Owners {
        owners_of(&self.members, stations)
    }

    /// The unassigned SubDevice with a station address.
    pub fn unassigned(&self, station: StationAddress) -> Option<&UnassignedSubDevice> {
        self.unassigned.iter().find(|it| it.station == station)
    }

    fn unassigned_mut(&mut self, station: StationAddress) -> Option<&mut UnassignedSubDevice> {
        self.unassigned.iter_mut().find(|it| it.station == station)
    }

    /// The station addresses of those that are neither members nor listed, or that several have.
    pub fn unknown(&self, view: &View) -> Vec<StationAddress> {
        let owners = self.owners(&view.stations);
        let mut old = Vec::new();
        for (at, station) in view.stations.iter().enumerate() {
            let is_listed = self.unassigned(*station).is_some();
            let is_known = owners.at(at).is_some() || (is_listed && view.position(*station).is_some());
            if !is_known && !old.contains(station) {
                old.push(*station);
            }
        }
        old
    }

    /// Notes where they are now.
    pub(super) fn observe_places(&mut self, view: &View) {
        let owners = self.owners(&view.stations);
        let main_count = usize::from(view.counts.0.0);
        for it in &mut self.unassigned {
            if let Some(position) = view.position(it.station) {
                let at = At { position, owners: &owners, main_count };
                let moved = UnassignedSubDevice::at(it.station, &at, it.reported, it.knowledge.clone());
                *it = UnassignedSubDevice { held_since: it.held_since, ..moved };
            }
        }
    }

    /// These have got temporary addresses: they are to be read.
    pub(super) fn observe_given(&mut self, view: &View, given: &[StationAddress], now: Instant, effects: &mut Effects) {
        let owners = self.owners(&view.stations);
        let main_count = usize::from(view.counts.0.0);
        for station in given.iter().copied() {
            let Some(position) = view.position(station) else { continue };
            let at = At { position, owners: &owners, main_count };
            self.unassigned.push(UnassignedSubDevice::at(station, &at, false, Knowledge::Reading(now)));
            effects.start(Task::ReadUnassigned { station });
        }
    }

    /// One was read, or could not be: then why, where that is worth telling.
    pub(super) fn observe_read(
        &mut self,
        station: StationAddress,
        read: Result<Rc<SubDeviceInfo>, Option<String>>,
        effects: &mut Effects,
    ) {
        self.attention.want();
        let Some(it) = self.unassigned_mut(station) else { return };
        match read {
            Ok(info) => it.knowledge = Knowledge::Known(info),
            Err(None) => {}
            Err(Some(reason)) => {
                if !matches!(&it.knowledge, Knowledge::Unreadable(before) if *before == reason) {
                    effects.report(Event::ScanFailed { reason: reason.clone() });
                    it.knowledge = Knowledge::Unreadable(reason);
                }
            }
        }
    }

    /// One of which it is known that it is none of the declared ones: told once.
    pub(super) fn observe_unexpected(&mut self, station: StationAddress, effects: &mut Effects) {
        let Some(it) = self.unassigned_mut(station) else { return };
        let Knowledge::Known(info) = it.knowledge.clone() else { return };
        if core::mem::replace(&mut it.reported, true) {
            return;
        }
        let it = it.clone();
        effects.report(Event::Unexpected { position: it.position, identity: info.identity });
        if let Some(mismatch) = self.mismatch(&it, &info) {
            effects.report(mismatch);
        }
    }

    /// One that is a member does not fit the process image: told once.
    pub(super) fn observe_misfit(
        &mut self,
        station: StationAddress,
        subdevice: usize,
        reason: String,
        effects: &mut Effects,
    ) {
        let Some(it) = self.unassigned_mut(station) else { return };
        if !core::mem::replace(&mut it.reported, true) {
            effects.failed(subdevice, reason);
        }
    }

    /// One has got the station address of the member that it is.
    pub(super) fn observe_admitted(
        &mut self,
        station: StationAddress,
        index: usize,
        info: SubDeviceInfo,
        effects: &mut Effects,
    ) {
        self.take_place(station, index, effects);
        let Segment { members, layout, .. } = self;
        let Some(member) = members.get_mut(index) else { return };
        let Ok(setup) = Setup::new(index, &member.config, &info, layout) else { return };
        member.setup = Some(Rc::new(setup));
        member.unfit = None;
        member.info = Some(info);
        member.configured = false;
        self.unassigned.retain(|other| other.station != station);
        effects.report(Event::Returned { subdevice: index });
        // Whatever state it is in, it is not one that we brought it to.
        self.start(index, Start::Doubtful, None, Check::None, effects);
    }

    /// What a member's registers need if it is this SubDevice, with its station address.
    ///
    /// # Errors
    /// It does not fit the process image.
    pub fn as_member(
        &self,
        it: &UnassignedSubDevice,
        info: &SubDeviceInfo,
        index: usize,
    ) -> Result<SubDeviceInfo, String> {
        let member = &self.members[index];
        let mut info = SubDeviceInfo { station: member.station, position: it.position, ..info.clone() };
        if let Some(known) = &member.info {
            info.keep_read_online(known);
        }
        match Setup::new(index, &member.config, &info, &self.layout) {
            Ok(_) => Ok(info),
            Err(error) => Err(error.to_string()),
        }
    }

    /// Which absent members they are. To be asked when it is known of all members whether they are there: one that is
    /// absent, but not known to be, may be the one that an unassigned one is. `told`: those of which cables tell it.
    pub fn match_all(&self, told: &[(StationAddress, usize)], now: Instant) -> Matches {
        let mut unassigned = self.unassigned.clone();
        unassigned.sort_by_key(|it| it.position);
        let mut matched = group_matching::members(self, &mut unassigned, now);
        let by_cable = |it: &UnassignedSubDevice| told.iter().find(|(station, _)| *station == it.station);
        for (it, index) in unassigned.iter().filter_map(|it| Some((it, by_cable(it)?.1))) {
            matched.push((it.clone(), Some(index)));
        }
        unassigned.retain(|it| by_cable(it).is_none());
        let mut held = Vec::new();
        for gap in unassigned.chunk_by(|one, other| one.between == other.between) {
            if gap.iter().any(|it| it.is_awaited(now)) {
                continue;
            }
            let mut absent = self.absent_between(gap[0].between);
            absent.retain(|index| told.iter().all(|(_, other)| other != index));
            let from_main: Vec<bool> = gap.iter().map(|it| it.from_main).collect();
            let fit = |candidate: usize, place: usize| fit(self, &gap[candidate], absent[place]);
            for (it, place) in gap.iter().zip(assign(&from_main, absent.len(), fit)) {
                let member = place.map(|place| absent[place]);
                match member.filter(|index| self.is_doubtful(it, *index, gap, &absent)) {
                    Some(index) => held.push((it.station, index)),
                    None => matched.push((it.clone(), member)),
                }
            }
        }
        Matches { matched, held }
    }

    /// It could be another absent member as well: of one kind with several, without a serial number, and not as many of
    /// them are there as are missed. Outputs of one must not go to another one.
    fn is_doubtful(
        &self,
        it: &UnassignedSubDevice,
        index: usize,
        gap: &[UnassignedSubDevice],
        absent: &[usize],
    ) -> bool {
        if fit(self, it, index) != Fit::Seen {
            return false;
        }
        let alike = |index: &usize| self.may_be(it, *index);
        let missed = self.absent().filter(alike).count();
        let here = absent.iter().filter(|index| alike(index)).count();
        let there = gap.iter().filter(|other| self.may_be(other, index)).count();
        // Where some are crossed in a closed ring, order is another one when it is open.
        missed > 1 && (self.cabling.topology.is_assumed() || here != missed || there != missed)
    }

    /// It is left alone until it is known which of several members it is, and that is told when it lasts.
    pub(super) fn hold(&mut self, station: StationAddress, index: usize, now: Instant, effects: &mut Effects) {
        let Some(it) = self.unassigned_mut(station) else { return };
        let since = *it.held_since.get_or_insert(now);
        if now.since(since) >= HOLD && !core::mem::replace(&mut it.reported, true) {
            let reason = format!(
                "the SubDevice at position {} may be this one or another one of its kind that is missed: no cable tells \
                 which, and it has no serial number",
                it.position.0
            );
            effects.failed(index, reason);
        }
    }

    /// Whether an absent member is between the same two others.
    pub(super) fn is_between(&self, it: &UnassignedSubDevice, index: usize) -> bool {
        self.absent_between(it.between).contains(&index)
    }

    /// Absent members between two others, in the order of the segment.
    fn absent_between(&self, between: (Option<usize>, Option<usize>)) -> Vec<usize> {
        let rank = ranks(&self.members);
        let is_absent = |index: &usize| {
            let member = &self.members[*index];
            member.phase == Phase::Absent && member.config.group.is_none()
        };
        let mut absent: Vec<usize> = (0..self.members.len())
            .filter(is_absent)
            .filter(|index| between.0.is_none_or(|before| rank[before] < rank[*index]))
            .filter(|index| between.1.is_none_or(|behind| rank[*index] < rank[behind]))
            .collect();
        absent.sort_by_key(|index| rank[*index]);
        absent
    }

    /// Where one is in the place of the one absent member that belongs there: what differs.
    fn mismatch(&self, it: &UnassignedSubDevice, info: &SubDeviceInfo) -> Option<Event> {
        let [subdevice] = self.absent_between(it.between)[..] else { return None };
        let (field, expected, got) = self.members.get(subdevice)?.config.expected.mismatch(info)?;
        Some(Event::Mismatch { subdevice, position: it.position, field, expected, got })
    }
}

/// How well an unassigned SubDevice fits an absent member.
pub(super) fn fit(segment: &Segment, it: &UnassignedSubDevice, index: usize) -> Fit {
    let member = &segment.members[index];
    let Knowledge::Known(info) = &it.knowledge else { return Fit::Unreadable };
    let identity = &info.identity;
    let mark_fits = match member.config.address {
        address @ (ConfigAddress::Alias { offset: 0, .. } | ConfigAddress::Identification { offset: 0, .. }) => {
            matches!(address, ConfigAddress::Alias { alias: 0, .. }) || address.is_borne_by(info)
        }
        ConfigAddress::Alias { .. } | ConfigAddress::Identification { .. } | ConfigAddress::Position(_) => true,
    };
    if !mark_fits || member.config.expected.mismatch(info).is_some() {
        return Fit::No;
    }
    let Some(known) = member.info.as_ref().map(|info| info.identity) else { return Fit::NeverSeen };
    if (known.vendor_id, known.product_code) != (identity.vendor_id, identity.product_code) {
        Fit::No
    } else if identity.serial != 0 && identity.serial == known.serial {
        Fit::Serial
    } else {
        Fit::Seen
    }
}
