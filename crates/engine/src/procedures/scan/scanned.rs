//! Result of a scan, and what the model reports of it.

use alloc::vec::Vec;

use crate::segment::Scan;
use crate::segment::findings::ScanFinding;

/// Result of a scan, and what the model reports of it.
#[derive(Debug)]
pub struct Scanned {
    /// The result.
    pub scan: Scan,
    /// In the order of the reports.
    pub findings: Vec<ScanFinding>,
}
