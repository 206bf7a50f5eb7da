//! Settings at activation.

use crate::info::{AliasSource, SiiAssignment};
use crate::junction::JunctionMode;

/// What follows a failed configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Retries {
    /// It is repeated after pauses of 100 ms to 5 s, without end; after a loss of frames the first pauses are shorter.
    #[default]
    Always,
    /// The SubDevice stays as it is until a retry is requested. An attempt that failed because frames were lost is
    /// repeated in any case.
    OnRequest,
}

/// Object dictionaries from which PDO assignment and mapping are read. They have priority over the SII.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReadPdos {
    /// No dictionaries.
    Never,
    /// Dictionaries of SubDevices whose SII assigns no PDO to a SyncManager for process data that is in use.
    #[default]
    Missing,
    /// Dictionaries of all SubDevices with CoE.
    Always,
}

/// Settings at activation.
#[derive(Clone, Copy, Debug)]
pub struct Choices {
    /// The redundant link is taken down for a moment if a closed ring has crossed lines (LC-03).
    pub enhanced_line_crossed: bool,
    /// Rings behind junctions.
    pub junctions: JunctionMode,
    /// The cabling is taken over when a hot connect group joins or leaves.
    pub follow_groups: bool,
    /// SubDevices without a declaration are kept in their requested states.
    pub idle_operation: bool,
    /// The exchange sends a supervision datagram: changes are detected.
    pub supervision: bool,
    /// What follows a failed configuration.
    pub retries: Retries,
    /// Dictionaries that are read of undeclared SubDevices in PREOP, SAFEOP and OP.
    pub pdos: ReadPdos,
    /// Without an application object dictionaries are read.
    pub dictionaries: bool,
    /// Where aliases are read.
    pub alias_source: AliasSource,
    /// When EEPROMs belong to their PDIs.
    pub sii_assignment: SiiAssignment,
}
