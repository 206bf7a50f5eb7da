//! A network file in place of the calls that declare SubDevices, domains and process data: where its variables are in
//! the images of the domains, by name.

use std::collections::BTreeMap;
use std::path::Path;

use ringcat::config::{Configuration, Variable};
use ringcat::network::LoadedNetwork;
use ringcat::{ConfigAddress, Declaration, Direction, DomainId, SubDeviceConfig, SubDeviceInfo};

use crate::code::{Code, Outcome, report};
use crate::settings::Name;

/// Names of a loaded network.
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
    /// First byte in the image of the domain.
    pub start: u32,
}

/// Reads a file.
///
/// # Errors
/// It cannot be read, or its content is wrong; a message to the operator says what is wrong, and in which line.
pub fn load(path: &str) -> Outcome<LoadedNetwork> {
    LoadedNetwork::load(Path::new(path)).map_err(|error| {
        report(format_args!("{error}"));
        Code::INVALID
    })
}

/// The declaration of a file. As those of `ecrt.h`, a SubDevice is used at its exact position only, unless others
/// before it may be absent.
pub fn declaration(file: &LoadedNetwork) -> Declaration {
    let mut declaration = file.declaration();
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
    Names {
        subdevices: subdevices.map(|(index, facts)| (facts.name.clone(), index)).collect(),
        domains: domains.map(|(number, name)| (name.clone(), DomainId(number))).collect(),
        variables: variables
            .filter_map(|variable| Some((variable.name.clone(), place(configuration, areas, variable)?)))
            .collect(),
    }
}

fn place(configuration: &Configuration, areas: &[Area], variable: &Variable) -> Option<Place> {
    let mut of_image = configuration.image.areas.iter();
    let within = of_image.find(|area| {
        let bits = area.image_bit..area.image_bit + area.bits;
        area.direction == variable.direction && bits.contains(&variable.image_bit)
    })?;
    let area = areas
        .iter()
        .find(|area| (area.subdevice, Some(area.sync_manager)) == (within.subdevice, within.sync_manager))?;
    Some(Place {
        domain: area.domain,
        bit: area.start * 8 + within.bit_offset + (variable.image_bit - within.image_bit),
        bits: variable.bits,
        is_output: variable.direction == Direction::Outputs,
    })
}
