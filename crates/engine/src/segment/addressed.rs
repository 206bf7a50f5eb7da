//! The SubDevice that an address names. Addresses are resolved only here.

use ringcat_wire::address::StationAddress;

use super::key::SubDeviceKey;
use super::model::Segment;
use crate::declared::{Address, SubDeviceId};

/// A SubDevice of the list, found by its address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Addressed {
    /// A declared one, by its index in the declaration.
    Member(usize),
    /// One without a declaration.
    Undeclared(SubDeviceKey),
}

impl Segment {
    /// The SubDevice with an address. While an application is active, positions name SubDevices with idle operation
    /// only: first those without a declaration, then declared ones, at their positions of the last scan or rescan.
    pub fn find(&self, address: impl Into<Address>) -> Option<Addressed> {
        match address.into() {
            Address::Declared(SubDeviceId(index)) => {
                (index < self.subdevices.member_count()).then_some(Addressed::Member(index))
            }
            Address::Scanned(_) if self.is_active() && !self.choices.idle_operation => None,
            Address::Scanned(position) => {
                let undeclared = self.subdevices.unassigned().find(|it| it.position == position && it.is_undeclared());
                if let Some(it) = undeclared {
                    return Some(Addressed::Undeclared(it.key));
                }
                let station = *self.cabling.stations.get(usize::from(position.0))?;
                self.subdevices.member_of(station).map(Addressed::Member)
            }
        }
    }

    /// The station address of a SubDevice; `None` if it has left.
    pub fn station(&self, subdevice: Addressed) -> Option<StationAddress> {
        match subdevice {
            Addressed::Member(index) => self.member(index).map(|member| member.station),
            Addressed::Undeclared(key) => self.unassigned(key).map(|it| it.key.station),
        }
    }
    /// Whether a SubDevice of the list, declared or not, has this station address.
    pub fn has_station(&self, station: StationAddress) -> bool {
        self.subdevices.member_of(station).is_some() || self.subdevices.unassigned().any(|it| it.key.station == station)
    }
}
