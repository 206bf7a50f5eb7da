//! What a device must not receive twice within a cycle, from its own description and registers and its declaration.
//!
//! Decided here independently of the engine: a SubDevice with CoE that was not reported to run free takes each write of
//! outputs for an event (SM-synchronous); a SyncManager with one buffer is empty after a read and full after a write.

use ringcat::{Direction, SubDeviceConfig};
use ringcat_engine::config::{Repetition, StartupAction};
use ringcat_sim::device::Device;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::map;

use crate::areas::Area;

/// Synchronisation type of outputs: free run is 0 (ETG.1020).
const SYNC_TYPE: (u16, u8) = (0x1C32, 1);
/// Control register within the registers of a SyncManager, its bits of the buffer mode, and their value for three
/// buffers.
const CONTROL: u16 = 4;
const MODE: u8 = 0b11;
const THREE_BUFFERS: u8 = 0;

/// What the declaration says about the outputs of a SubDevice.
#[derive(Clone, Copy, Debug)]
pub struct Declared {
    repetition: Repetition,
    /// Each write of outputs is an event if the device has CoE.
    is_synchronous: bool,
}

impl Declared {
    /// Of a declaration.
    pub fn of(config: &SubDeviceConfig) -> Declared {
        let written = config.startup.iter().rev().find_map(|command| match &command.action {
            StartupAction::Sdo(sdo) if (sdo.index, sdo.sub_index) == SYNC_TYPE => sdo.data.first().copied(),
            _ => None,
        });
        Declared { repetition: config.repetition, is_synchronous: config.sync.is_none() && written != Some(0) }
    }
}

/// Whether no second try of a cycle may transfer this area.
pub fn only_once(declared: Option<&Declared>, device: &Device, area: &Area) -> bool {
    let register = map::sync_manager(area.sync_manager).0 + CONTROL;
    let control = device.controller.register(RegisterAddress(register), 1)[0];
    let has_coe = device.description.mailbox.as_ref().is_some_and(|mailbox| mailbox.has_coe());
    control & MODE != THREE_BUFFERS
        || declared.is_some_and(|declared| match (declared.repetition, area.direction) {
            (Repetition::Nothing, _) | (Repetition::Inputs, Direction::Outputs) => true,
            (Repetition::Automatic, Direction::Outputs) => has_coe && declared.is_synchronous,
            _ => false,
        })
}
