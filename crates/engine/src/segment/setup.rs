//! Data to write to a SubDevice, complete with logical addresses.

mod error;
pub mod mail_status;
mod places;
pub mod presence;

use alloc::vec::Vec;

use ringcat_wire::register::Fmmu;

use crate::config::{DeclaredSyncManager, SubDeviceConfig};
use crate::info::{Direction, SubDeviceInfo};
use crate::layout::Layout;
use crate::plan::{self, AreaPlan, SubDevicePlan};

pub use error::SetupError;

/// Data to write to one SubDevice, complete with logical addresses.
#[derive(Debug)]
pub struct Setup {
    /// Registers and SDOs.
    pub plan: SubDevicePlan,
    /// FMMU number and registers.
    pub fmmus: Vec<(u8, Fmmu)>,
    /// Number of the FMMU that maps the mailbox-full bit.
    pub mail_fmmu: Option<u8>,
    /// Number of the FMMU that maps its AL status into the frames of its process data.
    pub presence_fmmu: Option<u8>,
    /// FMMUs that the controller has.
    pub fmmu_count: u8,
    /// SyncManagers that the controller has.
    pub sync_manager_count: u8,
    /// AL control is copied into AL status by hardware.
    pub emulated: bool,
}

impl Setup {
    /// Plans a SubDevice and gives its areas the logical addresses of the layout. Areas without a domain are configured
    /// without an FMMU.
    pub fn new(
        index: usize,
        config: &SubDeviceConfig,
        info: &SubDeviceInfo,
        layout: &Layout,
    ) -> Result<Setup, SetupError> {
        let plan = plan::plan(config, info).map_err(SetupError::Plan)?;
        let (mut fmmus, mapped) = places::fmmus(index, &plan, info, layout)?;
        let mail = mail_status::fmmu(index, &plan, info, mapped);
        let mail_fmmu = mail.map(|(number, _)| number);
        fmmus.extend(mail);
        let mut presence_fmmu = None;
        if let Some(logical) = layout.presence(index) {
            let number = presence::number(index, &plan, info, mapped)
                .ok_or(SetupError::NoSpareFmmu(info.controller.fmmu_count))?;
            fmmus.push((number, presence::fmmu(logical)));
            presence_fmmu = Some(number);
        }
        Ok(Setup {
            plan,
            fmmus,
            mail_fmmu,
            presence_fmmu,
            fmmu_count: info.controller.fmmu_count,
            sync_manager_count: info.controller.sync_manager_count,
            emulated: info.device_emulation,
        })
    }

    /// Number of areas with an FMMU.
    pub fn process_data_fmmus(&self) -> usize {
        let areas = self.plan.mapped_areas().count();
        self.fmmus.iter().filter(|(number, _)| usize::from(*number) < areas).count()
    }

    /// The FMMU registers from the first to the last used one, for one write.
    pub fn fmmu_registers(&self) -> Vec<u8> {
        let count = self.fmmus.iter().map(|(number, _)| usize::from(*number) + 1).max().unwrap_or(0);
        let mut registers = alloc::vec![0; Fmmu::LEN * count];
        for (number, fmmu) in &self.fmmus {
            let at = Fmmu::LEN * usize::from(*number);
            registers[at..at + Fmmu::LEN].copy_from_slice(&fmmu.encode());
        }
        registers
    }
}

/// Bytes of the process data areas fixed by the declaration, for an absent SubDevice.
pub fn declared_areas(config: &SubDeviceConfig) -> Option<Vec<(u8, Direction, u16)>> {
    if let Some(declared) = &config.declared {
        return Some(
            declared
                .iter()
                .filter_map(DeclaredSyncManager::area)
                .map(|it| (it.sync_manager, it.direction, it.length))
                .collect(),
        );
    }
    let mut areas = Vec::new();
    for assignment in config.pdos.as_ref()? {
        let mut bits = 0;
        for pdo in &assignment.pdos {
            bits += pdo.entries.as_ref()?.iter().map(|entry| u32::from(entry.bit_length)).sum::<u32>();
        }
        areas.push((assignment.sync_manager, assignment.direction, u16::try_from(bits.div_ceil(8)).ok()?));
    }
    Some(areas)
}

/// Bytes of the process data areas of a plan.
pub fn planned_areas(plan: &SubDevicePlan) -> Vec<(u8, Direction, u16)> {
    plan.process_data.iter().map(|area: &AreaPlan| (area.sync_manager, area.direction, area.length)).collect()
}
