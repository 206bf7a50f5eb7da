//! What `domains --json` and `data --json` print.

use ringcat_control::tool::{AreaLine, DomainLine};
use serde::Serialize;

use super::values::{Direction, Hex, List};

/// A selected domain: its number, what is known of it, its image.
pub type Selected = (u32, DomainLine, Vec<u8>);

/// Domains of a master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Domains<'a> {
    /// Number of the master
    pub master: u32,
    /// The selected domains of the active application; none without one
    pub domains: List<'a, Selected, (), Domain<'a>>,
}

/// A domain.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Domain<'a> {
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
    pub areas: List<'a, AreaLine, &'a [u8], Area<'a>>,
}

/// Process data of a SyncManager.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Area<'a> {
    /// Alias of the declared SubDevice; 0: its position counts from the beginning of the bus
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
    pub data: Hex<'a>,
}

impl<'a> Domains<'a> {
    /// The selected domains of a master.
    pub fn new(master: u32, all: &'a [Selected]) -> Domains<'a> {
        Domains { master, domains: List { all, context: (), make: domain } }
    }
}

fn domain<'a>(_: usize, (domain, line, image): &'a Selected, _: ()) -> Domain<'a> {
    Domain {
        domain: *domain,
        logical_address: line.logical,
        length_bytes: line.bytes,
        working_counter: line.wkc,
        expected_working_counter: line.expected,
        main_working_counter: line.by_link.map(|[main, _]| main),
        redundant_working_counter: line.by_link.map(|[_, redundant]| redundant),
        areas: List { all: &line.areas, context: image, make: area },
    }
}

fn area<'a>(_: usize, area: &'a AreaLine, image: &'a [u8]) -> Area<'a> {
    Area {
        alias: area.subdevice.0,
        position: area.subdevice.1,
        sync_manager: area.sync_manager,
        direction: Direction::of(area.is_output),
        logical_address: area.logical,
        offset_bytes: area.offset,
        length_bytes: area.length,
        data: Hex(area_bytes(area.offset, area.length, image)),
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
pub struct Data<'a> {
    /// Number of the master
    pub master: u32,
    /// The selected domains of the active application; none without one
    pub domains: List<'a, Selected, (), Image<'a>>,
}

/// Process data of a domain.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Image<'a> {
    /// Number of the domain, from 0
    pub domain: u32,
    /// Its length, in bytes
    pub length_bytes: usize,
    /// Its bytes, in hexadecimal digits
    pub data: Hex<'a>,
}

impl<'a> Data<'a> {
    /// The selected domains of a master.
    pub fn new(master: u32, all: &'a [Selected]) -> Data<'a> {
        Data { master, domains: List { all, context: (), make: data } }
    }
}

fn data<'a>(_: usize, (domain, _, image): &'a Selected, _: ()) -> Image<'a> {
    Image { domain: *domain, length_bytes: image.len(), data: Hex(image) }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon, json
    #[test]
    fn a_domain_has_counters_by_link_and_the_bytes_of_its_areas() {
        let first = AreaLine { offset: 1, length: 2, ..AreaLine::default() };
        let beyond = AreaLine { offset: u32::MAX, length: 2, ..AreaLine::default() };
        let line = DomainLine { by_link: Some([2, 1]), areas: vec![first, beyond], ..DomainLine::default() };
        let selected = (0, line, vec![1, 0xAB, 3]);
        let domain = domain(0, &selected, ());
        let areas = domain.areas;
        assert_eq!((domain.main_working_counter, domain.redundant_working_counter), (Some(2), Some(1)));
        let data: Vec<&[u8]> = areas.all.iter().map(|it| area(0, it, areas.context).data.0).collect();
        assert_eq!(data, [&[0xAB, 3][..], &[]]);
    }
}
