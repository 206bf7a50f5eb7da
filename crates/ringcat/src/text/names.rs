//! Names of SubDevices, ports and cables in lines of text.

use std::fmt;

use ringcat_engine::PortOf;
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{Address, SubDeviceId};
use ringcat_engine::ring_status::{Cable, Occupant};
use ringcat_wire::address::Position;
use ringcat_wire::frame::MacAddress;

/// Names of declared SubDevices, by their index in the declaration. A position has no name of its own: an event that
/// gives a position also gives the SubDevice that is there.
#[derive(Clone, Debug, Default)]
pub struct Names(pub Vec<String>);

impl Names {
    /// A declared SubDevice.
    pub(super) fn of(&self, subdevice: SubDeviceId) -> impl fmt::Display + use<> {
        format!("SubDevice {subdevice}{}", self.called(Some(subdevice)))
    }

    /// A SubDevice by index or position.
    pub(super) fn at_address(&self, address: Address) -> String {
        match address {
            Address::Declared(subdevice) => self.of(subdevice).to_string(),
            Address::Scanned(_) => address.to_string(),
        }
    }

    /// A position with name and station address of the SubDevice there, as far as they are known.
    pub(super) fn at(&self, position: Position, occupant: Option<Occupant>) -> impl fmt::Display + use<> {
        let declared = occupant.and_then(|occupant| occupant.declared);
        format!("position {position}{}{}", self.called(declared), station(occupant))
    }

    /// The name of a declared SubDevice behind a blank, if it has one.
    fn called(&self, declared: Option<SubDeviceId>) -> String {
        let name = declared.and_then(|SubDeviceId(index)| self.0.get(index));
        name.map_or_else(String::new, |name| format!(" \"{name}\""))
    }

    /// A port of the SubDevice at a position, with its name in the declaration.
    pub(super) fn port(&self, at: PortOf, declared: Option<SubDeviceId>) -> String {
        format!("SubDevice {}{} port {}", at.position(), self.called(declared), at.port())
    }

    /// A cable by its two ends. Its last SubDevice is also given by station address.
    pub fn cable(&self, cable: Cable, ends: [Option<Occupant>; 2]) -> String {
        let port = |at: PortOf, occupant: Option<Occupant>| self.port(at, occupant.and_then(|it| it.declared));
        let [near, far] = ends;
        let is_last = cable.far.is_none();
        let before = cable.near.map_or_else(
            || format!("the {} interface", Link::Main),
            |at| format!("{}{}", port(at, near), station(near.filter(|_| is_last))),
        );
        let behind = cable.far.map_or_else(
            || format!("the {} interface", Link::Redundant),
            |at| format!("{}{}", port(at, far), station(far)),
        );
        format!("between {before} and {behind}")
    }
}

/// The station address behind a blank, in brackets.
fn station(occupant: Option<Occupant>) -> String {
    occupant.map_or_else(String::new, |occupant| format!(" ({})", occupant.station))
}

/// A MAC address in the usual notation: `02:00:00:00:00:01`.
pub fn address(mac: MacAddress) -> String {
    let bytes = mac.0.map(|byte| format!("{byte:02x}"));
    bytes.join(":")
}
