//! The end of a scan, for the model.

use alloc::string::String;
use core::future::Future;

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
    segment.unless(|model| model.has_another_scan(number), scan).await
}
