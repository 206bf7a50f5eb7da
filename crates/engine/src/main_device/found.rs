//! Access to single SubDevices of the scan and of the declaration, without a copy of all.

use ringcat_wire::address::Position;
use ringcat_wire::frame::MacAddress;

use super::MainDevice;
use super::states::SubDeviceState;
use crate::config::SubDeviceConfig;
use crate::declared::SubDeviceId;
use crate::info::SubDeviceInfo;
#[cfg(feature = "standby")]
use crate::role::MainDeviceRole;
use crate::segment::member::Phase;

/// A declared SubDevice of the active declaration.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DeclaredSubDevice {
    /// Its declaration.
    pub config: SubDeviceConfig,
    /// What is known of it; `None` if it has never answered.
    pub info: Option<SubDeviceInfo>,
    /// Its position in the last scan.
    pub position: Option<Position>,
    /// It does not answer.
    pub is_absent: bool,
}

impl MainDevice {
    /// Addresses of the interfaces: main, redundant.
    pub fn interfaces(&self) -> [Option<MacAddress>; 2] {
        [Some(self.options.main), self.options.redundant]
    }

    /// Number of SubDevices of the active declaration; 0 without one.
    pub fn declared_count(&self) -> usize {
        self.active().map_or(0, |_| self.segment.view().members().count())
    }

    /// A SubDevice of the active declaration.
    pub fn declared(&self, subdevice: SubDeviceId) -> Option<DeclaredSubDevice> {
        self.active()?;
        let view = self.segment.view();
        let member = view.member(subdevice.0)?;
        let found = || view.found()?.subdevices.iter().find(|info| info.station == member.station);
        Some(DeclaredSubDevice {
            config: (*member.config).clone(),
            info: member.info.map(|info| (**info).clone()),
            position: member.info.and_then(|_| found()).map(|info| info.position),
            is_absent: self.known_state(member.phase) == SubDeviceState::Absent,
        })
    }

    /// Number of SubDevices of the last scan; `None` before a successful scan.
    pub fn scanned_count(&self) -> Option<usize> {
        self.segment.view().found().map(|found| found.subdevices.len())
    }

    /// Whether states of SubDevices are known: an INACTIVE has them only while an ACTIVE reports them.
    pub(super) fn are_states_known(&self) -> bool {
        #[cfg(feature = "standby")]
        let is_known = self.role() == MainDeviceRole::Active || !self.segment.board.is_silent();
        #[cfg(not(feature = "standby"))]
        let is_known = true;
        is_known
    }

    /// The state of a SubDevice that has this phase in the model.
    pub(super) fn known_state(&self, phase: Phase) -> SubDeviceState {
        if self.are_states_known() { phase.into() } else { SubDeviceState::Unknown }
    }

    /// The declared SubDevices that are not in their target states, without absent optional ones.
    pub fn unsettled(&self) -> alloc::vec::Vec<(SubDeviceId, SubDeviceState)> {
        let access = self.segment.view();
        let members = access.members().enumerate();
        let states = members.map(|(index, member)| (index, self.known_state(member.phase), member.config.optional));
        let unsettled = states.filter(|(_, state, optional)| match state {
            SubDeviceState::Settled(_) => false,
            SubDeviceState::Absent => !optional,
            SubDeviceState::Configuring | SubDeviceState::Unknown => true,
        });
        unsettled.map(|(index, state, _)| (SubDeviceId(index), state)).collect()
    }
}
