//! The end of a scan, for the model.

use alloc::string::String;

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
