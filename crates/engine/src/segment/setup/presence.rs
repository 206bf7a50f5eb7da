//! The FMMU that shows a SubDevice's AL status in the frames of its process data (protocol 3.4, 3.10).

use ringcat_wire::address::LogicalAddress;
use ringcat_wire::register::{Fmmu, SyncManagerMode, map};

use super::mail_status;
use crate::info::{Direction, SubDeviceInfo};
use crate::layout::{Delivers, Witness};
use crate::plan::{AreaPlan, SubDevicePlan};

/// How a SubDevice shows whether its inputs were processed: through an FMMU that process data and mailbox leave free.
/// If its inputs can be read only once per buffer, as from a mailbox, they would make every sum of a working counter
/// uncertain; it gets a separate datagram. `mapped`: number of FMMUs for process data.
pub fn witness(index: usize, plan: &SubDevicePlan, info: &SubDeviceInfo, mapped: usize) -> Witness {
    let is_steady = |area: &AreaPlan| area.register.control.mode == SyncManagerMode::Buffered;
    let inputs = plan.mapped_areas().map(|(_, area)| area).filter(|area| area.direction == Direction::Inputs);
    let delivers = if plan.is_op_only() { Delivers::InOp } else { Delivers::FromSafeOp };
    match number(index, plan, info, mapped) {
        Some(_) if inputs.into_iter().all(is_steady) => Witness::Mapped(delivers),
        _ => Witness::Alone,
    }
}

/// The first FMMU behind those of process data, of which there are `mapped`, that is not the mailbox's.
pub fn number(index: usize, plan: &SubDevicePlan, info: &SubDeviceInfo, mapped: usize) -> Option<u8> {
    let mail = mail_status::fmmu(index, plan, info, mapped).map(|(number, _)| number);
    let first = u8::try_from(mapped).ok()?;
    (first..info.controller.fmmu_count).find(|number| Some(*number) != mail)
}

/// Its registers.
pub fn fmmu(logical: LogicalAddress) -> Fmmu {
    Fmmu {
        logical_start: logical,
        length: 1,
        logical_start_bit: 0,
        logical_stop_bit: 7,
        physical_start: map::AL_STATUS.0,
        physical_start_bit: 0,
        read: true,
        active: true,
        ..Fmmu::default()
    }
}
