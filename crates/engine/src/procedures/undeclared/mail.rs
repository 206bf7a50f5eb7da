//! Unsolicited mail of SubDevices without a declaration: emergencies, Ethernet frames; and mail that has changed their
//! PDOs.

use core::time::Duration;

use ringcat_wire::register::SyncManagerStatus;

use crate::mail::Mailbox;
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;

/// Pause between two rounds: no cycle waits for this mail.
const PAUSE: Duration = Duration::from_millis(100);

/// Polls the mailboxes in use, one round after the other. Runs until the MainDevice stops.
pub(crate) async fn watch_undeclared_mail(bus: Bus, segment: SharedSegment) {
    loop {
        bus.sleep(PAUSE).await;
        segment.observe_undeclared_pdos();
        bus.gather_in_turns(segment.undeclared.in_use(), poll).await;
    }
}

async fn poll(bus: Bus, mailbox: Mailbox) {
    let Some((station, status)) = mailbox.send_status() else { return };
    if bus.has_stray_mail(station) {
        return mailbox.mail_available();
    }
    // The supervision handles a SubDevice that does not answer.
    if let Ok([status]) = bus.fprd_array(station, status).await
        && SyncManagerStatus::from_bits(status).mailbox_full
    {
        mailbox.mail_available();
    }
}
