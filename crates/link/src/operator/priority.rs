//! How important a line is.

/// Priority of a line, as `syslog` has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Priority {
    /// Something failed.
    Error,
    /// Something is not as it should be.
    Warning,
    /// Something has changed.
    Info,
    /// For a search of faults.
    Debug,
}

impl Priority {
    /// Its number.
    pub const fn number(self) -> u8 {
        match self {
            Priority::Error => 3,
            Priority::Warning => 4,
            Priority::Info => 6,
            Priority::Debug => 7,
        }
    }
}
