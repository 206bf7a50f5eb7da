//! What is found about the PDOs in the dictionary of a SubDevice.

use crate::config::PdoAssignment;

/// What is found about the PDOs in the dictionary of a SubDevice.
#[derive(Clone, Copy, Debug)]
pub enum PdoFinding<'a> {
    /// It was written, or is about to be, and may hold anything.
    Outdated,
    /// It holds these: they were read, or written.
    Held(&'a [PdoAssignment]),
    /// It cannot be read, or has no PDOs: it is not tried again before the next attempt.
    Unreadable,
}
