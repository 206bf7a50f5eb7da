//! What SubDevices were told to do about their ports.
//!
//! Rings of which no frame comes back are looked into by writing the loops of all ports of their junctions at once. A
//! port that was closed on purpose must stay closed then, also where that was less than a look ago, or where the answer
//! to the order did not come back any more. So an order counts from before it leaves on, and nothing that is read while
//! it is under way.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::DlControl;

use super::Segment;

/// A port that was closed to cut a SubDevice off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockedPort {
    /// Station address of the neighbour whose port it is.
    pub station: StationAddress,
    /// Port 0..3.
    pub port: u8,
}

/// What a junction was told.
#[derive(Clone, Copy, Debug)]
pub struct PortControl {
    /// The junction.
    pub station: StationAddress,
    /// What it was told.
    pub control: DlControl,
    /// Orders of the application so far.
    pub orders: u32,
    /// Of these the ones that are under way.
    pub under_way: u32,
}

impl Segment {
    /// The junctions at which local rings begin.
    pub fn junctions(&self) -> Vec<StationAddress> {
        let heads = self.cabling.topology.local_rings.iter().map(|ring| ring.closing.head.node);
        heads.filter_map(|head| self.station_of(head)).collect()
    }

    /// What a junction was told; as after a scan where it is not known.
    pub fn control_of(&self, junction: StationAddress) -> DlControl {
        self.port_control(junction).map_or_else(DlControl::default, |told| told.control)
    }

    /// What is known of a junction's ports.
    pub fn port_control(&self, junction: StationAddress) -> Option<&PortControl> {
        self.port_controls.iter().find(|told| told.station == junction)
    }

    pub(super) fn begin_order(&mut self, station: StationAddress, control: DlControl) {
        let told = self.entry(station);
        (told.control, told.orders, told.under_way) = (control, told.orders.wrapping_add(1), told.under_way + 1);
    }

    pub(super) fn end_order(&mut self, station: StationAddress) {
        let told = self.entry(station);
        told.under_way = told.under_way.saturating_sub(1);
    }

    /// A control was read, when there had been so many orders.
    pub(super) fn note_control(&mut self, station: StationAddress, orders: u32, control: DlControl) {
        let told = self.entry(station);
        if told.orders == orders && told.under_way == 0 {
            told.control = control;
        }
    }

    fn entry(&mut self, station: StationAddress) -> &mut PortControl {
        let all = &mut self.port_controls;
        let at = all.iter().position(|told| told.station == station).unwrap_or(all.len());
        if at == all.len() {
            all.push(PortControl { station, control: DlControl::default(), orders: 0, under_way: 0 });
        }
        &mut all[at]
    }
}
