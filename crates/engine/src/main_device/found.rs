//! Single SubDevices of the scan and of the declaration, without a copy of all of them.

use ringcat_wire::address::StationAddress;

use super::MainDevice;
use super::states::SubDeviceState;
use crate::info::SubDeviceInfo;

impl MainDevice {
    /// How many SubDevices the last scan found; `None` before one has ended well.
    pub fn scanned_count(&self) -> Option<usize> {
        match &*self.scan.borrow() {
            Some(Ok(scan)) => Some(scan.subdevices.len()),
            Some(Err(_)) | None => None,
        }
    }

    /// What the last scan found at this station address.
    pub fn info_at(&self, station: StationAddress) -> Option<SubDeviceInfo> {
        match &*self.scan.borrow() {
            Some(Ok(scan)) => scan.subdevices.iter().find(|info| info.station == station).cloned(),
            Some(Err(_)) | None => None,
        }
    }

    /// The declared SubDevices that are not in their target states, by their indices in the declaration. Optional ones
    /// that do not answer are left out.
    pub fn unsettled(&self) -> alloc::vec::Vec<(usize, SubDeviceState)> {
        let Some(segment) = &self.segment else { return alloc::vec::Vec::new() };
        let access = segment.view();
        let members = access.members.iter().enumerate();
        let states = members.map(|(index, member)| (index, member.phase.into(), member.config.optional));
        let unsettled = states.filter(|(_, state, optional)| match state {
            SubDeviceState::Settled(_) => false,
            SubDeviceState::Absent => !optional,
            SubDeviceState::Configuring => true,
        });
        unsettled.map(|(index, state, _)| (index, state)).collect()
    }
}
