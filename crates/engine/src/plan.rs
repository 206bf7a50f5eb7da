//! From declaration and scan result to the register values that bring a SubDevice to OP (protocol 3.10, 3.11, 5.2).
//!
//! Input: a [`SubDeviceConfig`] and its [`SubDeviceInfo`]. Output: a [`SubDevicePlan`]: mailbox and process data
//! SyncManagers, the layout of each process data area, watchdog registers, SDO downloads for PDO assignment and
//! mapping. SyncManagers that a configuration file declares override the SII. Logical addresses are assigned later,
//! with the layout of the domains: [`fmmu`]. The procedures write these values, in the required order and states.

mod areas;
mod check;
mod declared;
mod error;
mod pdos;
mod sdos;
mod subdevice;

use alloc::vec::Vec;

use ringcat_wire::address::{LogicalAddress, RegisterAddress};
use ringcat_wire::register::{Fmmu, map};
use ringcat_wire::sii::{MailboxLayout, SyncManagerKind};

use crate::config::{DeclaredSyncManager, SubDeviceConfig};
use crate::info::{Direction, MailboxSyncManagers, SubDeviceInfo};

pub use error::{PlanError, PlanFault, PlanProblem, PlanWarning};
pub(crate) use sdos::HeldPdos;
pub use sdos::PdoPlan;
pub use subdevice::{AreaPlan, MappedEntry, MappedPdo, SmPlan, SubDevicePlan};

use areas::sync_manager;

/// Control byte of the mailbox that the MainDevice writes, if the SII contains none (protocol 3.11).
const MAILBOX_OUT_CONTROL: u8 = 0x26;
/// Control byte of the mailbox that the MainDevice reads, if the SII contains none (protocol 3.11).
const MAILBOX_IN_CONTROL: u8 = 0x22;

/// Plans one SubDevice. The error names SubDevice, SyncManager, PDO or object, the expected and the found value, and
/// whether declaration or SII must be corrected.
pub fn plan(config: &SubDeviceConfig, info: &SubDeviceInfo) -> Result<SubDevicePlan, PlanError> {
    plan_inner(config, info).map_err(|problem| {
        let fault = fault(config, info);
        PlanError { position: info.position, station: info.station, problem, fault }
    })
}

/// The SII is at fault if it is damaged, or if a plan without declarations fails too; not if a file declares the
/// SyncManagers.
fn fault(config: &SubDeviceConfig, info: &SubDeviceInfo) -> PlanFault {
    let is_unfit = || plan_inner(&SubDeviceConfig::from_info(info), info).is_err();
    if config.declared.is_none() && (info.is_doubtful() || is_unfit()) {
        return PlanFault::Sii;
    }
    PlanFault::Declaration
}

fn plan_inner(config: &SubDeviceConfig, info: &SubDeviceInfo) -> Result<SubDevicePlan, PlanProblem> {
    if info.is_blank() && config.declared.is_none() && config.pdos.is_none() {
        return Err(PlanProblem::NoSii);
    }
    let of_sii = || info.bootstrap.map_or(Vec::new(), |layout| mailbox_pair(info, &layout, info.boot_sync_managers()));
    let bootstrap = config.declared_bootstrap.as_ref().map_or_else(of_sii, |pair| declared::managers(pair).collect());
    let mut warnings = Vec::new();
    let (mailbox, process_data, pdos) = match &config.declared {
        Some(declared) => {
            let (mut mailbox, process_data) = declared::areas(declared, info)?;
            if mailbox.is_empty() {
                mailbox = mailbox_beside(info, declared, &process_data).unwrap_or_default();
                warnings.extend((!mailbox.is_empty()).then_some(PlanWarning::MailboxOfSii));
            } else {
                warnings.extend(other_mailboxes(info, &mailbox));
            }
            warnings.extend(process_data.iter().filter_map(|area| other_address(info, area)));
            (mailbox, process_data, Vec::new())
        }
        None => {
            let mailbox = mailbox_of_sii(info).unwrap_or_default();
            let process_data = areas::areas(config, info, &mailbox)?;
            let pdos = pdos::pdo_plans(config, info, &process_data, &mut warnings);
            (mailbox, process_data, pdos)
        }
    };
    check::check(info, &mailbox, &process_data)?;
    let is_declared = config.declared.is_some() && !warnings.contains(&PlanWarning::MailboxOfSii);
    let supported = check::SupportedProtocols::new(is_declared, info, !mailbox.is_empty());
    let sizes = check::MailboxSizes::new(&mailbox, &bootstrap);
    let possible = |command| check::command(supported, command).and_then(|()| sizes.holds(command));
    config.startup.iter().try_for_each(possible)?;
    let used = |index: &u8| {
        mailbox.iter().any(|sm| sm.index == *index) || process_data.iter().any(|area| area.sync_manager == *index)
    };
    Ok(SubDevicePlan {
        station: info.station,
        unused: (0..info.controller.sync_manager_count).filter(|index| !used(index)).collect(),
        mailbox,
        bootstrap,
        process_data,
        pdos,
        lrw_supported: info.lrw_supported(),
        watchdog: watchdog(config),
        warnings,
    })
}

