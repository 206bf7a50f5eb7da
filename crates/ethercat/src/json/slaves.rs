//! What `slaves --json` and `crc --json` print.

use ringcat_control::tool::{PortLine, PortsLine};
use serde::Serialize;

use super::details::{Details, Known};
use super::values::{Link, List, state};
use crate::selection::Slave;

/// SubDevices of a master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Slaves<'a> {
    /// Number of the master
    pub master: u32,
    /// The selected SubDevices, in the order of their positions
    pub subdevices: List<'a, Slave, &'a [Known], SubDevice<'a>>,
}

/// A SubDevice.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SubDevice<'a> {
    /// Position on the bus, from 0
    pub position: u16,
    /// Station alias of the SubDevice; 0: none
    pub alias: u16,
    /// The last alias at or before it, from which `relative_position` counts; 0: it counts from the beginning of the
    /// bus
    pub last_alias: u16,
    /// Position behind the SubDevice with the last alias
    pub relative_position: u16,
    /// `INIT`, `PREOP`, `BOOT`, `SAFEOP` or `OP`; null where it does not answer, or reports none of them
    pub state: Option<&'static str>,
    /// Whether it reports an error or does not answer: the flag `E` of the text
    pub error: bool,
    /// Register 0x0130, AL_STATUS; null where it does not answer
    pub al_status: Option<u16>,
    /// The link on which it answers: `main`, or `redundant` behind a break of the ring
    pub link: Link,
    /// Name of its SII; empty where it has none
    pub name: &'a str,
    /// Order number of its SII; empty where it has none
    pub order_number: &'a str,
    /// Vendor ID
    pub vendor_id: u32,
    /// Product code
    pub product_code: u32,
    /// Revision number
    pub revision: u32,
    /// Serial number
    pub serial: u32,
    /// Further data of it; null without --verbose
    pub details: Option<Details<'a>>,
}

impl<'a> Slaves<'a> {
    /// SubDevices, with what else is known of them or without.
    pub fn new(master: u32, slaves: &'a [Slave], known: &'a [Known]) -> Slaves<'a> {
        Slaves { master, subdevices: List { all: slaves, context: known, make: SubDevice::new } }
    }
}

impl<'a> SubDevice<'a> {
    fn new(place: usize, slave: &'a Slave, known: &'a [Known]) -> SubDevice<'a> {
        let Slave { line, alias, relative } = slave;
        let [vendor_id, product_code, revision, serial] = line.identity;
        SubDevice {
            position: line.position,
            alias: line.alias,
            last_alias: *alias,
            relative_position: *relative,
            state: state(line.status),
            error: slave.has_error(),
            al_status: line.status,
            link: Link::of(line.is_redundant),
            name: &line.name,
            order_number: &line.order,
            vendor_id,
            product_code,
            revision,
            serial,
            details: known.get(place).map(Details::new),
        }
    }
}

/// Error counters of a master's SubDevices.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Crc<'a> {
    /// Number of the master
    pub master: u32,
    /// The SubDevices, in the order of their positions
    pub subdevices: List<'a, Slave, &'a [PortsLine], Counted<'a>>,
}

/// Error counters of a SubDevice.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Counted<'a> {
    /// Position on the bus, from 0
    pub position: u16,
    /// Name of its SII; empty where it has none
    pub name: &'a str,
    /// Its four ports; empty where nothing is known of them
    pub ports: List<'a, PortLine, (), CountedPort>,
}

/// Error counters of a port. They end at 255.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CountedPort {
    /// Number of the port, 0 to 3
    pub port: usize,
    /// Whether it has a link
    pub link: bool,
    /// Invalid frames: registers 0x0300 and following
    pub invalid_frames: u8,
    /// Receive errors: registers 0x0301 and following
    pub receive_errors: u8,
    /// Errors that were found before: registers 0x0308 and following
    pub forwarded_errors: u8,
    /// Lost links: registers 0x0310 and following
    pub lost_links: u8,
    /// Position of the SubDevice behind an open port with a link; null where there is none
    pub neighbour: Option<u16>,
}

impl<'a> Crc<'a> {
    /// SubDevices and their ports.
    pub fn new(master: u32, slaves: &'a [Slave], ports: &'a [PortsLine]) -> Crc<'a> {
        Crc { master, subdevices: List { all: slaves, context: ports, make: counted } }
    }
}

fn counted<'a>(_: usize, slave: &'a Slave, ports: &'a [PortsLine]) -> Counted<'a> {
    let position = slave.line.position;
    let all: &[PortLine] = ports.iter().find(|line| line.position == position).map_or(&[], |line| &line.ports);
    Counted { position, name: &slave.line.name, ports: List { all, context: (), make: counted_port } }
}

fn counted_port(port: usize, line: &PortLine, _: ()) -> CountedPort {
    let [invalid_frames, receive_errors, forwarded_errors, lost_links] = line.errors;
    let (link, neighbour) = (line.link[0], line.neighbour);
    CountedPort { port, link, invalid_frames, receive_errors, forwarded_errors, lost_links, neighbour }
}
