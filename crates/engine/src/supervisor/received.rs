//! Classification of a frame handed to the acyclic half.

/// Classification of a frame handed to `Supervisor::receive`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A copy of a frame that is in flight.
    Taken,
    /// A frame that was given up, or a duplicate copy.
    Late,
    /// A frame of this MainDevice with other datagrams than were sent.
    Corrupt,
    /// A frame of the cyclic half.
    Cyclic,
    /// A frame of another MainDevice.
    Foreign,
    /// Not an EtherCAT frame.
    Other,
}
