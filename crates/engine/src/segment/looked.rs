//! What a round of looks has shown.

use ringcat_wire::address::{StationAddress, Wkc};

use super::asked::Asked;
use super::look::Look;
use super::member::Phase;

/// What a round of looks has shown.
#[derive(Clone, Copy, Debug)]
pub struct Looked<'a> {
    /// What it was about.
    pub asked: Asked,
    /// By member.
    pub looks: &'a [Look],
    /// How far each member was when the round began.
    pub before: &'a [Phase],
    /// Of those without a declaration, by station address.
    pub unassigned: &'a [(StationAddress, Look)],
    /// SubDevices that the latest supervision result counts; `None` before the first.
    pub counted: Option<Wkc>,
}
