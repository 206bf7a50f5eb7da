//! What `ringcat capture --json` prints.

use serde::Serialize;

/// A recording.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Capture {
    /// The file as it was named
    pub file: String,
    /// Frames of all interfaces together
    pub frames: u64,
    /// The interfaces in the order of the command line
    pub interfaces: Vec<Interface>,
}

/// What passed on an interface.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Interface {
    /// Its name
    pub interface: String,
    /// Frames that arrived
    pub received_frames: u64,
    /// Frames that left
    pub sent_frames: u64,
    /// Frames that are missing in the file
    pub unrecorded_frames: u64,
}
