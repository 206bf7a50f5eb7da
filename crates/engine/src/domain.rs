//! Process data domains: numbers, and the states that follow from working counters.

use core::fmt;

/// Number of a domain, in the order of declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DomainId(pub usize);

impl fmt::Display for DomainId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// State of a domain by its working counters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DomainState {
    /// No SubDevice processed a frame, or no frame came back in time ([`DomainStatus::returned`]).
    #[default]
    Zero,
    /// Some SubDevices did not process the frames, or one processed a frame twice.
    Incomplete,
    /// All SubDevices processed the frames.
    Complete,
}

/// Result of a domain's last evaluated cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DomainStatus {
    /// Sum of the working counters of all datagrams and both copies, for the commands in use (LRW, or LWR and LRD).
    pub wkc: u32,
    /// The sum if all SubDevices process the frames.
    pub expected: u32,
    /// The state: every datagram is evaluated by its own working counter; optional SubDevices may be missing.
    pub state: DomainState,
    /// Whether a frame of the evaluated cycle came back in time, whatever its working counters.
    pub returned: bool,
    /// Frames are on the wire and not overdue: the other fields are those of the last evaluated cycle.
    pub pending: bool,
    /// How often the domain was due while its frames were on the wire.
    pub skipped: u64,
}

/// Age of a SubDevice's inputs. Evidence is that the SubDevice itself wrote them into a frame: a working counter that
/// several SubDevices share is not enough (decision 0023).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freshness {
    /// No inputs were received yet.
    Never,
    /// The SubDevice wrote them into a frame of the last evaluated cycle, or of a later one.
    Fresh,
    /// They are older than the last evaluated cycle by this number of cycles.
    Stale {
        /// Cycles of the exchange.
        cycles: u64,
    },
}

impl DomainStatus {
    /// The state in words, for an operator.
    pub const fn in_words(&self) -> &'static str {
        match self.state {
            DomainState::Zero if self.returned => "no SubDevice answers",
            DomainState::Zero => "no frame came back in time",
            DomainState::Incomplete => "incomplete",
            DomainState::Complete => "complete",
        }
    }
}
