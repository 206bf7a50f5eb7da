//! State of a SubDevice at the start of its configuration.

/// Knowledge about its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// A scan has just put it into INIT and cleared its registers.
    Cleared,
    /// Any state; its configuration may be reused.
    Unknown,
    /// Any state; its configuration must not be reused.
    Doubtful,
}
