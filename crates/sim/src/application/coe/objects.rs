//! What the services of CoE work on.

use ringcat_wire::al::AlState;

use crate::application::dictionary::Dictionary;
use crate::application::process_data::ProcessData;

/// What a transfer works on.
#[derive(Debug)]
pub struct Objects<'a> {
    /// The objects.
    pub dictionary: &'a mut Dictionary,
    /// Values of mapped objects.
    pub process_data: &'a ProcessData,
    /// Present state; some objects are writable in PREOP alone.
    pub state: AlState,
    /// Complete access is served.
    pub complete_access: bool,
    /// SDO information is served.
    pub information: bool,
}
