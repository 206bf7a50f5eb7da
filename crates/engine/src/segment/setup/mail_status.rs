//! The FMMU that maps whether a SubDevice has mail (protocol 6.1): each has a bit of its own in the logical address
//! space, so one read covers all.

use ringcat_wire::address::LogicalAddress;
use ringcat_wire::datagram::MAX_DATA;
use ringcat_wire::register::{Fmmu, SyncManager, map};
use ringcat_wire::sii::FmmuUsage;

use crate::info::SubDeviceInfo;
use crate::plan::SubDevicePlan;

/// First address of the bits: beyond all process data, which ends at 2 GiB.
pub const BITS_AT: LogicalAddress = LogicalAddress(0xF000_0000);
/// The mailbox-full bit of the status register.
const FULL_BIT: u8 = 3;

/// The FMMU that maps the mailbox-full bit, with its number: the one given in the SII, or the first one behind those of
/// process data, of which there are `mapped`. `None` if the SII gives none, or bits cannot be mapped.
pub fn fmmu(index: usize, plan: &SubDevicePlan, info: &SubDeviceInfo, mapped: usize) -> Option<(u8, Fmmu)> {
    let named = info.fmmu_usages.iter().position(|usage| *usage == FmmuUsage::MailboxStatus)?;
    let number = u8::try_from(named.max(mapped)).ok().filter(|number| *number < info.controller.fmmu_count)?;
    let byte = u32::try_from(index / 8).ok().filter(|byte| *byte < MAX_DATA as u32)?;
    let send = plan.mailbox.last().filter(|_| !info.controller.features.fmmu_byte_oriented)?;
    let bit = (index % 8) as u8;
    let register = Fmmu {
        logical_start: LogicalAddress(BITS_AT.0 + byte),
        length: 1,
        logical_start_bit: bit,
        logical_stop_bit: bit,
        physical_start: map::sync_manager(send.index).offset(SyncManager::STATUS).0,
        physical_start_bit: FULL_BIT,
        read: true,
        active: true,
        ..Fmmu::default()
    };
    Some((number, register))
}
