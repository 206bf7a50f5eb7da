//! The result of a measurement of the segment.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::clocks::Delays;

/// The result of a measurement of the segment.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Station addresses by position.
    pub stations: Vec<StationAddress>,
    /// Delays by position.
    pub delays: Delays,
    /// Drift of each clock against the reference (positive: faster), by position.
    pub drift_ppb: Vec<Option<i64>>,
}
