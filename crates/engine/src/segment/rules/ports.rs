//! Port commands to junctions.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::DlControl;

use crate::segment::model::Segment;
use crate::segment::port_control::PortControl;

impl Segment {
    /// The junctions at which local rings begin.
    pub fn junctions(&self) -> Vec<StationAddress> {
        let heads = self.cabling.topology.local_rings.iter().map(|ring| ring.closing.head.node);
        heads.filter_map(|head| self.station_of(head)).collect()
    }

    /// The port control of a junction; that of a scan if it is unknown.
    pub fn control_of(&self, junction: StationAddress) -> DlControl {
        self.port_control(junction).map_or_else(DlControl::default, |told| told.control)
    }

    /// The known port control of a junction.
    pub fn port_control(&self, junction: StationAddress) -> Option<&PortControl> {
        self.port_controls.iter().find(|told| told.station == junction)
    }

    pub(in crate::segment) fn begin_order(&mut self, station: StationAddress, control: DlControl) {
        let told = self.entry(station);
        (told.control, told.orders, told.under_way) = (control, told.orders.wrapping_add(1), told.under_way + 1);
    }

    pub(in crate::segment) fn end_order(&mut self, station: StationAddress) {
        let told = self.entry(station);
        told.under_way = told.under_way.saturating_sub(1);
    }

    /// A port control was read, after this number of commands.
    pub(in crate::segment) fn note_control(&mut self, station: StationAddress, orders: u32, control: DlControl) {
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
