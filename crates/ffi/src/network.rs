//! A network file or an ENI in place of the calls that declare SubDevices, domains and process data: where its
//! variables are in the images of the domains, by name.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;

use ringcat::config::{Configuration, ImageArea, Variable};
use ringcat::daemon::Priority;
use ringcat::eni::EniFile;
use ringcat::network::LoadedNetwork;
use ringcat::{ConfigAddress, Declaration, Direction, DomainId, SubDeviceConfig, SubDeviceInfo};

use crate::code::{Code, Outcome, report, report_as};
use crate::settings::Name;

/// The name of an ENI without a file, for messages.
const ENI_IN_MEMORY: &str = "ENI in memory";
/// Maximum number of notices of a file that are reported one by one.
const MAX_NOTICES: usize = 20;

/// Names of a loaded network. A name that occurs several times means the first one in the file.
#[derive(Debug, Default)]
pub struct Names {
    /// SubDevices, by their index in the declaration.
    pub subdevices: BTreeMap<String, usize>,
    /// Domains.
    pub domains: BTreeMap<String, DomainId>,
    /// Variables.
    pub variables: BTreeMap<String, Place>,
}

/// Place of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Its domain.
    pub domain: DomainId,
    /// First bit in the image of the domain.
    pub bit: u32,
    /// Bits.
    pub bits: u32,
    /// The application writes it.
    pub is_output: bool,
}

/// Where the process data of a SyncManager begins.
#[derive(Clone, Copy, Debug)]
pub struct Area {
    /// The SubDevice.
    pub subdevice: usize,
    /// The SyncManager.
    pub sync_manager: u8,
    /// The domain.
    pub domain: DomainId,
    /// Its direction.
    pub direction: Direction,
    /// First byte in the image of the domain.
    pub start: u32,
    /// Bytes.
    pub length: u32,
}

