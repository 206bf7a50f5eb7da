//! Reads the object dictionaries of SubDevices without a declaration, while no application is active.

use core::time::Duration;

use crate::mail::Limits;
use crate::procedures::shared_segment::{SharedSegment, until_active};
use crate::segment::{Segment, SubDeviceKey, UndeclaredObservation};
use crate::supervisor::Bus;

/// Time from the beginning until dictionaries are read: requests for a segment that has just come are first.
const QUIET: Duration = Duration::from_secs(1);
/// Time limits of one request.
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));

/// Reads them one after the other, each once for each time that its SubDevice has reached its state.
pub(in crate::procedures) async fn read_dictionaries(bus: Bus, segment: SharedSegment) {
    until_active(&segment, async {
        bus.sleep(QUIET).await;
        loop {
            let (key, attempt) = segment.until(Segment::dictionary_to_read).await;
            complete(&segment, key).await;
            segment.observe_undeclared(UndeclaredObservation::DictionaryRead { key, attempt });
        }
    })
    .await;
}

/// One that cannot be read is read by the next request for it.
async fn complete(segment: &SharedSegment, key: SubDeviceKey) {
    let identity = segment.view().unassigned(key).and_then(|it| it.knowledge.info()).map(|info| info.identity);
    let Some(mailbox) = segment.undeclared.of(key) else { return };
    let _ = segment.dictionaries.of(&mailbox, identity).complete(LIMITS).await;
}
