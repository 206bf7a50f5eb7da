//! Result of a scan, and what the model reports of it.

use alloc::vec::Vec;

use crate::event::Event;
use crate::segment::Scan;

/// Result of a scan, and what the model reports of it.
#[derive(Debug)]
pub struct Scanned {
    /// The result.
    pub scan: Scan,
    /// In their order; the last one is the end of the scan.
    pub findings: Vec<Event>,
}
