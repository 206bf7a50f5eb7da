//! What a scan has found beside its result, and what its comparison with a declaration has found. The model decides
//! what is reported of it.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Position;
use ringcat_wire::sii::Identity;

use crate::config::{ConfigError, DuplicateAlias};
use crate::declared::SubDeviceId;
use crate::info::InfoWarning;
use crate::junction::JunctionConnection;
use crate::plan::PlanWarning;
use crate::topology::{Closing, Finding};

/// A finding of a scan.
#[derive(Clone, Debug)]
pub enum ScanFinding {
    /// A fault in the SII of a SubDevice.
    Sii {
        /// Its position.
        position: Position,
        /// The fault.
        warning: InfoWarning,
    },
    /// Two SubDevices have the same alias.
    DuplicateAlias(DuplicateAlias),
    /// Findings about the cabling.
    Cabling(CablingFindings),
    /// A ring behind a junction, by its closing cable.
    JunctionLearned(Closing),
    /// Number of rings behind junctions whose closing cables were not found.
    JunctionsNotLearned(usize),
}

/// Findings about the cabling.
#[derive(Clone, Debug, Default)]
pub struct CablingFindings {
    /// Findings, each with the position of the SubDevice.
    pub findings: Vec<(Position, Finding)>,
    /// The cables of the main and the redundant link are swapped.
    pub are_swapped: bool,
    /// SubDevices process the redundant copy in a closed ring, and those that do were not located.
    pub is_redundant_processed: bool,
}

/// A finding of the comparison of a declaration with the scan.
#[derive(Clone, Debug)]
pub enum DeclarationFinding {
    /// A SubDevice matches no declaration.
    Unexpected {
        /// Its position.
        position: Position,
        /// Its identity.
        identity: Identity,
    },
    /// A declaration has no SubDevice, and none is necessary.
    Absent {
        /// The declaration.
        subdevice: SubDeviceId,
        /// It is optional.
        is_optional: bool,
        /// Why it has none.
        error: ConfigError,
    },
    /// Findings about the cabling.
    Cabling(CablingFindings),
    /// A setting that a SubDevice may not follow.
    SettingFinding(SubDeviceId, SettingFinding),
}

/// A setting in a declaration that a SubDevice may not follow.
#[derive(Clone, Debug)]
pub enum SettingFinding {
    /// A rule that it cannot follow.
    Plan(PlanWarning),
    /// A declared ring is not watched: it has an end at this SubDevice, which is not there.
    AbsentEnd(JunctionConnection),
    /// Its watchdog expires before its next outputs.
    Watchdog {
        /// Period of its outputs.
        period: Duration,
        /// Time of its watchdog.
        watchdog: Duration,
    },
    /// It is not there, and its PDOs are not declared.
    NoPlace,
    /// The SubDevice is declared as the reference clock, but has no distributed clock.
    Reference {
        /// The position of the clock that takes its place.
        instead: Option<Position>,
    },
}
