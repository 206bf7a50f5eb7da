//! Process data domains: their numbers, and how they are judged.

/// Number of a domain, in the order of declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DomainId(pub usize);

/// Judgement of a domain's working counters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DomainState {
    /// No SubDevice answered, or no frame came back in time ([`DomainStatus::returned`]).
    #[default]
    Zero,
    /// Some answered, or one was met twice.
    Incomplete,
    /// All answered.
    Complete,
}

/// A domain after it was judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DomainStatus {
    /// Sum of the working counters of all datagrams and both copies, as really sent (LRW, or LWR and LRD).
    pub wkc: u32,
    /// The sum with all SubDevices.
    pub expected: u32,
    /// The judgement: every datagram by its own working counter; SubDevices declared optional may be missing.
    pub state: DomainState,
    /// Whether a frame of the judged cycle came back in time, whatever its working counters were.
    pub returned: bool,
    /// Frames are still out and not overdue: the other fields are those of the last judgement.
    pub pending: bool,
    /// How often the domain was due while its frames were still out.
    pub skipped: u64,
}

/// How old a SubDevice's inputs are. It put them into a frame itself: shared working counters are not trusted alone
/// (decision 0023).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freshness {
    /// They never came.
    Never,
    /// The SubDevice put them into a frame of the cycle that was judged last, or of a newer one.
    Fresh,
    /// They are this many cycles older than the last judgement.
    Stale {
        /// Cycles of the exchange.
        cycles: u64,
    },
}

impl DomainStatus {
    /// The judgement in words, as an operator is told.
    pub const fn in_words(&self) -> &'static str {
        match self.state {
            DomainState::Zero if self.returned => "no SubDevice answers",
            DomainState::Zero => "no frame came back in time",
            DomainState::Incomplete => "incomplete",
            DomainState::Complete => "complete",
        }
    }
}
