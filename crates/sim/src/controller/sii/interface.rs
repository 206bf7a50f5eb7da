//! State of the SII interface in addition to its registers.

use core::time::Duration;

use ringcat_wire::register::SiiCommand;

use crate::controller::spoilt_write::SpoiltWrite;
use crate::time::SimTime;

/// Activity of the interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Task {
    Idle,
    /// Loading the configuration: the first time since the reset, or again.
    Load {
        first: bool,
    },
    Read,
    Write,
}

/// State of the interface in addition to its registers.
#[derive(Clone, Debug)]
pub(in crate::controller) struct SiiInterface {
    pub(super) task: Task,
    pub(super) until: SimTime,
    /// A command written in this frame.
    pub(super) command: Option<SiiCommand>,
    /// Bit 0 of SII_CONTROL, cached for every frame.
    pub(super) write_enabled: bool,
    /// Number and duration of the next commands with a different duration.
    pub(super) slow: (u32, Duration),
    /// Number and fault of the next failing writes.
    pub(super) spoilt: (u32, SpoiltWrite),
}

impl SiiInterface {
    pub const fn new() -> SiiInterface {
        SiiInterface {
            task: Task::Idle,
            until: SimTime::NEVER,
            command: None,
            write_enabled: false,
            slow: (0, Duration::ZERO),
            spoilt: (0, SpoiltWrite::NotStored),
        }
    }

    /// Time at which the running command ends.
    pub const fn deadline(&self) -> SimTime {
        self.until
    }

    pub const fn is_loading(&self) -> bool {
        matches!(self.task, Task::Load { .. })
    }

    pub(super) fn is_busy(&self) -> bool {
        self.task != Task::Idle
    }
}
