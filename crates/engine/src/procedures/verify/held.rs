//! Registers that a SubDevice must hold in a state.

use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::{SyncManager, map};

use crate::config::{RegisterAccess, StartupAction, SubDeviceConfig};
use crate::segment::setup::Setup;

/// Compared bits of a SyncManager's control byte: buffer type and direction. The others depend on the controller.
const CONTROL_MASK: u8 = 0x0F;
/// Compared bit of its activate byte: whether it is enabled. The mailbox toggles another bit.
const ACTIVATE_MASK: u8 = 0x01;

/// Consecutive registers.
pub(super) struct Held {
    pub register: RegisterAddress,
    pub bytes: Vec<u8>,
    /// Compared bits.
    mask: Vec<u8>,
    what: &'static str,
}

impl Held {
    fn new(register: RegisterAddress, bytes: Vec<u8>, what: &'static str) -> Held {
        let mask = vec![0xFF; bytes.len()];
        Held { register, bytes, mask, what }
    }

    /// Whether the read registers hold it.
    pub fn is_in(&self, got: &[u8]) -> bool {
        got.len() == self.bytes.len() && self.wrong(got).next().is_none()
    }

    /// Offsets of bytes that differ.
    fn wrong<'a>(&'a self, got: &'a [u8]) -> impl Iterator<Item = usize> + 'a {
        let all = self.bytes.iter().zip(got).zip(&self.mask).enumerate();
        all.filter(|(_, ((expected, got), mask))| (*expected ^ *got) & *mask != 0).map(|(at, _)| at)
    }

    /// Its name and first address.
    pub fn name(&self) -> String {
        format!("{} from register {} on", self.what, self.register)
    }

    /// Describes the first byte that differs.
    pub fn differences(&self, got: &[u8]) -> String {
        let Some(at) = self.wrong(got).next() else { return String::new() };
        let (expected, got) = (self.bytes[at], got[at]);
        format!("expected {expected:#04x} at {}, got {got:#04x}", self.register.offset(at as u16))
    }

    /// Excludes registers that a start-up command writes.
    fn leave_out(&mut self, first: RegisterAddress, length: usize) {
        for (at, mask) in self.mask.iter_mut().enumerate() {
            let address = usize::from(self.register.0) + at;
            if (usize::from(first.0)..usize::from(first.0) + length).contains(&address) {
                *mask = 0;
            }
        }
    }
}

/// Registers that a SubDevice holds in a state: mailbox SyncManagers from PREOP on, the others and FMMUs from SAFEOP
/// on. A SubDevice that exchanges process data in OP only holds those in OP only.
pub(super) fn registers(setup: &Setup, config: &SubDeviceConfig, state: AlState) -> Vec<Held> {
    let (from_preop, from_safeop, in_op) = match state {
        AlState::Init | AlState::Boot => (false, false, false),
        AlState::PreOp => (true, false, false),
        AlState::SafeOp => (true, true, false),
        AlState::Op => (true, true, true),
    };
    let mut registers = Vec::new();
    let mut sync_managers = Vec::new();
    if from_preop {
        sync_managers.extend(setup.plan.mailbox.iter().map(|it| (it.index, it.register)));
    }
    if from_safeop {
        sync_managers.extend(setup.plan.process_data.iter().map(|area| {
            let mut register = area.register;
            register.activate.enable &= in_op || !area.op_only;
            (area.sync_manager, register)
        }));
        let watchdog = setup.plan.watchdog.iter();
        registers.extend(watchdog.map(|(register, data)| Held::new(*register, data.clone(), "watchdog times")));
    }
    registers.extend(held_by_sync_managers(&sync_managers));
    let fmmus = setup.fmmu_registers();
    if from_safeop && (in_op || !setup.plan.is_op_only()) && !fmmus.is_empty() {
        registers.push(Held::new(map::FMMU_BASE, fmmus, "FMMUs"));
    }
    for command in &config.startup {
        let StartupAction::Register(command) = &command.action else { continue };
        if let RegisterAccess::Write(data) = &command.access {
            registers.iter_mut().for_each(|held| held.leave_out(command.address, data.len()));
        }
    }
    registers
}

/// All SyncManagers in one range; registers in between are excluded.
fn held_by_sync_managers(sync_managers: &[(u8, SyncManager)]) -> Option<Held> {
    let last = sync_managers.iter().map(|(number, _)| usize::from(*number)).max()?;
    let mut held = Held::new(map::SYNC_MANAGER_BASE, vec![0; SyncManager::LEN * (last + 1)], "SyncManagers");
    held.mask.fill(0);
    for (number, register) in sync_managers {
        let at = SyncManager::LEN * usize::from(*number);
        held.bytes[at..at + SyncManager::LEN].copy_from_slice(&register.encode());
        held.mask[at..at + SyncManager::LEN].copy_from_slice(&[
            0xFF,
            0xFF,
            0xFF,
            0xFF,
            CONTROL_MASK,
            0,
            ACTIVATE_MASK,
            0,
        ]);
    }
    Some(held)
}
