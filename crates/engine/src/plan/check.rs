//! Whether the planned SyncManagers fit into the controller (facts 3.1, 3.11, 5.2).

use alloc::vec::Vec;

use ringcat_wire::register::SyncManager;

use super::areas::{PROCESS_RAM, occupied};
use super::error::PlanProblem;
use super::{AreaPlan, SmPlan};
use crate::config::{IdnWrite, SdoDownload, SdoUpload, StartupAction, SubDeviceConfig};
use crate::info::SubDeviceInfo;

/// Checks mailbox and process data SyncManagers against the controller and against each other.
pub(super) fn check(info: &SubDeviceInfo, mailbox: &[SmPlan], areas: &[AreaPlan]) -> Result<(), PlanProblem> {
    let available = info.controller.sync_manager_count;
    if let Some(sm) = mailbox.iter().find(|sm| sm.index >= available) {
        return Err(PlanProblem::NoSuchSyncManager { sync_manager: sm.index, available });
    }
    let areas = areas.iter().map(|area| (area.sync_manager, &area.register));
    let process_data = areas.clone().filter(|(_, register)| register.length > 0).count();
    if process_data > usize::from(info.controller.fmmu_count) {
        return Err(PlanProblem::TooFewFmmus { expected: process_data, got: info.controller.fmmu_count });
    }
    let mut spans: Vec<Span> = mailbox
        .iter()
        .map(|sm| (sm.index, &sm.register))
        .chain(areas)
        .filter(|(_, register)| register.length > 0)
        .map(|(index, register)| Span::of(index, register))
        .collect();
    for span in &spans {
        inside(info, span)?;
    }
    spans.sort_by_key(|span| span.start);
    match spans.windows(2).find(|pair| pair[0].end > u32::from(pair[1].start)) {
        Some([a, b]) => Err(PlanProblem::Overlap {
            first: a.index,
            first_bytes: (a.start, a.end),
            second: b.index,
            second_bytes: (b.start, b.end),
        }),
        _ => Ok(()),
    }
}

/// Which start-up commands a SubDevice can be given.
#[derive(Clone, Copy)]
pub(super) struct Speaks {
    coe: bool,
    soe: bool,
    eoe: bool,
}

impl Speaks {
    /// As its SII says; a configuration file that declares its mailboxes knows better.
    pub(super) fn new(config: &SubDeviceConfig, info: &SubDeviceInfo, mailbox: bool) -> Speaks {
        let declared = config.declared.is_some();
        let protocols = info.protocols;
        Speaks {
            coe: mailbox && (declared || protocols.coe()),
            soe: mailbox && (declared || protocols.soe()),
            eoe: mailbox && (declared || protocols.eoe()),
        }
    }
}

/// Whether a SubDevice can be given a start-up command.
pub(super) fn command(speaks: Speaks, action: &StartupAction) -> Result<(), PlanProblem> {
    match action {
        StartupAction::Sdo(SdoDownload { index, sub_index, .. })
        | StartupAction::Upload(SdoUpload { index, sub_index, .. })
            if !speaks.coe =>
        {
            Err(PlanProblem::NoCoe { index: *index, sub_index: *sub_index })
        }
        StartupAction::Idn(IdnWrite { drive, idn, .. }) if !speaks.soe => {
            Err(PlanProblem::NoSoe { drive: *drive, idn: *idn })
        }
        StartupAction::Ip(_) if !speaks.eoe => Err(PlanProblem::NoEoe),
        StartupAction::Register(command) if !command.is_sound() => {
            let (data, mask) = command.lengths();
            Err(PlanProblem::RegisterCommand { register: command.address, data, mask })
        }
        StartupAction::Sdo(_)
        | StartupAction::Upload(_)
        | StartupAction::Idn(_)
        | StartupAction::Ip(_)
        | StartupAction::Register(_) => Ok(()),
    }
}

/// Bytes of a SyncManager, all buffers included.
struct Span {
    index: u8,
    start: u16,
    end: u32,
}

impl Span {
    fn of(index: u8, register: &SyncManager) -> Span {
        Span { index, start: register.start, end: u32::from(register.start) + occupied(register) }
    }
}

fn inside(info: &SubDeviceInfo, span: &Span) -> Result<(), PlanProblem> {
    let process_ram = u32::from(PROCESS_RAM);
    let memory_end = match (span.start < PROCESS_RAM, info.controller.ram_kib) {
        (true, _) => process_ram,
        // A controller that does not say how much it has.
        (false, 0) => 0x1_0000,
        (false, kib) => process_ram + 1024 * u32::from(kib),
    };
    if span.end <= memory_end {
        return Ok(());
    }
    Err(PlanProblem::OutsideMemory {
        sync_manager: span.index,
        start: span.start,
        bytes: span.end - u32::from(span.start),
        memory_end,
    })
}
