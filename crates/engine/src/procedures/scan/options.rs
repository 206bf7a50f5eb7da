//! Options of a scan.

use core::time::Duration;

use crate::info::{AliasSource, SiiAssignment, SiiExtent};
use crate::junction::JunctionMode;
use crate::procedures::sii::SiiCache;
use crate::segment::ReadPdos;

/// Options of a scan.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ScanOptions {
    /// The count must stay the same for this long.
    pub settle: Duration,
    /// How long to wait for the first SubDevice.
    pub patience: Duration,
    /// How much of each SII is read.
    pub extent: SiiExtent,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Handling of rings behind junctions.
    pub junctions: JunctionMode,
    /// Whether the redundant link may be taken down for a moment to locate a crossed line.
    pub enhanced_line_crossed: bool,
    /// Dictionaries that are read for PDOs.
    pub pdos: ReadPdos,
    /// Where aliases are read.
    pub alias_source: AliasSource,
    /// When EEPROMs belong to their PDIs.
    pub sii_assignment: SiiAssignment,
}
