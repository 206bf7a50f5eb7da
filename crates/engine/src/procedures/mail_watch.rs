//! Finding out who has mail that nobody asked for (facts 6.1).
//!
//! SubDevices whose status bit an FMMU maps into the logical address space answer one read together; the others are asked
//! one by one, so seldom that all of them together take a small part of the wire.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{SyncManager, SyncManagerStatus, map};

use super::fleet::SharedFleet;
use crate::mail::Mailbox;
use crate::supervisor::Bus;

/// Shortest pause between two rounds.
const PAUSE: Duration = Duration::from_millis(5);
/// Time on the wire that one question may take on average; with its overhead one takes about 3 us.
const TIME_EACH: Duration = Duration::from_micros(60);
/// SyncManager of the send mailbox (SubDevice to MainDevice).
const SEND_SYNC_MANAGER: u8 = 1;

/// Runs for ever.
pub(crate) async fn watch_mail(bus: Bus, fleet: SharedFleet) {
    loop {
        let open = open_mailboxes(&fleet);
        let count = u32::try_from(open.len()).unwrap_or(u32::MAX);
        bus.sleep(PAUSE.max(TIME_EACH.saturating_mul(count))).await;
        bus.gather(open, look).await;
    }
}

fn open_mailboxes(fleet: &SharedFleet) -> Vec<(StationAddress, Mailbox)> {
    let access = fleet.access();
    let mailboxes = access.members.iter().map(|member| &member.mailbox);
    mailboxes.filter_map(|mailbox| Some((mailbox.station()?, mailbox.clone()))).collect()
}

/// One that does not answer is the matter of whoever supervises.
async fn look(bus: Bus, (station, mailbox): (StationAddress, Mailbox)) {
    let at = map::sync_manager(SEND_SYNC_MANAGER).offset(SyncManager::STATUS);
    if bus.has_stray_mail(station) {
        mailbox.is_full();
        return;
    }
    if let Ok([status]) = bus.fprd_array(station, at).await
        && SyncManagerStatus::from_bits(status).mailbox_full
    {
        mailbox.is_full();
    }
}
