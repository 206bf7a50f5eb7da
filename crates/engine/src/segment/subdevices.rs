//! The list of all SubDevices of the segment.

use alloc::collections::{BTreeMap, VecDeque};
use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use super::key::SubDeviceKey;
use super::knowledge::Knowledge;
use super::member::{Member, MemberView};
use super::owners::Owners;
use super::scan::Found;
use super::subdevice::{Role, SubDevice};
use super::unassigned::{Presence, Unassigned, UnassignedView};
use crate::info::SubDeviceInfo;

/// The SubDevices that were found, and those that are declared and absent. A station address occurs once.
#[derive(Debug, Default)]
pub struct SubDevices {
    /// Declared ones come first, by their indices in the declaration.
    all: Vec<SubDevice>,
    declared: usize,
    /// Those without a declaration that no longer answer, the last ones.
    departed: VecDeque<(StationAddress, Presence)>,
}

/// Maximum number of SubDevices that are known to have left: more than stand behind one cable as a rule.
const MAX_DEPARTED: usize = 64;

impl SubDevices {
    /// Declared SubDevices by their indices in the declaration, and those without a declaration.
    pub fn new(declared: Vec<SubDevice>, undeclared: impl IntoIterator<Item = SubDevice>) -> SubDevices {
        let (count, mut all) = (declared.len(), declared);
        all.extend(undeclared);
        SubDevices { all, declared: count, departed: VecDeque::new() }
    }

    /// The SubDevices of a scan, without any declaration.
    pub(super) fn of_scan(found: &Found) -> SubDevices {
        let none = Owners::new(vec![None; found.subdevices.len()], |_| false);
        let undeclared = |info: &Rc<SubDeviceInfo>| SubDevice::undeclared(info.clone(), &none, found.main_count);
        SubDevices::new(Vec::new(), found.subdevices.iter().map(undeclared))
    }

    /// The list at the beginning of a stage: all have their station addresses since this version, and the attempts to
    /// configure members count from this number on.
    pub(super) fn begun(mut self, version: u32, attempt: u32) -> SubDevices {
        self.all.iter_mut().for_each(|it| it.key.since = version);
        self.members_mut().for_each(|member| member.attempt = attempt);
        self
    }

    /// The list with those SubDevices without a declaration that were in another list, too: they keep their keys and
    /// requested states.
    pub(super) fn keeping(mut self, before: SubDevices) -> SubDevices {
        let before = before.all.into_iter().skip(before.declared);
        let before: BTreeMap<StationAddress, SubDevice> = before.map(|it| (it.key.station, it)).collect();
        for it in &mut self.all[self.declared..] {
            let Some(same) = before.get(&it.key.station).filter(|same| same.is_same(it)) else { continue };
            if let (Role::Unassigned(now), Role::Unassigned(unassigned)) = (&mut it.role, &same.role) {
                (it.key, now.upkeep) = (same.key, unassigned.upkeep);
            }
        }
        self
    }

    /// A number above those of all attempts so far, which were begun with `first`.
    pub(super) fn next_attempt(&self, first: u32) -> u32 {
        self.members().map(|member| member.attempt.wrapping_add(1)).max().unwrap_or(first)
    }

    /// All, declared ones first.
    pub fn all(&self) -> &[SubDevice] {
        &self.all
    }

    /// The SubDevice with a station address.
    pub fn at(&self, station: StationAddress) -> Option<&SubDevice> {
        self.all.iter().find(|it| it.key.station == station)
    }

