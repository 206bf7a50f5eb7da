//! Addresses and sizes of the mailboxes: from the fixed area, otherwise from the SyncManagers (protocol 4.1, 4.4).

use alloc::vec::Vec;

use ringcat_wire::sii::{MailboxLayout, SiiHeader, SyncManagerKind};

use super::parts::fixed_area;
use crate::info::subdevice::{ControllerInfo, SubDeviceInfo};
use crate::info::warning::{InfoWarning, MAILBOX_HEADER, SiiProblem};

/// Byte offsets in the fixed area, for warnings.
const BOOTSTRAP_AT: usize = 2 * 0x14;
const STANDARD_AT: usize = 2 * 0x18;
const PROTOCOLS_AT: usize = 2 * 0x1C;
/// Mailboxes lie in process RAM.
const PROCESS_RAM: u32 = 0x1000;

/// Requires that the SyncManagers are collected.
pub(super) fn collect(info: &mut SubDeviceInfo, header: &SiiHeader) {
    let memory_end = memory_end(&info.controller);
    info.bootstrap = pair(&header.bootstrap_mailbox, BOOTSTRAP_AT, memory_end, &mut info.warnings);
    info.mailbox = pair(&header.standard_mailbox, STANDARD_AT, memory_end, &mut info.warnings);
    let protocols = header.protocols.0;
    if protocols == 0 || info.mailbox.is_some() {
        return;
    }
    // A SubDevice with mailbox protocols has mailboxes: its SyncManagers may contain their addresses.
    let described = of_sync_managers(info).filter(|layout| fits(layout, memory_end));
    info.mailbox = described;
    if described.is_none() {
        info.warnings.push(fixed_area(PROTOCOLS_AT, SiiProblem::NoMailbox { protocols }));
    }
}

/// A pair of mailboxes, `None` if it has no size. Vendors leave 0xFFFF in unused fields.
fn pair(
    layout: &MailboxLayout,
    offset: usize,
    memory_end: u32,
    warnings: &mut Vec<InfoWarning>,
) -> Option<MailboxLayout> {
    let none = |size: u16| size == 0 || size == 0xFFFF;
    let MailboxLayout { receive_size, send_size, .. } = *layout;
    let problem = match (none(receive_size), none(send_size)) {
        (true, true) => return None,
        (false, false) if fits(layout, memory_end) => return Some(*layout),
        (false, false) => SiiProblem::Mailbox { layout: *layout, memory_end },
        _ => SiiProblem::HalfMailbox { receive_size, send_size },
    };
    warnings.push(fixed_area(offset, problem));
    None
}

/// First byte behind the process RAM.
fn memory_end(controller: &ControllerInfo) -> u32 {
    match controller.ram_kib {
        // The controller does not report its RAM size.
        0 => 0x1_0000,
        kib => PROCESS_RAM + 1024 * u32::from(kib),
    }
}

/// Whether mailboxes can exist in a controller: they are long enough for messages, lie in the process RAM, and do not
/// overlap.
pub(crate) fn is_possible(layout: &MailboxLayout, controller: &ControllerInfo) -> bool {
    fits(layout, memory_end(controller))
}

fn fits(layout: &MailboxLayout, memory_end: u32) -> bool {
    let span = |offset: u16, size: u16| (u32::from(offset), u32::from(offset) + u32::from(size));
    let (out, inward) = (span(layout.receive_offset, layout.receive_size), span(layout.send_offset, layout.send_size));
    let is_inside = |(start, end): (u32, u32)| {
        start >= PROCESS_RAM && end <= memory_end && end - start >= u32::from(MAILBOX_HEADER)
    };
    is_inside(out) && is_inside(inward) && (out.1 <= inward.0 || inward.1 <= out.0)
}

fn of_sync_managers(info: &SubDeviceInfo) -> Option<MailboxLayout> {
    let of = |kind: SyncManagerKind| info.sync_managers.iter().find(|manager| manager.kind == kind);
    let (out, inward) = (of(SyncManagerKind::MailboxOut)?, of(SyncManagerKind::MailboxIn)?);
    Some(MailboxLayout {
        receive_offset: out.start,
        receive_size: out.length,
        send_offset: inward.start,
        send_size: inward.length,
    })
}
