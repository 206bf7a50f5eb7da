//! Stages of a segment: from the first scan to an application, and back.

use alloc::rc::Rc;

use super::scan::Found;
use super::start::Start;

/// The stage of a segment.
#[derive(Debug, Default)]
pub(super) enum Stage {
    /// No scan has succeeded.
    #[default]
    Unscanned,
    /// A scan is under way: nothing is known until it ends.
    Scanning {
        /// The application has requested it; otherwise it is one of idle operation.
        is_requested: bool,
    },
    /// The SubDevices of the last scan are known, and none is declared.
    Scanned(Scanned),
    /// An application is active.
    Active(Scanned),
}

/// The SubDevices of the last scan.
#[derive(Clone, Debug)]
pub(super) struct Scanned {
    pub found: Rc<Found>,
    /// Their registers when the application begins.
    pub registers: Start,
}

impl Stage {
    /// The same, to take over what is learnt about them.
    pub fn scanned_mut(&mut self) -> Option<&mut Scanned> {
        match self {
            Stage::Unscanned | Stage::Scanning { .. } => None,
            Stage::Scanned(scanned) | Stage::Active(scanned) => Some(scanned),
        }
    }

    /// The SubDevices of the last scan.
    pub fn scanned(&self) -> Option<&Scanned> {
        match self {
            Stage::Unscanned | Stage::Scanning { .. } => None,
            Stage::Scanned(scanned) | Stage::Active(scanned) => Some(scanned),
        }
    }
}
