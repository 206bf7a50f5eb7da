//! Configuration before activation: SubDevices, PDOs, domains, clocks, start-up commands, requests.

use std::time::Duration;

use ringcat::{
    Address, Direction, DomainId, PdoMapping, RefusedPdos, Services, SubDeviceConfig, SubDeviceId, SubDeviceInfo,
    SyncSignals,
};
use ringcat_engine::config::PdoEntry;
use ringcat_engine::exchange::Entry;
use ringcat_sim::description::{DeviceDescription, PdoDescription, PdoEntryDescription};
use ringcat_wire::sii::PdoDirection;

use super::errno::Errno;
use super::master::Ecrt;
use super::plan::Key;
use super::side::Side;

/// Bytes of a request.
const REQUEST_BYTES: usize = 64;

/// A SyncManager as `ec_sync_info_t` has it: number, direction, PDOs. Without PDOs those of the SubDevice stay.
#[derive(Clone, Debug)]
pub struct SyncInfo {
    /// Number; 0xFF ends a list.
    pub index: u8,
    /// Direction.
    pub direction: Direction,
    /// PDOs.
    pub pdos: Vec<PdoMapping>,
}

/// The SyncManagers and PDOs of a device, as named by a program written for the device.
pub fn syncs_of(device: &DeviceDescription) -> Vec<SyncInfo> {
    let mut syncs: Vec<SyncInfo> = Vec::new();
    for pdo in &device.pdos {
        let Some(index) = pdo.sync_manager else { continue };
        match syncs.iter_mut().find(|sync| sync.index == index) {
            Some(sync) => sync.pdos.push(mapping(pdo)),
            None => syncs.push(SyncInfo { index, direction: direction(pdo), pdos: vec![mapping(pdo)] }),
        }
    }
    syncs
}

/// PDOs that a program chooses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChosenPdos {
    /// PDOs that the SubDevice assigns by default, by name.
    Named,
    /// PDOs that it does not assign by default; without such PDOs all but the last.
    Others,
    /// Its default PDOs with their first entries only.
    Shortened,
}

impl ChosenPdos {
    /// All choices.
    pub const ALL: [ChosenPdos; 3] = [ChosenPdos::Named, ChosenPdos::Others, ChosenPdos::Shortened];

    /// SyncManagers and PDOs of a device as chosen; its default ones where it permits no others.
    pub fn of(self, device: &DeviceDescription) -> Vec<SyncInfo> {
        let mut syncs = syncs_of(device);
        let details = device.mailbox.filter(|_| device.has_coe()).map(|mailbox| mailbox.coe_details);
        let (can_assign, can_map) = details.map_or((false, false), |it| (it.pdo_assign(), it.pdo_configuration()));
        for sync in &mut syncs {
            match self {
                ChosenPdos::Others if can_assign => sync.pdos = others(device, sync),
                ChosenPdos::Shortened if can_assign && can_map => sync.pdos.iter_mut().for_each(shorten),
                ChosenPdos::Named | ChosenPdos::Others | ChosenPdos::Shortened => {}
            }
        }
        syncs
    }
}

fn others(device: &DeviceDescription, sync: &SyncInfo) -> Vec<PdoMapping> {
    let others = device.pdos.iter().filter(|pdo| pdo.sync_manager.is_none() && direction(pdo) == sync.direction);
    let others: Vec<PdoMapping> = others.map(mapping).collect();
    let all_but_the_last = sync.pdos.len().saturating_sub(1).max(1);
    if others.is_empty() { sync.pdos.iter().take(all_but_the_last).cloned().collect() } else { others }
}

fn shorten(pdo: &mut PdoMapping) {
    pdo.entries.iter_mut().for_each(|entries| entries.truncate(1));
}

fn direction(pdo: &PdoDescription) -> Direction {
    if pdo.direction == PdoDirection::Rx { Direction::Outputs } else { Direction::Inputs }
}

fn mapping(pdo: &PdoDescription) -> PdoMapping {
    let entry = |entry: &PdoEntryDescription| PdoEntry::new(entry.index, entry.sub_index, entry.bit_length);
    PdoMapping::of(pdo.index, pdo.entries.iter().map(entry).collect::<Vec<_>>())
}

