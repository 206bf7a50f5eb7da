//! State of the other MainDevice of a ring, as determined by the ACTIVE.

use core::fmt;

use ringcat_wire::master_frame::{NotReady, Stage};

/// The other MainDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Partner {
    /// No frame comes back forwarded.
    #[default]
    Absent,
    /// It forwards, and does not take part in master frames: another stack, a bare forwarder, or another version.
    Forwards,
    /// It takes part.
    Alive {
        /// How far it follows.
        stage: Stage,
        /// Why it cannot take over.
        not_ready: NotReady,
        /// It has taken all that was sent in the last cycle.
        is_consistent: bool,
    },
}

impl Partner {
    /// Whether it can take over.
    pub const fn is_ready(&self) -> bool {
        matches!(self, Partner::Alive { stage: Stage::Ready | Stage::Accepts, is_consistent: true, .. })
    }
}

impl fmt::Display for Partner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Partner::Absent => f.write_str("absent"),
            Partner::Forwards => f.write_str("forwards, and does not follow"),
            Partner::Alive { is_consistent: false, .. } => f.write_str("follows, and does not take all areas"),
            Partner::Alive { stage, not_ready, .. } if not_ready.is_ready() => {
                f.write_str(if *stage == Stage::Accepts { "takes over" } else { "ready" })?;
                if *not_ready == NotReady::NOTHING { Ok(()) } else { write!(f, ", but {not_ready}") }
            }
            Partner::Alive { not_ready, .. } => write!(f, "not ready: {not_ready}"),
        }
    }
}
