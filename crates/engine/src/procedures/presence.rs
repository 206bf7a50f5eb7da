//! The FMMU that shows a SubDevice's AL status in the frames of its process data (facts 3.4, 3.10), and how it is found out that
//! the SubDevice gives its inputs.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{LogicalAddress, RegisterAddress, StationAddress};
use ringcat_wire::register::{Fmmu, SyncManagerMode, map};

use super::fleet::{Phase, Setup, SharedFleet};
use super::mail_watch;
use crate::event::Event;
use crate::info::{Direction, SubDeviceInfo};
use crate::layout::{Delivers, Witness};
use crate::plan::{AreaPlan, SubDevicePlan};
use crate::supervisor::Bus;

/// How a SubDevice shows whether its inputs came: through an FMMU that process data and mailbox leave over. One whose inputs
/// come once per buffer only, as from a mailbox, would make every sum uncertain, and is looked at alone.
pub(crate) fn witness(index: usize, plan: &SubDevicePlan, info: &SubDeviceInfo) -> Witness {
    let is_steady = |area: &AreaPlan| area.register.control.mode == SyncManagerMode::Buffered;
    let inputs = plan.mapped_areas().map(|(_, area)| area).filter(|area| area.direction == Direction::Inputs);
    let delivers = if plan.is_op_only() { Delivers::InOp } else { Delivers::FromSafeOp };
    match number(index, plan, info) {
        Some(_) if inputs.into_iter().all(is_steady) => Witness::Mapped(delivers),
        _ => Witness::Alone,
    }
}

/// The first FMMU behind those of process data that is not the mailbox's.
pub(super) fn number(index: usize, plan: &SubDevicePlan, info: &SubDeviceInfo) -> Option<u8> {
    let mail = mail_watch::fmmu(index, plan, info).map(|(number, _)| number);
    let first = u8::try_from(plan.mapped_areas().count()).ok()?;
    (first..info.controller.fmmu_count).find(|number| Some(*number) != mail)
}

/// Its registers.
pub(super) fn fmmu(logical: LogicalAddress) -> Fmmu {
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

/// Pause between two looks whether inputs are there; it doubles up to the longest.
const PAUSE: Duration = Duration::from_millis(1);
/// Longest pause between two looks.
const LONGEST_PAUSE: Duration = Duration::from_millis(50);
/// Inputs that are not there by then are reported.
const LATE: Duration = Duration::from_secs(1);

/// Looks until a SubDevice gives all its inputs, which datagrams of its own show, or is gone.
pub(super) fn prove(bus: &Bus, fleet: &SharedFleet, index: usize, station: StationAddress, setup: Rc<Setup>) {
    let (own_bus, fleet) = (bus.clone(), fleet.clone());
    bus.spawn(async move {
        let bus = own_bus;
        let inputs = setup.plan.mapped_areas().map(|(_, area)| area).filter(|area| area.direction == Direction::Inputs);
        let mut missing: Vec<&AreaPlan> = inputs.collect();
        let (mut pause, late) = (PAUSE, bus.now() + LATE);
        let mut is_reported = false;
        while fleet.board.is_unproven(index) && fleet.phase(index) != Phase::Absent {
            let mut left = Vec::new();
            for area in missing {
                let read = bus.fprd(station, RegisterAddress(area.physical), usize::from(area.length)).await;
                if read.is_err() {
                    left.push(area);
                }
            }
            if left.is_empty() {
                return fleet.board.set_unproven(index, false);
            }
            if bus.now() >= late && !core::mem::replace(&mut is_reported, true) {
                let sync_manager = left[0].sync_manager;
                let what = alloc::format!(
                    "SyncManager {sync_manager} gives no inputs yet, {} ms after its FMMU",
                    LATE.as_millis()
                );
                bus.report(Event::PlanOddity { subdevice: index, what });
            }
            missing = left;
            bus.sleep(pause).await;
            pause = (pause * 2).min(LONGEST_PAUSE);
        }
    });
}
