//! Context of the CoE services.

use ringcat_wire::al::AlState;

use crate::application::dictionary::Dictionary;
use crate::application::process_data::ProcessData;

/// Context of a transfer.
#[derive(Debug)]
pub struct Objects<'a> {
    /// The objects.
    pub dictionary: &'a mut Dictionary,
    /// Values of mapped objects.
    pub process_data: &'a ProcessData,
    /// Current state; some objects are writable in PREOP only.
    pub state: AlState,
    /// Whether complete access is supported.
    pub complete_access: bool,
    /// Whether SDO information is supported.
    pub information: bool,
}
