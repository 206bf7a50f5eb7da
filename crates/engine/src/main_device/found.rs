//! Access to single SubDevices of the scan and of the declaration, without a copy of all.

use ringcat_wire::address::StationAddress;

use super::MainDevice;
use super::states::SubDeviceState;
use crate::info::SubDeviceInfo;

impl MainDevice {
    /// Number of SubDevices of the last scan; `None` before a successful scan.
    pub fn scanned_count(&self) -> Option<usize> {
        self.segment.view().found().map(|found| found.subdevices.len())
    }

    /// Data of the SubDevice with this station address in the last scan.
    pub fn info_at(&self, station: StationAddress) -> Option<SubDeviceInfo> {
        let view = self.segment.view();
        view.found()?.subdevices.iter().find(|info| info.station == station).map(|info| (**info).clone())
    }

    /// The declared SubDevices that are not in their target states, by their indices in the declaration, without absent
    /// optional ones.
    pub fn unsettled(&self) -> alloc::vec::Vec<(usize, SubDeviceState)> {
        let access = self.segment.view();
        let members = access.members().enumerate();
        let states = members.map(|(index, member)| (index, member.phase.into(), member.config.optional));
        let unsettled = states.filter(|(_, state, optional)| match state {
            SubDeviceState::Settled(_) => false,
            SubDeviceState::Absent => !optional,
            SubDeviceState::Configuring => true,
        });
        unsettled.map(|(index, state, _)| (index, state)).collect()
    }
}
