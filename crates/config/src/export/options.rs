//! Choices for an export.

/// Use of LRW in the cyclic commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LrwUse {
    /// For the SubDevices for which the declaration names an LRW, or for all where its policy is LRW.
    #[default]
    AsDeclared,
    /// For all SubDevices: one interface only.
    Always,
    /// For none: LRD and LWR, as two interfaces need.
    Never,
}

/// Choices for an export.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ExportOptions {
    /// Use of LRW.
    pub lrw: LrwUse,
}

impl ExportOptions {
    /// With this use of LRW.
    #[must_use]
    pub const fn with_lrw(mut self, lrw: LrwUse) -> ExportOptions {
        self.lrw = lrw;
        self
    }
}