/// The registers of an FMMU that maps a whole area, byte by byte, to a logical address.
pub fn fmmu(area: &AreaPlan, logical: LogicalAddress) -> Fmmu {
    Fmmu {
        logical_start: logical,
        length: area.length,
        logical_start_bit: 0,
        logical_stop_bit: 7,
        physical_start: area.physical,
        physical_start_bit: 0,
        read: area.direction == Direction::Inputs,
        write: area.direction == Direction::Outputs,
        active: area.length > 0,
        ..Fmmu::default()
    }
}

/// Whether the mailbox has SyncManagers: without a description in the SII these are SM 0 and 1, unless the SII uses one
/// of them for process data.
fn mailbox_wanted(info: &SubDeviceInfo) -> bool {
    let MailboxSyncManagers { written, read } = info.mailbox_sync_managers();
    let managers = [written, read].into_iter().filter_map(|index| info.sync_managers.get(usize::from(index)));
    !managers.into_iter().any(|sm| matches!(sm.kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs))
}

fn mailbox_of_sii(info: &SubDeviceInfo) -> Option<Vec<SmPlan>> {
    let layout = info.mailbox.filter(|_| mailbox_wanted(info))?;
    Some(mailbox_pair(info, &layout, info.mailbox_sync_managers()))
}

/// The mailboxes of the SII, for a file that has process data but no mailboxes: the SubDevice refuses PREOP without
/// them. `None` if the file uses their SyncManagers or their memory.
fn mailbox_beside(
    info: &SubDeviceInfo,
    declared: &[DeclaredSyncManager],
    process_data: &[AreaPlan],
) -> Option<Vec<SmPlan>> {
    let mailbox = mailbox_of_sii(info)?;
    let is_used = mailbox.iter().any(|sm| declared.iter().any(|it| it.index == sm.index));
    (!is_used && check::check(info, &mailbox, process_data).is_ok()).then_some(mailbox)
}

/// The mailboxes of a file that differ from those of the SII.
fn other_mailboxes(info: &SubDeviceInfo, mailbox: &[SmPlan]) -> impl Iterator<Item = PlanWarning> {
    let of_sii = mailbox_of_sii(info).unwrap_or_default();
    mailbox.iter().filter_map(move |own| {
        let other = of_sii.iter().find(|other| other.index == own.index)?;
        let [declared, sii] = [own, other].map(|it| (it.register.start, it.register.length));
        (declared != sii).then_some(PlanWarning::OtherMailbox { sync_manager: own.index, declared, sii })
    })
}

/// Process data of a file at another address than that of the SII.
fn other_address(info: &SubDeviceInfo, area: &AreaPlan) -> Option<PlanWarning> {
    let sync_manager = area.sync_manager;
    let described = info.sync_managers.get(usize::from(sync_manager))?;
    let is_process_data = matches!(described.kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs);
    let (declared, sii) = (area.physical, described.start);
    (is_process_data && area.length > 0 && declared != sii).then_some(PlanWarning::OtherAddress {
        sync_manager,
        declared,
        sii,
    })
}

fn mailbox_pair(info: &SubDeviceInfo, layout: &MailboxLayout, of: MailboxSyncManagers) -> Vec<SmPlan> {
    let control = |index: u8, kind, default| {
        let described = info.sync_managers.get(usize::from(index));
        described.filter(|sm| sm.kind == kind && sm.kind_of_control() == kind).map_or(default, |sm| sm.control)
    };
    let out_control = control(of.written, SyncManagerKind::MailboxOut, MAILBOX_OUT_CONTROL);
    let in_control = control(of.read, SyncManagerKind::MailboxIn, MAILBOX_IN_CONTROL);
    Vec::from([
        SmPlan { index: of.written, register: sync_manager(layout.receive_offset, layout.receive_size, out_control) },
        SmPlan { index: of.read, register: sync_manager(layout.send_offset, layout.send_size, in_control) },
    ])
}

fn watchdog(config: &SubDeviceConfig) -> Vec<(RegisterAddress, Vec<u8>)> {
    let registers = [
        (map::WATCHDOG_DIVIDER, config.watchdog_divider),
        (map::WATCHDOG_TIME_PDI, config.pdi_watchdog_intervals),
        (map::WATCHDOG_TIME_PROCESS_DATA, config.watchdog_intervals),
    ];
    let written = registers.into_iter().filter_map(|(address, value)| Some((address, value?.to_le_bytes().to_vec())));
    written.collect()
}

#[cfg(test)]
mod tests;