impl Ecrt {
    /// `ecrt_master_create_domain`.
    ///
    /// # Errors
    /// [`Errno::Inval`]: active, or not reserved.
    pub fn create_domain(&mut self) -> Result<DomainId, Errno> {
        self.configuring()?;
        Ok(self.plan.declaration.add_domain(Duration::ZERO))
    }

    fn configuring(&mut self) -> Result<(), Errno> {
        if self.is_reserved() && !self.is_active() { Ok(()) } else { Err(Errno::Inval) }
    }

    /// `ecrt_master_slave_config`: the same configuration again for the same address and identity.
    ///
    /// # Errors
    /// [`Errno::NoEnt`]: another identity at this address. [`Errno::Inval`]: active, or not reserved.
    pub fn slave_config(&mut self, alias: u16, position: u16, identity: (u32, u32)) -> Result<SubDeviceId, Errno> {
        self.configuring()?;
        let key = Key { alias, position, identity };
        let same_place = |other: &Key| (other.alias, other.position) == (alias, position);
        if let Some(at) = self.plan.keys.iter().position(same_place) {
            return if self.plan.keys[at] == key { Ok(SubDeviceId(at)) } else { Err(Errno::NoEnt) };
        }
        self.plan.keys.push(key);
        let config = SubDeviceConfig::at_alias(alias, position).expect_product(identity.0, identity.1);
        let config = config.refused_pdos(RefusedPdos::Warn);
        Ok(self.plan.declaration.add_without_domain(config))
    }

    /// The configured SubDevice as it was found; `None` while it is offline.
    pub fn found(&mut self, config: SubDeviceId) -> Option<SubDeviceInfo> {
        let scanned = self.side.engine().subdevices();
        self.plan.declaration.found(&scanned, config).cloned()
    }

    /// `ecrt_slave_config_pdos`; a list ends at the index 0xFF.
    pub fn pdos(&mut self, config: SubDeviceId, syncs: &[SyncInfo]) {
        for sync in syncs.iter().take_while(|sync| sync.index != u8::MAX) {
            if !sync.pdos.is_empty() {
                self.plan.change(config, |it| it.assign(sync.index, sync.direction, sync.pdos.clone()));
            }
        }
    }

    /// `ecrt_slave_config_reg_pdo_entry`: the byte in the image; the bit in it, where the caller takes it.
    ///
    /// # Errors
    /// [`Errno::NoEnt`], [`Errno::Overflow`]; [`Errno::Fault`]: it begins within a byte and the bit is not taken.
    pub fn reg_pdo_entry(
        &mut self,
        config: SubDeviceId,
        (index, sub_index): (u16, u8),
        domain: DomainId,
        bit_position: Option<&mut u32>,
    ) -> Result<usize, Errno> {
        self.configuring()?;
        let found = self.found(config);
        let entry: Entry = self.plan.declaration.register_entry(domain, config, index, sub_index, found.as_ref())?;
        match bit_position {
            Some(bit) => *bit = entry.bit_position().into(),
            None if entry.bit_position() != 0 => return Err(Errno::Fault),
            None => {}
        }
        Ok(entry.byte_offset())
    }

    /// `ecrt_domain_reg_pdo_entry_list`: configurations and entries in order, up to the first failure.
    ///
    /// # Errors
    /// As [`Ecrt::reg_pdo_entry`].
    pub fn reg_pdo_entry_list(
        &mut self,
        domain: DomainId,
        list: &[(SubDeviceId, u16, u8)],
    ) -> Result<Vec<usize>, Errno> {
        let mut bit = 0;
        list.iter()
            .take_while(|(_, index, _)| *index != 0)
            .map(|(config, index, sub_index)| self.reg_pdo_entry(*config, (*index, *sub_index), domain, Some(&mut bit)))
            .collect()
    }

    /// The first entry of each PDO that the SubDevice has by default.
    pub fn default_entries(&mut self, config: SubDeviceId) -> Vec<(u16, u8)> {
        let found = self.found(config);
        let pdos = found.into_iter().flat_map(|info| info.pdos).filter(|pdo| pdo.sync_manager.is_some());
        let first = pdos.filter_map(|pdo| pdo.entries.into_iter().find(|entry| entry.index != 0));
        first.map(|entry| (entry.index, entry.sub_index)).collect()
    }

