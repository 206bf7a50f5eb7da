//! Changes of SubDevices without a declaration: found, read, reported, or assigned to the member that they are.

use alloc::rc::Rc;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::segment::effect::{Check, Effects, Task};
use crate::segment::key::SubDeviceKey;
use crate::segment::knowledge::Knowledge;
use crate::segment::model::Segment;
use crate::segment::order::owners_of;
use crate::segment::owners::Owners;
use crate::segment::reading::Reading;
use crate::segment::setup::Setup;
use crate::segment::start::Start;
use crate::segment::temporary_address::TemporaryAddress;
use crate::segment::unassigned::{At, Unassigned};
use crate::segment::versions::Versions;
use crate::segment::view::View;
use crate::time::Instant;

impl Segment {
    /// The member at each position.
    pub fn owners(&self, stations: &[StationAddress]) -> Owners {
        owners_of(&self.subdevices, stations)
    }

    /// Station addresses that belong to no member and no listed SubDevice, or to several SubDevices.
    pub fn unknown(&self, view: &View) -> Vec<StationAddress> {
        let owners = self.owners(&view.stations);
        let mut old = Vec::new();
        for (at, station) in view.stations.iter().enumerate() {
            let is_listed = self.subdevices.at(*station).is_some_and(|it| it.as_unassigned().is_some());
            let is_known = owners.at(at).is_some() || (is_listed && view.position(*station).is_some());
            if !is_known && !old.contains(station) {
                old.push(*station);
            }
        }
        old
    }

    /// Addresses are taken away.
    pub(in crate::segment) fn observe_readdressing(&mut self, old: &[StationAddress]) {
        self.addresses.change();
        self.subdevices.remove(|key| old.contains(&key.station));
    }

    /// Stores their present positions.
    pub(in crate::segment) fn observe_places(&mut self, versions: Versions, view: &View) {
        if !self.are_places_valid(versions) {
            return;
        }
        let owners = self.owners(&view.stations);
        let main_count = usize::from(view.counts.0.0);
        for (key, _, it) in self.subdevices.all_unassigned_mut() {
            if let Some(position) = view.position(key.station) {
                let at = At { position, owners: &owners, main_count };
                let presence = core::mem::take(&mut it.presence);
                let Unassigned { reported, held_since, pdo_source, upkeep, .. } = *it;
                *it = Unassigned { reported, held_since, presence, pdo_source, upkeep, ..Unassigned::at(&at) };
            }
        }
    }

    /// These have got temporary addresses: they are to be read.
    pub(in crate::segment) fn observe_given(
        &mut self,
        versions: Versions,
        view: &View,
        given: &[TemporaryAddress],
        now: Instant,
        effects: &mut Effects,
    ) {
        let is_valid = self.are_places_valid(versions);
        let since = self.addresses.change();
        for given in given {
            self.subdevices.readdress(given.before, given.station);
        }
        // The next search finds them again.
        if !is_valid {
            return self.attention.want();
        }
        let owners = self.owners(&view.stations);
        let main_count = usize::from(view.counts.0.0);
        for given in given {
            let Some(position) = view.position(given.station) else { continue };
            let at = At { position, owners: &owners, main_count };
            let key = SubDeviceKey { station: given.station, since };
            let unassigned = Unassigned { pdo_source: given.pdo_source(), ..Unassigned::at(&at) };
            let presence = self.subdevices.come_back(given.station).unwrap_or_default();
            let unassigned = Unassigned { presence, ..unassigned };
            self.subdevices.add(key, Knowledge::Awaited(now), unassigned);
            effects.start(Task::ReadUnassigned { key });
        }
    }

    /// A temporary address that no SubDevice has. `present`: addresses that answer.
    pub fn free_address(&self, present: &[StationAddress]) -> StationAddress {
        self.addresses.next(|address| {
            present.contains(&address)
                || self.cabling.stations.contains(&address)
                || self.subdevices.at(address).is_some()
        })
    }

    /// A search for SubDevices without a known address has ended.
    pub(in crate::segment) fn observe_search(
        &mut self,
        versions: Versions,
        result: Result<(), String>,
        effects: &mut Effects,
    ) {
        if result.is_err() && !self.are_places_valid(versions) {
            return;
        }
        let is_due = self.addresses.searched(result.is_ok());
        if let Err(reason) = result
            && is_due
        {
            effects.report(Event::ScanFailed { reason });
        }
    }

