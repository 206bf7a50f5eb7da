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
    index: usize,
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
        for open in &mapped {
            if bus.has_stray_mail(open.station) {
                open.mailbox.mail_available();
            }
        }
        // If some do not answer, it is unknown which: all are polled until the supervision has found and repaired them.
        if !poll_together(&bus, &mapped).await {
            others.append(&mut mapped);
        }
        alone = u32::try_from(others.len()).unwrap_or(u32::MAX);
        if !others.is_empty() {
            bus.gather_in_turns(core::mem::take(&mut others), poll).await;
        }
    }
}

/// Lists those with a mapped status bit, and the others. The lists keep their memory from round to round.
fn open_mailboxes(segment: &SharedSegment, mapped: &mut Vec<Open>, others: &mut Vec<Open>) {
    let view = segment.view();
    mapped.clear();
    others.clear();
    for (index, (member, mailbox)) in view.members().zip(segment.mailboxes()).enumerate() {
        let Some((station, status)) = mailbox.send_status() else { continue };
        let is_mapped = member.setup.as_ref().is_some_and(|setup| setup.mail_fmmu.is_some());
        let list = if is_mapped { &mut *mapped } else { &mut *others };
        list.push(Open { index, station, status, mailbox: mailbox.clone() });
    }
}

/// One read for all; false if not all answered.
async fn poll_together(bus: &Bus, mapped: &[Open]) -> bool {
    let Some(last) = mapped.iter().map(|open| open.index).max() else { return true };
    let expected = Wkc(mapped.len() as u16);
    let (target, data) = (Target::Logical(BITS_AT), vec![0; last / 8 + 1]);
    let Ok(reply) = bus.transfer(Command::Lrd, target, data, Some(expected)).await else { return true };
    for open in mapped {
        if reply.data[open.index / 8] & 1 << (open.index % 8) != 0 {
            open.mailbox.mail_available();
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
