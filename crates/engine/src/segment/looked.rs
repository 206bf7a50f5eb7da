//! Result of a round of scans.

use ringcat_wire::address::{StationAddress, Wkc};

use super::asked::Asked;
use super::look::Look;
use super::member::Phase;

/// Result of a round of scans.
#[derive(Clone, Copy, Debug)]
pub struct Looked<'a> {
    /// Version of the model at the start of the round.
    pub asked: Asked,
    /// By member.
    pub looks: &'a [Look],
    /// Phase of each member when the round began.
    pub before: &'a [Phase],
    /// SubDevices without a declaration, by station address.
    pub unassigned: &'a [(StationAddress, Look)],
    /// SubDevices that the latest supervision result counts; `None` before the first.
    pub counted: Option<Wkc>,
}
