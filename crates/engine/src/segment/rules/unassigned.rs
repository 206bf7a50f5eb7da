//! Changes of SubDevices without a declaration: found, read, reported, or assigned to the member that they are.

use alloc::rc::Rc;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::segment::effect::{Check, Effects, Task};
use crate::segment::model::Segment;
use crate::segment::owners::{Owners, owners_of};
use crate::segment::setup::Setup;
use crate::segment::start::Start;
use crate::segment::unassigned::{At, Knowledge, UnassignedSubDevice};
use crate::segment::versions::Versions;
use crate::segment::view::View;
use crate::time::Instant;

impl Segment {
    /// The member at each position.
    pub fn owners(&self, stations: &[StationAddress]) -> Owners {
        owners_of(&self.members, stations)
    }

    /// The unassigned SubDevice with a station address.
    pub fn unassigned(&self, station: StationAddress) -> Option<&UnassignedSubDevice> {
        self.unassigned.iter().find(|it| it.station == station)
    }

    pub(in crate::segment) fn unassigned_mut(&mut self, station: StationAddress) -> Option<&mut UnassignedSubDevice> {
        self.unassigned.iter_mut().find(|it| it.station == station)
    }

    /// Station addresses that belong to no member and no listed SubDevice, or to several SubDevices.
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

    /// Addresses are taken away.
    pub(in crate::segment) fn observe_readdressing(&mut self, old: &[StationAddress]) {
        self.addresses.change();
        self.unassigned.retain(|it| !old.contains(&it.station));
    }

    /// Stores their present positions.
    pub(in crate::segment) fn observe_places(&mut self, versions: Versions, view: &View) {
        if !self.are_places_valid(versions) {
            return;
        }
        let owners = self.owners(&view.stations);
        let main_count = usize::from(view.counts.0.0);
        for it in &mut self.unassigned {
            if let Some(position) = view.position(it.station) {
                let at = At { position, owners: &owners, main_count };
                let moved = UnassignedSubDevice::at((it.station, it.since), &at, it.reported, it.knowledge.clone());
                *it = UnassignedSubDevice { held_since: it.held_since, ..moved };
            }
        }
    }

    /// These have got temporary addresses: they are to be read.
    pub(in crate::segment) fn observe_given(
        &mut self,
        versions: Versions,
        view: &View,
        given: &[StationAddress],
        now: Instant,
        effects: &mut Effects,
    ) {
        let is_valid = self.are_places_valid(versions);
        let since = self.addresses.change();
        // The next search finds them again.
        if !is_valid {
            return self.attention.want();
        }
        let owners = self.owners(&view.stations);
        let main_count = usize::from(view.counts.0.0);
        for station in given.iter().copied() {
            let Some(position) = view.position(station) else { continue };
            let at = At { position, owners: &owners, main_count };
            self.unassigned.push(UnassignedSubDevice::at((station, since), &at, false, Knowledge::Reading(now)));
            effects.start(Task::ReadUnassigned { station, since });
        }
    }

    /// A temporary address that no SubDevice has. `present`: addresses that answer.
    pub fn free_address(&self, present: &[StationAddress]) -> StationAddress {
        self.addresses.next(|address| {
            present.contains(&address)
                || self.cabling.stations.contains(&address)
                || self.member_of(address).is_some()
                || self.unassigned(address).is_some()
        })
    }

    /// A search for SubDevices without a known address has ended.
    pub(in crate::segment) fn observe_search(&mut self, result: Result<(), String>, effects: &mut Effects) {
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
        (station, since): (StationAddress, u32),
        read: Result<Rc<SubDeviceInfo>, Option<String>>,
        effects: &mut Effects,
    ) {
        self.attention.want();
        let Some(it) = self.unassigned_mut(station).filter(|it| it.since == since) else { return };
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

    /// A SubDevice is certainly none of the declared ones: reported once.
    pub(in crate::segment) fn observe_unexpected(&mut self, station: StationAddress, effects: &mut Effects) {
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

    /// A SubDevice is a member but does not fit the process image: reported once.
    pub(in crate::segment) fn observe_misfit(
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

    /// A SubDevice has got the station address of the member that it is. If it has left since, or another SubDevice was
    /// found to be the member, the next round finds the address at a SubDevice that is not the member.
    pub(in crate::segment) fn observe_admitted(
        &mut self,
        station: StationAddress,
        (index, attempt): (usize, u32),
        info: SubDeviceInfo,
        effects: &mut Effects,
    ) {
        self.addresses.change();
        if self.unassigned(station).is_none() || self.current(index, attempt).is_none() {
            return self.attention.want();
        }
        self.take_place(station, index, effects);
        let Segment { members, layout, .. } = self;
        let Some(member) = members.get_mut(index) else { return };
        let Ok(setup) = Setup::new(index, &member.config, &info, layout) else { return };
        member.take_setup(index, setup, effects);
        member.info = Some(Rc::new(info));
        member.configured = false;
        self.unassigned.retain(|other| other.station != station);
        effects.report(Event::Returned { subdevice: SubDeviceId(index) });
        // Its state was not set by this session.
        self.start(index, Start::Doubtful, None, Check::None, effects);
    }

    /// The register values that a member needs if it is this SubDevice, with its station address.
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
}