/// Where the text of a network is.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// In a file.
    Path(&'a str),
    /// In memory.
    Memory(&'a [u8]),
}

/// A network of a network file or an ENI.
#[derive(Debug)]
pub struct Network {
    /// What is declared.
    pub configuration: Configuration,
    /// Names of the domains.
    pub domains: Vec<String>,
    /// It needs a redundant interface.
    pub is_ring: bool,
}

impl Network {
    /// Reads a network file.
    ///
    /// # Errors
    /// It cannot be read, or its content is wrong; a message to the operator says what is wrong, and in which line.
    pub fn of_file(source: Source<'_>) -> Outcome<Network> {
        let loaded = match source {
            Source::Path(path) => LoadedNetwork::load(Path::new(path)),
            Source::Memory(bytes) => LoadedNetwork::from_bytes("network file in memory", bytes),
        };
        let LoadedNetwork { file, configuration, .. } = loaded.map_err(refused)?;
        let domains = file.domain.iter().map(|domain| domain.name.clone()).collect();
        Ok(Network { configuration, domains, is_ring: file.redundancy.ring })
    }

    /// Reads an ENI. Its domains have their numbers as names.
    ///
    /// # Errors
    /// As [`Network::of_file`].
    pub fn of_eni(source: Source<'_>) -> Outcome<Network> {
        let EniFile { configuration, .. } = match source {
            Source::Path(path) => EniFile::load(Path::new(path)).map_err(refused)?,
            Source::Memory(bytes) => {
                EniFile::from_bytes(bytes).map_err(|error| refused(format_args!("{ENI_IN_MEMORY}: {error}")))?
            }
        };
        let name = match source {
            Source::Path(path) => path,
            Source::Memory(_) => ENI_IN_MEMORY,
        };
        report_notices(name, &configuration);
        let domains = (0..configuration.declaration.domains.len()).map(|number| number.to_string()).collect();
        Ok(Network { configuration, domains, is_ring: false })
    }
}

impl Network {
    /// The declared SubDevices.
    pub fn declared(&self) -> &[SubDeviceConfig] {
        &self.configuration.declaration.subdevices
    }
}

/// Reports the settings of a file that are not followed, a line each.
fn report_notices(file: &str, configuration: &Configuration) {
    let notices = &configuration.notices;
    for notice in notices.iter().take(MAX_NOTICES) {
        report_as(Priority::Warning, format_args!("{file}: not followed, or done in another way: {notice}"));
    }
    if let Some(more @ 1..) = notices.len().checked_sub(MAX_NOTICES) {
        report_as(Priority::Warning, format_args!("{file}: {more} more; `ringcat eni FILE` lists all"));
    }
}

fn refused(error: impl Display) -> Code {
    report(format_args!("{error}"));
    Code::INVALID
}

/// The declaration of a network. As those of `ecrt.h`, a SubDevice is used at its exact position only, unless others
/// before it may be absent.
pub fn declaration(network: &Network) -> Declaration {
    let mut declaration = network.configuration.declaration.clone();
    let is_fixed = |config: &SubDeviceConfig| !config.optional && config.group.is_none();
    if declaration.subdevices.iter().all(is_fixed) {
        for config in &mut declaration.subdevices {
            if let ConfigAddress::Position(position) = config.address {
                config.address = ConfigAddress::Alias { alias: 0, offset: position };
            }
        }
    }
    declaration
}

/// The name by which `ecrt_master_slave_config` finds a SubDevice of a file, the one at `index`. One that is found by
/// its identification gets a position that no bus has.
pub fn name(index: usize, config: &SubDeviceConfig) -> Name {
    let (alias, position) = match config.address {
        ConfigAddress::Position(position) => (0, position),
        ConfigAddress::Alias { alias, offset } => (alias, offset),
        _ => (0, u16::MAX - u16::try_from(index).unwrap_or(u16::MAX)),
    };
    let expected = &config.expected;
    let (vendor, product) = (expected.vendor_id.unwrap_or_default(), expected.product_code.unwrap_or_default());
    Name { alias, position, vendor, product }
}

/// SyncManagers of a SubDevice that a member of a domain brings into it: those with PDOs in the file, without any those
/// of the SubDevice that was found.
pub fn sync_managers(config: &SubDeviceConfig, found: Option<&SubDeviceInfo>, wanted: Option<&[u8]>) -> Vec<u8> {
    let numbers: Vec<u8> = match (&config.pdos, found) {
        _ if config.declared.is_some() => {
            let declared = config.declared.iter().flatten().filter(|of| of.role.direction().is_some());
            declared.map(|of| of.index).collect()
        }
        (Some(declared), _) => declared.iter().filter(|of| !of.pdos.is_empty()).map(|of| of.sync_manager).collect(),
        (None, Some(info)) => {
            let all = 0..u8::try_from(info.sync_managers.len()).unwrap_or(u8::MAX);
            all.filter(|number| info.assigned_pdos(*number).next().is_some()).collect()
        }
        (None, None) => Vec::new(),
    };
    numbers.into_iter().filter(|number| wanted.is_none_or(|wanted| wanted.contains(number))).collect()
}

/// The names of a file whose process data is at these places.
pub fn names(configuration: &Configuration, domains: &[String], areas: &[Area]) -> Names {
    let subdevices = configuration.subdevices.iter().enumerate();
    let domains = domains.iter().enumerate();
    let variables = configuration.image.variables.iter();
    // Inserted last to first, so that of several with one name the first one remains.
    Names {
        subdevices: subdevices.rev().map(|(index, facts)| (facts.name.clone(), index)).collect(),
        domains: domains.map(|(number, name)| (name.clone(), DomainId(number))).collect(),
        variables: variables
            .rev()
            .filter_map(|variable| Some((variable.name.clone(), place(&configuration.image.areas, areas, variable)?)))
            .collect(),
    }
}

/// The place of a variable; `None` if its process data is not exchanged, or is not of one SyncManager.
fn place(image: &[ImageArea], areas: &[Area], variable: &Variable) -> Option<Place> {
    let within = image.iter().find(|area| {
        let first = variable.image_bit.checked_sub(area.image_bit);
        let last = first.and_then(|first| first.checked_add(variable.bits));
        area.direction == variable.direction && last.is_some_and(|last| last <= area.bits)
    })?;
    // All process data of a direction is one sequence where the file names no SyncManagers.
    let mut first = within.bit_offset.checked_add(variable.image_bit - within.image_bit)?;
    let is_of = |area: &&Area| (area.subdevice, area.direction) == (within.subdevice, within.direction);
    let mut of_subdevice: Vec<&Area> = areas.iter().filter(is_of).collect();
    of_subdevice.sort_by_key(|area| area.sync_manager);
    let area = match within.sync_manager {
        Some(sync_manager) => of_subdevice.into_iter().find(|area| area.sync_manager == sync_manager)?,
        None => of_subdevice.into_iter().find(|area| {
            let bits = area.length.saturating_mul(8);
            let is_here = first < bits;
            first -= if is_here { 0 } else { bits };
            is_here
        })?,
    };
    if first.checked_add(variable.bits)? > area.length.checked_mul(8)? {
        return None;
    }
    Some(Place {
        domain: area.domain,
        bit: area.start.checked_mul(8)?.checked_add(first)?,
        bits: variable.bits,
        is_output: variable.direction == Direction::Outputs,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two SyncManagers of one SubDevice with 2 and 1 bytes of inputs, 100 bytes apart in the domain.
    fn areas() -> [Area; 2] {
        let (subdevice, domain, direction) = (0, DomainId(0), Direction::Inputs);
        let area = |sync_manager, start, length| Area { subdevice, sync_manager, domain, direction, start, length };
        [area(4, 100, 1), area(3, 0, 2)]
    }

    fn image(sync_manager: Option<u8>, bit_offset: u32, image_bit: u32, bits: u32) -> ImageArea {
        ImageArea { subdevice: 0, direction: Direction::Inputs, sync_manager, bit_offset, image_bit, bits }
    }

    fn bit_of(image: &[ImageArea], image_bit: u32, bits: u32) -> Option<u32> {
        let (name, data_type, direction) = (String::new(), String::new(), Direction::Inputs);
        let variable = Variable { name, data_type, direction, image_bit, bits, subdevice: Some(0) };
        place(image, &areas(), &variable).map(|place| place.bit)
    }

    // covers: c-interface, eni-run
    #[test]
    fn a_variable_has_a_place_if_it_is_within_one_sync_manager() {
        let named = [image(Some(3), 0, 0, 16), image(Some(4), 0, 16, 8)];
        assert_eq!((bit_of(&named, 3, 13), bit_of(&named, 16, 8)), (Some(3), Some(800)));
        assert_eq!((bit_of(&named, 3, 14), bit_of(&named, 20, 5), bit_of(&named, 3, u32::MAX)), (None, None, None));
        // The file names more bits than the SyncManager has.
        assert_eq!(bit_of(&[image(Some(4), 0, 0, 64)], 0, 64), None);
        // All process data as one sequence, from bit 4 on.
        let one = [image(None, 4, 0, 20)];
        assert_eq!((bit_of(&one, 0, 12), bit_of(&one, 12, 8), bit_of(&one, 14, 2)), (Some(4), Some(800), Some(802)));
        assert_eq!((bit_of(&one, 8, 8), bit_of(&one, 20, 1)), (None, None));
    }
}
