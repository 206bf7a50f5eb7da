//! What a SubDevice is like when its configuration begins.

/// What is known of its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// A scan has just put it into INIT and cleared its registers.
    Cleared,
    /// Anything; what it still has may be used.
    Unknown,
    /// Anything, and what it has is of no use.
    Doubtful,
}
