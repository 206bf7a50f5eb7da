//! A network file or an ENI in place of the calls that declare SubDevices, domains and process data: where its
//! variables are in the images of the domains, by name.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::Path;

use ringcat::config::{Configuration, Variable};
use ringcat::eni::EniFile;
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
                EniFile::from_bytes(bytes).map_err(|error| refused(format_args!("ENI in memory: {error}")))?
            }
        };
        let domains = (0..configuration.declaration.domains.len()).map(|number| number.to_string()).collect();
        Ok(Network { configuration, domains, is_ring: false })
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