    /// A SubDevice was read, or could not be: then with the reason, if it is to be reported.
    pub(in crate::segment) fn observe_read(
        &mut self,
        key: SubDeviceKey,
        read: Result<Rc<SubDeviceInfo>, Option<String>>,
        effects: &mut Effects,
    ) {
        self.attention.want();
        let Some((knowledge, it)) = self.subdevices.unassigned_mut(key) else { return };
        match read {
            Ok(mut info) => {
                Rc::make_mut(&mut info).pdo_source = it.pdo_source;
                *knowledge = Knowledge::Known(info);
            }
            Err(None) => {}
            Err(Some(reason)) => {
                if !matches!(knowledge, Knowledge::Unreadable(before) if *before == reason) {
                    effects.report(Event::ScanFailed { reason: reason.clone() });
                    *knowledge = Knowledge::Unreadable(reason);
                }
            }
        }
    }

    /// SubDevices without a declaration were read in a round, before the members.
    pub(in crate::segment) fn observe_others(&mut self, unassigned: &[(SubDeviceKey, Reading)]) {
        let round = self.attention.rounds;
        for (key, _) in unassigned.iter().filter(|(_, reading)| reading.is_answer()) {
            if let Some((_, it)) = self.subdevices.unassigned_mut(*key) {
                it.presence.since.get_or_insert(round);
            }
        }
    }

    /// A member that answered no longer does. SubDevices that were known to be undeclared then are others, and so are
    /// those that had answered at their own addresses when the member did.
    pub(in crate::segment) fn exclude_from_place(&mut self, index: usize) {
        if let Some(answered) = self.member(index).map(|member| member.answered) {
            self.subdevices.exclude_from_place(index, answered);
        }
    }

    /// A SubDevice is certainly none of the declared ones: reported once.
    pub(in crate::segment) fn observe_unexpected(&mut self, key: SubDeviceKey, effects: &mut Effects) {
        let Some((Knowledge::Known(info), state)) = self.subdevices.unassigned_mut(key) else { return };
        let (info, is_reported) = (info.clone(), core::mem::replace(&mut state.reported, true));
        let Some(it) = self.unassigned(key).filter(|_| !is_reported) else { return };
        effects.report(Event::Unexpected { position: it.position, identity: info.identity });
        if let Some(mismatch) = self.mismatch(it, &info) {
            effects.report(mismatch);
        }
    }

    /// A SubDevice is a member but does not fit the process image: reported once.
    pub(in crate::segment) fn observe_misfit(
        &mut self,
        key: SubDeviceKey,
        (subdevice, attempt): (usize, u32),
        reason: String,
        effects: &mut Effects,
    ) {
        if self.current(subdevice, attempt).is_none() {
            return;
        }
        let Some((_, it)) = self.subdevices.unassigned_mut(key) else { return };
        if !core::mem::replace(&mut it.reported, true) {
            effects.failed(subdevice, reason);
        }
    }

    /// A SubDevice has got the station address of the member that it is. If it has left since, or another SubDevice was
    /// found to be the member, the next round finds the address at a SubDevice that is not the member.
    pub(in crate::segment) fn observe_admitted(
        &mut self,
        key: SubDeviceKey,
        (index, attempt): (usize, u32),
        info: SubDeviceInfo,
        effects: &mut Effects,
    ) {
        self.addresses.change();
        if self.unassigned(key).is_none() || self.current(index, attempt).is_none() {
            return self.attention.want();
        }
        self.take_place(key.station, index, effects);
        let Some(member) = self.subdevices.member_mut(index) else { return };
        let Ok(setup) = Setup::new(index, &member.config, &info, &self.layout) else { return };
        member.take_setup(index, setup, effects);
        (member.configured, member.answered) = (false, self.attention.rounds);
        self.subdevices.identify(index, info);
        self.tell_scan_of_member(index);
        self.subdevices.remove(|other| other == key);
        effects.report(Event::Returned { subdevice: SubDeviceId(index) });
        // Its state was not set by this session.
        self.start(index, Start::Doubtful, None, Check::None, effects);
    }

    /// What a member is known as from now on if it is this unassigned SubDevice; `None` if that has left.
    ///
    /// # Errors
    /// It does not fit the process image.
    pub fn as_member(&self, key: SubDeviceKey, index: usize) -> Option<Result<SubDeviceInfo, String>> {
        let (it, member) = (self.unassigned(key)?, self.member(index)?);
        let found = SubDeviceInfo::clone(it.knowledge.info()?);
        let mut info = SubDeviceInfo { station: member.station, position: it.position, ..found };
        if let Some(known) = member.info {
            info.keep_dictionary(known);
        }
        let fits = Setup::new(index, &member.config, &info, &self.layout);
        Some(fits.map(|_| info).map_err(|error| error.to_string()))
    }
}
