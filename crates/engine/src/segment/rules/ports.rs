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
        self.port_control(junction).map_or_else(DlControl::default, |entry| entry.control)
    }

    /// The known port control of a junction.
    pub fn port_control(&self, junction: StationAddress) -> Option<&PortControl> {
        self.port_controls.iter().find(|entry| entry.station == junction)
    }

    /// The SubDevices with ports that are changed for a moment, and the settings to restore: those that the application
    /// has ordered by now.
    pub fn altered(&self) -> Vec<(StationAddress, DlControl)> {
        let restored = |(station, before): &(StationAddress, DlControl)| {
            let loops = self.port_control(*station).map_or(before.loops, |entry| entry.control.loops);
            (*station, DlControl { temporary: false, loops, ..*before })
        };
        self.altered.iter().map(restored).collect()
    }

    /// The known loop settings of ports, after all procedures have ended.
    pub(in crate::segment) fn lasting_controls(&mut self) -> Vec<PortControl> {
        let controls = core::mem::take(&mut self.port_controls).into_iter();
        controls.map(|entry| PortControl { under_way: 0, ..entry }).collect()
    }

    /// Commands to a SubDevice are stored from now on.
    pub(in crate::segment) fn follow_ports(&mut self, station: StationAddress) {
        self.entry(station);
    }

    /// Ports of these SubDevices are about to be changed for a moment; with their settings before.
    pub(in crate::segment) fn alter_ports(&mut self, before: &[(StationAddress, DlControl)]) {
        self.altered = before.to_vec();
    }

    pub(in crate::segment) fn begin_order(&mut self, station: StationAddress, control: DlControl) {
        let entry = self.entry(station);
        (entry.control, entry.orders, entry.under_way) = (control, entry.orders.wrapping_add(1), entry.under_way + 1);
    }

    pub(in crate::segment) fn end_order(&mut self, station: StationAddress) {
        let entry = self.entry(station);
        entry.under_way = entry.under_way.saturating_sub(1);
    }

    /// A port control was read, after this number of commands.
    pub(in crate::segment) fn note_control(&mut self, station: StationAddress, orders: u32, control: DlControl) {
        let entry = self.entry(station);
        if entry.orders == orders && entry.under_way == 0 {
            entry.control = control;
        }
    }

    fn entry(&mut self, station: StationAddress) -> &mut PortControl {
        let all = &mut self.port_controls;
        let at = all.iter().position(|entry| entry.station == station).unwrap_or(all.len());
        if at == all.len() {
            all.push(PortControl { station, control: DlControl::default(), orders: 0, under_way: 0 });
        }
        &mut all[at]
    }
}
