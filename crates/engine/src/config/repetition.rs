//! What a SubDevice may receive a second time within a cycle, when a frame was lost and is sent again.

/// What a SubDevice may receive a second time within a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Repetition {
    /// By what is known of the SubDevice. Outputs: with SYNC signals before the next SYNC0; with a start-up command for
    /// 0x1C32:01 if that selects free run (0); without CoE always. Other SubDevices with CoE are taken for
    /// SM-synchronous: their outputs are sent once. Inputs: read again. With a SyncManager of one buffer: nothing.
    #[default]
    Automatic,
    /// Outputs and inputs: it runs free, or takes each write for the same value.
    Everything,
    /// Inputs: each write of outputs is an event for it (SM-synchronous).
    Inputs,
    /// Nothing is received again.
    Nothing,
}
