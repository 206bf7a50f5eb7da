//! Places that are known before activation: an entry has its final place as soon as it is registered.
//!
//! Input: a declaration, and the scan data of a SubDevice. Output: the place of an entry in the image of its domain.
//! The whole SyncManager of the entry comes into the image, padded to bytes, behind those registered before; a later
//! registration moves nothing. This is how programs for IgH's interface place process data.

use alloc::vec::Vec;

use super::areas::{Areas, Declared};
use super::register_error::RegisterError;
use super::registered_area::{EntryPlace, RegisteredArea};
use super::working_counters::expected_as_igh;
use crate::config::{Resolution, resolve};
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::exchange::Entry;
use crate::info::SubDeviceInfo;
use crate::main_device::declaration::{Declaration, DomainConfig};
use crate::order::InOrder;
use crate::plan::{MappedEntry, plan};
use crate::segment::setup::declared_areas;

/// FMMUs that a controller has at most (protocol 3.10).
const MOST_FMMUS: u8 = 16;
/// Bytes of an image.
const MOST_BYTES: u32 = 1 << 31;

impl Declaration {
    /// Scan data of a declared SubDevice; `None` if it is absent or has another identity.
    pub fn found<'a>(&self, scanned: &'a [SubDeviceInfo], subdevice: SubDeviceId) -> Option<&'a SubDeviceInfo> {
        match resolve(&self.subdevices, scanned).get(subdevice.0)? {
            Resolution::Found { info, .. } => scanned.get(*info),
            _ => None,
        }
    }

    /// Registers a PDO entry in a domain and returns its final place: byte and bit in the domain's image. SyncManagers
    /// are searched in the order of their numbers. The first entry of a SyncManager brings the whole SyncManager into
    /// the image, once per domain. A SyncManager may be registered in several domains; each takes an FMMU.
    ///
    /// `found`: the SubDevice ([`Declaration::found`]). Without it the PDOs of the declaration count, which must have
    /// all their entries. PDOs must be assigned before; the activation refuses areas of another size.
    ///
    /// ```
    /// use core::time::Duration;
    /// use ringcat_engine::config::{PdoEntry, PdoMapping, SubDeviceConfig};
    /// use ringcat_engine::info::Direction;
    /// use ringcat_engine::main_device::{Declaration, SubDeviceId};
    ///
    /// let statusword = PdoMapping::of(0x1A00, [PdoEntry::new(0x6041, 0, 16), PdoEntry::new(0x6064, 0, 32)]);
    /// let drive = SubDeviceConfig::at_position(0).assign(3, Direction::Inputs, vec![statusword]);
    /// let mut declaration = Declaration::default();
    /// declaration.subdevices.push(drive);
    /// let domain = declaration.add_domain(Duration::from_millis(1));
    /// let position = declaration.register_entry(domain, SubDeviceId(0), 0x6064, 0, None)?;
    /// assert_eq!((position.byte_offset(), declaration.image_bytes(domain)), (2, 6));
    /// # Ok::<(), ringcat_engine::main_device::RegisterError>(())
    /// ```
    ///
    /// # Errors
    /// No such domain or SubDevice, no such entry, more places than FMMUs. Nothing is registered then.
    pub fn register_entry(
        &mut self,
        domain: DomainId,
        subdevice: SubDeviceId,
        index: u16,
        sub_index: u8,
        found: Option<&SubDeviceInfo>,
    ) -> Result<Entry, RegisterError> {
        let areas = self.areas(subdevice, found)?;
        let mut listed = areas.list();
        listed.put_in_order_by_key(|(sync_manager, ..)| *sync_manager);
        let is_wanted = |entry: &MappedEntry| (entry.index, entry.sub_index) == (index, sub_index);
        let mapped = listed.iter().find_map(|(sync_manager, ..)| {
            let entry = areas.mapped(*sync_manager).into_iter().find(is_wanted)?;
            Some((*sync_manager, entry))
        });
        let (sync_manager, entry) = mapped.ok_or(RegisterError::NotMapped { subdevice, index, sub_index })?;
        self.place(domain, subdevice, sync_manager, &areas, found).map(|area| of_area(domain, &area, &entry))
    }

    /// As [`Declaration::register_entry`], for the entry at a place.
    ///
    /// # Errors
    /// As [`Declaration::register_entry`].
    pub fn register_entry_at(
        &mut self,
        domain: DomainId,
        subdevice: SubDeviceId,
        place: EntryPlace,
        found: Option<&SubDeviceInfo>,
    ) -> Result<Entry, RegisterError> {
        let areas = self.areas(subdevice, found)?;
        let pdos = areas.pdos(place.sync_manager);
        let mapped = pdos.get(place.pdo).and_then(|entries| entries.get(place.entry)).copied();
        let mapped = mapped.ok_or(RegisterError::NoSuchPlace { subdevice, place })?;
        self.place(domain, subdevice, place.sync_manager, &areas, found).map(|area| of_area(domain, &area, &mapped))
    }

    /// As [`Declaration::register_entry`], for a whole SyncManager.
    ///
    /// # Errors
    /// As [`Declaration::register_entry`].
    pub fn register_sync_manager(
        &mut self,
        domain: DomainId,
        subdevice: SubDeviceId,
        sync_manager: u8,
        found: Option<&SubDeviceInfo>,
    ) -> Result<RegisteredArea, RegisterError> {
        let areas = self.areas(subdevice, found)?;
        self.place(domain, subdevice, sync_manager, &areas, found)
    }

    /// Bytes of the image of a domain as registered so far; 0 for domains that the MainDevice packs.
    pub fn image_bytes(&self, domain: DomainId) -> usize {
        self.domains.get(domain.0).map_or(0, |domain| image_bytes(domain) as usize)
    }

    /// First byte of a domain where the images of all domains lie one after the other in one piece of memory, in the
    /// order of declaration. It counts what is registered so far, so it is final with the last registration.
    pub fn image_start(&self, domain: DomainId) -> usize {
        (0..domain.0).map(|before| self.image_bytes(DomainId(before))).sum()
    }

    /// The working counter that IgH's interface names as expected for a domain of registered process data: as if the
    /// image was exchanged in pieces of at most 1486 bytes, each in one LRW, LWR or LRD.
    /// [`crate::domain::DomainStatus::expected`] counts the datagrams that are in use here.
    pub fn expected_wkc_as_igh(&self, domain: DomainId) -> u32 {
        let areas = self.domains.get(domain.0).into_iter().flat_map(|domain| &domain.registered);
        expected_as_igh(areas.map(|area| (area.subdevice, area.direction, area.length)))
    }

    /// Process data of a SubDevice, whatever its target state.
    fn areas(&self, subdevice: SubDeviceId, found: Option<&SubDeviceInfo>) -> Result<Areas, RegisterError> {
        let config = self.subdevices.get(subdevice.0).ok_or(RegisterError::NoSuchSubDevice { subdevice })?;
        match found {
            Some(info) => match plan(config, info) {
                Ok(plan) => Ok(Areas::Planned(Some(plan))),
                Err(error) => Err(RegisterError::Plan { subdevice, error }),
            },
            None if declared_areas(config).is_none() => Err(RegisterError::Unknown { subdevice }),
            None => Ok(Areas::Declared(Declared::absent(config))),
        }
    }

    /// The place of a SyncManager: its present one, or the next free one.
    fn place(
        &mut self,
        domain: DomainId,
        subdevice: SubDeviceId,
        sync_manager: u8,
        areas: &Areas,
        found: Option<&SubDeviceInfo>,
    ) -> Result<RegisteredArea, RegisterError> {
        let no_area = RegisterError::NoProcessData { subdevice, sync_manager };
        let listed = areas.list();
        let of = |number: u8| listed.iter().find(|(listed, ..)| *listed == number);
        let (_, direction, length) = *of(sync_manager).ok_or(no_area)?;
        let needed = self.fmmus(domain, subdevice, sync_manager, &listed);
        let config = self.domains.get_mut(domain.0).ok_or(RegisterError::NoSuchDomain { domain })?;
        if !config.members.is_empty() {
            return Err(RegisterError::Packed { domain });
        }
        let is_same = |area: &&RegisteredArea| (area.subdevice, area.sync_manager) == (subdevice, sync_manager);
        if let Some(area) = config.registered.iter().find(is_same) {
            return Ok(*area);
        }
        let available = found.map_or(MOST_FMMUS, |info| info.controller.fmmu_count);
        if needed > usize::from(available) {
            return Err(RegisterError::TooManyPlaces { subdevice, needed, available });
        }
        let start = image_bytes(config);
        if start > MOST_BYTES - u32::from(length) {
            return Err(RegisterError::TooLarge { domain });
        }
        let area = RegisteredArea { subdevice, sync_manager, direction, start, length };
        config.registered.push(area);
        Ok(area)
    }

    /// FMMUs of a SubDevice once a SyncManager has a place in a domain: one for each of its areas, and one for each
    /// further place of an area.
    fn fmmus(
        &self,
        domain: DomainId,
        subdevice: SubDeviceId,
        sync_manager: u8,
        listed: &[(u8, crate::info::Direction, u16)],
    ) -> usize {
        let registered = self.domains.iter().enumerate().flat_map(|(number, domain)| {
            let of_subdevice = domain.registered.iter().filter(|area| area.subdevice == subdevice);
            of_subdevice.map(move |area| (number, area.sync_manager))
        });
        let mut places: Vec<(usize, u8)> = registered.collect();
        places.push((domain.0, sync_manager));
        places.put_in_order();
        places.dedup();
        let areas = listed.iter().filter(|(.., length)| *length > 0);
        areas.map(|(number, ..)| places.iter().filter(|(_, other)| other == number).count().max(1)).sum()
    }
}

fn image_bytes(domain: &DomainConfig) -> u32 {
    domain.registered.last().map_or(0, |last| last.start + u32::from(last.length))
}

fn of_area(domain: DomainId, area: &RegisteredArea, entry: &MappedEntry) -> Entry {
    Entry { domain, bit_offset: area.start * 8 + entry.bit_offset, bit_length: entry.bit_length.into() }
}

#[cfg(test)]
mod tests;
