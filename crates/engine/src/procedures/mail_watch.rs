//! Detects unsolicited mail of SubDevices (protocol 6.1).
//!
//! SubDevices whose SII offers it map the status bit of their send mailbox through an FMMU: each has a bit of its own
//! in the logical address space, and one read covers all. The others are polled one by one, at an interval at which all
//! of them together use a small part of the bandwidth.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::SyncManagerStatus;

use super::shared_segment::SharedSegment;
use crate::mail::Mailbox;
use crate::segment::setup::mail_status::BITS_AT;
use crate::supervisor::Bus;

/// Shortest pause between two rounds.
const PAUSE: Duration = Duration::from_millis(5);
/// Average interval per polled mailbox; a poll takes about 3 us on the wire with its overhead.
const TIME_EACH: Duration = Duration::from_micros(60);

/// A mailbox in use.
struct Open {
    station: StationAddress,
    /// Register with the mailbox-full bit.
    status: RegisterAddress,
    mailbox: Mailbox,
}

/// Runs until the MainDevice stops.
pub(crate) async fn watch_mail(bus: Bus, segment: SharedSegment) {
    let (mut alone, mut mapped, mut others) = (0, Vec::new(), Vec::new());
    loop {
        bus.sleep(PAUSE.max(TIME_EACH.saturating_mul(alone))).await;
        open_mailboxes(&segment, &mut mapped, &mut others);
        if bus.has_stray_mails() {
            announce_stray_mails(&bus, &segment, &mapped);
        }
        // If some do not answer, it is unknown which: all are polled until the supervision has found and repaired them.
        if !poll_together(&bus, &segment, &mapped).await {
            others.extend(mapped.drain(..).filter_map(|index| opened(&segment, index)));
        }
        alone = u32::try_from(others.len()).unwrap_or(u32::MAX);
        if !others.is_empty() {
            bus.gather_in_turns(core::mem::take(&mut others), poll).await;
        }
    }
}

/// Lists the indices of those with a mapped status bit, and the others. The lists keep their memory from round to
/// round.
fn open_mailboxes(segment: &SharedSegment, mapped: &mut Vec<usize>, others: &mut Vec<Open>) {
    let view = segment.view();
    mapped.clear();
    others.clear();
    for (index, (member, mailbox)) in view.members().zip(segment.mailboxes()).enumerate() {
        if !mailbox.is_open() {
            continue;
        }
        if member.setup.as_ref().is_some_and(|setup| setup.mail_fmmu.is_some()) {
            mapped.push(index);
        } else {
            others.extend(opened(segment, index));
        }
    }
}

/// The mailbox of a member, if it is in use.
fn opened(segment: &SharedSegment, index: usize) -> Option<Open> {
    let mailbox = segment.mailboxes().get(index)?;
    let (station, status) = mailbox.send_status()?;
    Some(Open { station, status, mailbox: mailbox.clone() })
}

/// Mail came back after its read was given up: its mailbox is read, as if it were full.
fn announce_stray_mails(bus: &Bus, segment: &SharedSegment, mapped: &[usize]) {
    for mailbox in mapped.iter().filter_map(|index| segment.mailboxes().get(*index)) {
        if mailbox.station().is_some_and(|station| bus.has_stray_mail(station)) {
            mailbox.mail_available();
        }
    }
}

/// One read for all; false if not all answered. `mapped`: their indices, ascending.
async fn poll_together(bus: &Bus, segment: &SharedSegment, mapped: &[usize]) -> bool {
    let Some(last) = mapped.last() else { return true };
    let expected = Wkc(mapped.len() as u16);
    let (target, data) = (Target::Logical(BITS_AT), vec![0; last / 8 + 1]);
    let Ok(reply) = bus.transfer(Command::Lrd, target, data, Some(expected)).await else { return true };
    for (byte, bits) in reply.data.iter().enumerate().filter(|(_, bits)| **bits != 0) {
        let full = (0..8).filter(|bit| bits & 1 << bit != 0).map(|bit| 8 * byte + bit);
        for index in full.filter(|index| mapped.binary_search(index).is_ok()) {
            segment.mailboxes()[index].mail_available();
        }
    }
    reply.wkc() == expected
}

/// The supervision handles a SubDevice that does not answer.
async fn poll(bus: Bus, open: Open) {
    if bus.has_stray_mail(open.station) {
        open.mailbox.mail_available();
        return;
    }
    if let Ok([status]) = bus.fprd_array(open.station, open.status).await
        && SyncManagerStatus::from_bits(status).mailbox_full
    {
        open.mailbox.mail_available();
    }
}
