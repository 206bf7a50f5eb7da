//! What `domains --json` and `data --json` print.

use ringcat_control::tool::DomainLine;
use serde::Serialize;

use super::values::Direction;
use crate::hex;

/// Domains of a master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Domains {
    /// Number of the master
    pub master: u32,
    /// The selected domains of the active application; none without one
    pub domains: Vec<Domain>,
}

/// A domain.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Domain {
    /// Number of the domain, from 0
    pub domain: u32,
    /// Logical address of its first byte
    pub logical_address: u32,
    /// Its length, in bytes
    pub length_bytes: u32,
    /// Working counter
    pub working_counter: u32,
    /// Working counter of a complete exchange
    pub expected_working_counter: u32,
    /// Working counter of the main link; null with one link
    pub main_working_counter: Option<u32>,
    /// Working counter of the redundant link; null with one link
    pub redundant_working_counter: Option<u32>,
    /// Process data of SubDevices in it
    pub areas: Vec<Area>,
}

/// Process data of a SyncManager.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Area {
    /// Alias of the declared SubDevice; 0: its position counts from the begin of the bus
    pub alias: u16,
    /// Its position, or its position behind the alias
    pub position: u16,
    /// Number of the SyncManager
    pub sync_manager: u8,
    /// `outputs` if the MainDevice writes it, `inputs` if it reads it
    pub direction: Direction,
    /// Logical address of the first byte
    pub logical_address: u32,
    /// Place of the first byte in the domain
    pub offset_bytes: u32,
    /// Its length, in bytes
    pub length_bytes: u16,
    /// Its bytes, in hexadecimal digits
    pub data: String,
}

impl Domain {
    /// A domain and its image.
    pub fn new(domain: u32, line: &DomainLine, image: &[u8]) -> Domain {
        let areas = line.areas.iter().map(|area| Area {
            alias: area.subdevice.0,
            position: area.subdevice.1,
            sync_manager: area.sync_manager,
            direction: Direction::of(area.is_output),
            logical_address: area.logical,
            offset_bytes: area.offset,
            length_bytes: area.length,
            data: hex::digits(area_bytes(area.offset, area.length, image)),
        });
        Domain {
            domain,
            logical_address: line.logical,
            length_bytes: line.bytes,
            working_counter: line.wkc,
            expected_working_counter: line.expected,
            main_working_counter: line.by_link.map(|[main, _]| main),
            redundant_working_counter: line.by_link.map(|[_, redundant]| redundant),
            areas: areas.collect(),
        }
    }
}

/// The bytes of an area in the image of its domain; none where they are not all there.
pub fn area_bytes(offset: u32, length: u16, image: &[u8]) -> &[u8] {
    let begin = offset as usize;
    image.get(begin..begin.saturating_add(length.into())).unwrap_or_default()
}

/// Process data of a master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Data {
    /// Number of the master
    pub master: u32,
    /// The selected domains of the active application; none without one
    pub domains: Vec<Image>,
}

/// Process data of a domain.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Image {
    /// Number of the domain, from 0
    pub domain: u32,
    /// Its length, in bytes
    pub length_bytes: usize,
    /// Its bytes, in hexadecimal digits
    pub data: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_control::tool::AreaLine;

    // covers: daemon, json
    #[test]
    fn a_domain_has_counters_by_link_and_the_bytes_of_its_areas() {
        let area = AreaLine { offset: 1, length: 2, ..AreaLine::default() };
        let beyond = AreaLine { offset: u32::MAX, length: 2, ..AreaLine::default() };
        let line = DomainLine { by_link: Some([2, 1]), areas: vec![area, beyond], ..DomainLine::default() };
        let domain = Domain::new(0, &line, &[1, 0xAB, 3]);
        assert_eq!((domain.main_working_counter, domain.redundant_working_counter), (Some(2), Some(1)));
        let data: Vec<&str> = domain.areas.iter().map(|area| area.data.as_str()).collect();
        assert_eq!(data, ["ab03", ""]);
    }
}
