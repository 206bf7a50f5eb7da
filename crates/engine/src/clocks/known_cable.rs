//! The measured time of cables as plain data, for other processes.

use alloc::vec::Vec;

use super::cable_ends::End;

/// The measured time of one cable, or of several together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownCable {
    /// Both ends of each cable; a cable counts as often as it is listed.
    pub ends: Vec<(End, End)>,
    /// The time, with fraction.
    pub time: i64,
    /// A cable was disconnected since the measurement.
    pub is_old: bool,
}
