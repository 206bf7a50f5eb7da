//! The end of a scan, for the model.

use alloc::string::String;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;

use super::scanned::Scanned;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::Observation;

/// Passes what a scan has found to the model; the reason if it failed.
pub(crate) fn end_scan(segment: &SharedSegment, ended: Result<Scanned, String>) {
    let ended = ended.map(|Scanned { scan, findings }| {
        let subdevices = scan.subdevices.len();
        segment.observe(Observation::ScanShows { findings, subdevices });
        scan
    });
    segment.observe(Observation::ScanEnded(ended));
}

/// Runs a scan with this number until it ends, or until another one begins; `None` then. What it has changed for a
/// moment is for the other one to restore.
pub(crate) async fn unless_another<T>(
    segment: &SharedSegment,
    number: u32,
    scan: impl Future<Output = T>,
) -> Option<T> {
    let another = segment.until(|model| model.has_another_scan(number).then_some(()));
    let (mut another, mut scan) = (pin!(another), pin!(scan));
    poll_fn(|context| match another.as_mut().poll(context) {
        Poll::Ready(()) => Poll::Ready(None),
        Poll::Pending => scan.as_mut().poll(context).map(Some),
    })
    .await
}
