//! What a try of a frame proves about a SubDevice in a datagram.

/// Outputs taken, inputs delivered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Proved {
    wrote: bool,
    read: bool,
}

impl Proved {
    /// What the full increment of a working counter proves.
    pub const fn new(wrote: bool, read: bool) -> Proved {
        Proved { wrote, read }
    }

    /// Adds what another try proves.
    pub fn add(&mut self, other: Proved) {
        self.wrote |= other.wrote;
        self.read |= other.read;
    }

    /// Whether it contains all that is needed.
    pub const fn holds(self, needed: Proved) -> bool {
        (self.wrote || !needed.wrote) && (self.read || !needed.read)
    }
}