    /// The first entry of each SyncManager of a list.
    pub fn entries_of(syncs: &[SyncInfo]) -> Vec<(u16, u8)> {
        let first = |sync: &SyncInfo| {
            let mut entries = sync.pdos.iter().filter_map(|pdo| pdo.entries.as_ref()).flatten();
            entries.find(|entry| entry.index != 0).map(|entry| (entry.index, entry.sub_index))
        };
        syncs.iter().filter_map(first).collect()
    }

    /// `ecrt_domain_size`.
    pub fn domain_size(&self, domain: DomainId) -> usize {
        self.plan.declaration.image_bytes(domain)
    }

    /// `ecrt_slave_config_dc`: SYNC0 with this cycle and shift; a word of 0 switches the signals off.
    pub fn dc(&mut self, config: SubDeviceId, assign_activate: u16, cycle_ns: u32, shift_ns: i32) {
        self.plan.clocks = true;
        let signals = SyncSignals::sync0(cycle_ns, shift_ns).with_assign_activate(assign_activate);
        self.plan.change(config, |mut it| {
            it.sync = (assign_activate != 0).then_some(signals);
            it
        });
    }

    /// Clocks are set up, also where no SubDevice has SYNC signals.
    pub fn with_clocks(&mut self) {
        self.plan.clocks = true;
    }

    /// `ecrt_master_select_reference_clock`.
    pub fn select_reference_clock(&mut self, config: SubDeviceId) {
        self.plan.reference = Some(config);
    }

    /// `ecrt_slave_config_sdo`.
    pub fn config_sdo(&mut self, config: SubDeviceId, index: u16, sub_index: u8, data: &[u8]) {
        self.plan.change(config, |it| it.sdo(index, sub_index, data));
    }

    /// `ecrt_slave_config_watchdog`; 0 leaves a register as it is.
    pub fn watchdog(&mut self, config: SubDeviceId, divider: u16, intervals: u16) {
        let written = |value: u16| (value != 0).then_some(value);
        self.plan.change(config, |it| it.watchdog(written(divider), written(intervals)));
    }

    /// `ecrt_slave_config_create_sdo_request`; the number of the request.
    ///
    /// # Errors
    /// [`Errno::Inval`]: active, or not reserved.
    pub fn create_sdo_request(&mut self, config: SubDeviceId, index: u16, sub_index: u8) -> Result<usize, Errno> {
        self.configuring()?;
        let Side::Idle(main_device) = &mut self.side else { return Err(Errno::Inval) };
        let mut request = Services::create_sdo_request(&mut **main_device, Address::from(config), REQUEST_BYTES);
        request.set_object(index, sub_index, false).map_err(|_| Errno::Busy)?;
        self.requests.sdo.push(request);
        Ok(self.requests.sdo.len() - 1)
    }

    /// `ecrt_slave_config_create_reg_request`.
    ///
    /// # Errors
    /// As [`Ecrt::create_sdo_request`].
    pub fn create_reg_request(&mut self, config: SubDeviceId) -> Result<usize, Errno> {
        self.configuring()?;
        let Side::Idle(main_device) = &mut self.side else { return Err(Errno::Inval) };
        let request = Services::create_register_request(&mut **main_device, Address::from(config), REQUEST_BYTES);
        self.requests.register.push(request);
        Ok(self.requests.register.len() - 1)
    }

    /// `ecrt_slave_config_create_soe_request`.
    ///
    /// # Errors
    /// As [`Ecrt::create_sdo_request`].
    pub fn create_soe_request(&mut self, config: SubDeviceId) -> Result<usize, Errno> {
        self.configuring()?;
        let Side::Idle(main_device) = &mut self.side else { return Err(Errno::Inval) };
        let request = Services::create_soe_request(&mut **main_device, Address::from(config), REQUEST_BYTES);
        self.requests.soe.push(request);
        Ok(self.requests.soe.len() - 1)
    }

    /// `ecrt_slave_config_create_voe_handler`.
    ///
    /// # Errors
    /// As [`Ecrt::create_sdo_request`].
    pub fn create_voe_handler(&mut self, config: SubDeviceId) -> Result<usize, Errno> {
        self.configuring()?;
        let Side::Idle(main_device) = &mut self.side else { return Err(Errno::Inval) };
        let handler = Services::create_voe_handler(&mut **main_device, Address::from(config), REQUEST_BYTES);
        self.requests.voe.push(handler);
        Ok(self.requests.voe.len() - 1)
    }
}
