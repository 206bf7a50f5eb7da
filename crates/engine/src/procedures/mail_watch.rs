//! Finding out who has mail that nobody asked for (facts 6.1).
//!
//! SubDevices whose SII offers it show the status bit of their send mailbox through an FMMU: each has a bit of its own in
//! the logical address space, and all answer one read together. The others are asked one by one, so seldom that all of
//! them together take a small part of the wire.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{LogicalAddress, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{MAX_DATA, Target};
use ringcat_wire::register::{Fmmu, SyncManager, SyncManagerStatus, map};
use ringcat_wire::sii::FmmuUsage;

use super::fleet::SharedFleet;
use crate::info::SubDeviceInfo;
use crate::mail::Mailbox;
use crate::plan::SubDevicePlan;
use crate::supervisor::Bus;

/// Shortest pause between two rounds.
const PAUSE: Duration = Duration::from_millis(5);
/// Time on the wire that one question may take on average; with its overhead one takes about 3 us.
const TIME_EACH: Duration = Duration::from_micros(60);
/// Where the bits lie: beyond all process data, which ends at 2 GiB.
const BITS_AT: LogicalAddress = LogicalAddress(0xF000_0000);
/// Bit of the status register that says "full".
const FULL_BIT: u8 = 3;

/// The FMMU that shows whether there is mail, with its number: the one that the SII names, or the first one behind those
/// of process data. `None` where the SII names none, or where bits cannot be mapped.
pub(super) fn fmmu(index: usize, plan: &SubDevicePlan, info: &SubDeviceInfo) -> Option<(u8, Fmmu)> {
    let named = info.fmmu_usages.iter().position(|usage| *usage == FmmuUsage::MailboxStatus)?;
    let mapped = plan.mapped_areas().count();
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

/// A mailbox that may be used.
struct Open {
    index: usize,
    station: StationAddress,
    /// Says whether there is mail.
    status: RegisterAddress,
    mailbox: Mailbox,
    mapped: bool,
}

/// Runs for ever.
pub(crate) async fn watch_mail(bus: Bus, fleet: SharedFleet) {
    let mut alone = 0;
    loop {
        bus.sleep(PAUSE.max(TIME_EACH.saturating_mul(alone))).await;
        let (mapped, mut others): (Vec<Open>, Vec<Open>) =
            open_mailboxes(&fleet).into_iter().partition(|open| open.mapped);
        for open in &mapped {
            if bus.has_stray_mail(open.station) {
                open.mailbox.is_full();
            }
        }
        // Where some do not answer, nobody knows who: all are asked, until they are found and mended.
        if !look_together(&bus, &mapped).await {
            others.extend(mapped);
        }
        alone = u32::try_from(others.len()).unwrap_or(u32::MAX);
        bus.gather_in_turns(others, look).await;
    }
}

fn open_mailboxes(fleet: &SharedFleet) -> Vec<Open> {
    let access = fleet.access();
    let members = access.members.iter().enumerate();
    members
        .filter_map(|(index, member)| {
            let mapped = member.setup.as_ref().is_some_and(|setup| setup.mail_fmmu.is_some());
            let (station, status) = member.mailbox.send_status()?;
            Some(Open { index, station, status, mailbox: member.mailbox.clone(), mapped })
        })
        .collect()
}

/// One read for all; false where not all answered.
async fn look_together(bus: &Bus, mapped: &[Open]) -> bool {
    let Some(last) = mapped.iter().map(|open| open.index).max() else { return true };
    let expected = Wkc(mapped.len() as u16);
    let (target, data) = (Target::Logical(BITS_AT), vec![0; last / 8 + 1]);
    let Ok(reply) = bus.transfer(Command::Lrd, target, data, Some(expected)).await else { return true };
    for open in mapped {
        if reply.data[open.index / 8] & 1 << (open.index % 8) != 0 {
            open.mailbox.is_full();
        }
    }
    reply.wkc() == expected
}

/// One that does not answer is the matter of whoever supervises.
async fn look(bus: Bus, open: Open) {
    if bus.has_stray_mail(open.station) {
        open.mailbox.is_full();
        return;
    }
    if let Ok([status]) = bus.fprd_array(open.station, open.status).await
        && SyncManagerStatus::from_bits(status).mailbox_full
    {
        open.mailbox.is_full();
    }
}
