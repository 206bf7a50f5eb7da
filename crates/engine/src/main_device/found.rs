//! Access to single SubDevices of the scan and of the declaration, without a copy of all.

use super::MainDevice;
use super::states::SubDeviceState;
use crate::declared::SubDeviceId;

impl MainDevice {
    /// Number of SubDevices of the last scan; `None` before a successful scan.
    pub fn scanned_count(&self) -> Option<usize> {
        self.segment.view().found().map(|found| found.subdevices.len())
    }

    /// The declared SubDevices that are not in their target states, without absent optional ones.
    pub fn unsettled(&self) -> alloc::vec::Vec<(SubDeviceId, SubDeviceState)> {
        let access = self.segment.view();
        let members = access.members().enumerate();
        let states = members.map(|(index, member)| (index, member.phase.into(), member.config.optional));
        let unsettled = states.filter(|(_, state, optional)| match state {
            SubDeviceState::Settled(_) => false,
            SubDeviceState::Absent => !optional,
            SubDeviceState::Configuring => true,
        });
        unsettled.map(|(index, state, _)| (SubDeviceId(index), state)).collect()
    }
}