    /// The declared SubDevices, by their indices in the declaration.
    pub fn members(&self) -> impl Iterator<Item = MemberView<'_>> + Clone {
        self.all[..self.declared].iter().filter_map(SubDevice::as_member)
    }

    /// Number of declared SubDevices.
    pub fn member_count(&self) -> usize {
        self.declared
    }

    /// The SubDevice with an index in the declaration.
    pub fn member(&self, index: usize) -> Option<MemberView<'_>> {
        self.all[..self.declared].get(index)?.as_member()
    }

    /// Index in the declaration of the SubDevice with a station address.
    pub fn member_of(&self, station: StationAddress) -> Option<usize> {
        self.all[..self.declared].iter().position(|it| it.key.station == station)
    }

    /// Index in the declaration of the SubDevice at a position of the cabling.
    pub fn member_at(&self, node: usize) -> Option<usize> {
        self.members().position(|member| member.node == Some(node))
    }

    /// SubDevices that answer and have no declaration, or are not yet identified.
    pub fn unassigned(&self) -> impl Iterator<Item = UnassignedView<'_>> + Clone {
        self.all[self.declared..].iter().filter_map(SubDevice::as_unassigned)
    }

    /// The state of a declared SubDevice.
    pub(super) fn member_mut(&mut self, index: usize) -> Option<&mut Member> {
        match &mut self.all[..self.declared].get_mut(index)?.role {
            Role::Declared(member) => Some(member),
            Role::Unassigned(_) => None,
        }
    }

    /// The states of all declared SubDevices.
    pub(super) fn members_mut(&mut self) -> impl Iterator<Item = &mut Member> {
        self.all.iter_mut().filter_map(|it| match &mut it.role {
            Role::Declared(member) => Some(member),
            Role::Unassigned(_) => None,
        })
    }

    /// The identity and features of a declared SubDevice were read.
    pub(super) fn identify(&mut self, index: usize, info: SubDeviceInfo) {
        if let Some(it) = self.all[..self.declared].get_mut(index) {
            it.knowledge = Knowledge::Known(Rc::new(info));
        }
    }

    /// More was read about the SubDevice with this data.
    pub(super) fn replace(&mut self, before: &Rc<SubDeviceInfo>, now: &Rc<SubDeviceInfo>) {
        for it in &mut self.all {
            if let Knowledge::Known(info) = &mut it.knowledge
                && Rc::ptr_eq(info, before)
            {
                info.clone_from(now);
            }
        }
    }

    /// The state of an unassigned SubDevice, and what is known of it.
    pub(super) fn unassigned_mut(&mut self, key: SubDeviceKey) -> Option<(&mut Knowledge, &mut Unassigned)> {
        self.all_unassigned_mut().find(|(of, ..)| *of == key).map(|(_, knowledge, unassigned)| (knowledge, unassigned))
    }

    /// The states of all unassigned SubDevices.
    pub(super) fn all_unassigned_mut(
        &mut self,
    ) -> impl Iterator<Item = (SubDeviceKey, &mut Knowledge, &mut Unassigned)> {
        self.all[self.declared..].iter_mut().filter_map(|it| match &mut it.role {
            Role::Unassigned(unassigned) => Some((it.key, &mut it.knowledge, unassigned)),
            Role::Declared(_) => None,
        })
    }

    /// An unassigned SubDevice was found.
    pub(super) fn add(&mut self, key: SubDeviceKey, knowledge: Knowledge, unassigned: Unassigned) {
        self.all.push(SubDevice { key, knowledge, role: Role::Unassigned(unassigned) });
    }

    /// Unassigned SubDevices no longer answer. They keep their addresses as long as they have power.
    pub(super) fn depart(&mut self, keys: impl Fn(SubDeviceKey) -> bool) {
        let mut left = Vec::new();
        for (key, _, it) in self.all_unassigned_mut().filter(|(key, ..)| keys(*key)) {
            left.push((key.station, core::mem::take(&mut it.presence)));
        }
        self.departed.extend(left);
        let above = self.departed.len().saturating_sub(MAX_DEPARTED);
        self.departed.drain(..above);
        self.remove(keys);
    }

    /// A SubDevice that had left, and has the same address still, gets another one.
    pub(super) fn readdress(&mut self, before: StationAddress, station: StationAddress) {
        if let Some((departed, _)) = self.departed.iter_mut().find(|(departed, _)| *departed == before) {
            *departed = station;
        }
    }

    /// What is known of a SubDevice that had left and has this address.
    pub(super) fn come_back(&mut self, station: StationAddress) -> Option<Presence> {
        let at = self.departed.iter().position(|(departed, _)| *departed == station)?;
        self.departed.remove(at).map(|(_, presence)| presence)
    }

    /// A member has left that had answered in this round. Those without a declaration that were there are others.
    pub(super) fn exclude_from_place(&mut self, index: usize, answered: u64) {
        self.departed.iter_mut().for_each(|(_, presence)| presence.exclude_from_place(index, answered));
        for (_, knowledge, it) in self.all_unassigned_mut() {
            if it.reported && knowledge.info().is_some() {
                it.presence.is_beside(index);
            }
            it.presence.exclude_from_place(index, answered);
        }
    }

    /// Unassigned SubDevices have left, or lost their addresses.
    pub(super) fn remove(&mut self, has_left: impl Fn(SubDeviceKey) -> bool) {
        self.all.retain(|it| matches!(it.role, Role::Declared(_)) || !has_left(it.key));
    }
}
