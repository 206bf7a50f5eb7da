//! What became of a frame that was handed to the acyclic half.

/// What became of a frame that was handed to [`Supervisor::receive`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A copy of a frame that is in flight.
    Taken,
    /// A frame that was given up, or a copy that was there already.
    Late,
    /// A frame of ours with other datagrams than were sent.
    Corrupt,
    /// A frame of the cyclic half.
    Cyclic,
    /// A frame of another MainDevice.
    Foreign,
    /// No EtherCAT frame.
    Other,
}
