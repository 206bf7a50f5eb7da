//! Counters of the cyclic half.

/// Counters of the cyclic half since activation. A frame is counted once, whatever number of copies it has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CyclicCounters {
    /// Frames sent.
    pub sent: u64,
    /// Bytes sent, one copy of each frame, without FCS.
    pub bytes: u64,
    /// Frames whose copies all came back.
    pub received: u64,
    /// Frames of which no copy came back in time: late, damaged or missing ([`CyclicCounters::missing`]), each counted
    /// as one of these.
    pub lost: u64,
    /// Of the lost frames, those of which a copy came later.
    pub lost_late: u64,
    /// Of the lost frames, those of which a damaged copy came.
    pub lost_damaged: u64,
    /// Frames of which one copy of two came back in time, and which were incomplete.
    pub half: u64,
    /// Frames that were complete without their second copy, which did not come before the frame left again.
    pub copies_lost: u64,
    /// Frames that came back after a newer one of their domain; the newer inputs were not overwritten.
    pub overtaken: u64,
    /// Copies that came too late or twice.
    pub late: u64,
    /// Frames of this MainDevice that came back with other datagrams than were sent.
    pub corrupt: u64,
    /// Frames of other MainDevices.
    pub foreign: u64,
    /// Frames that are not EtherCAT.
    pub other: u64,
    /// Domains that were due while all their cycles were still on the wire.
    pub skipped: u64,
    /// Incomplete cycles, summed over domains.
    pub incomplete: u64,
    /// Words that were not copied from inputs to outputs because their source was stale.
    pub stale_copies: u64,
    /// Frames that were sent again within their cycle, once for each further try; they also count as sent.
    pub sent_again: u64,
    /// Cycles, summed over domains, that are complete because a frame was sent again.
    pub saved: u64,
}

/// The counters, and how often any of them was changed that an undisturbed cycle leaves alone.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    pub counters: CyclicCounters,
    pub disturbances: u64,
}

impl Tally {
    /// The counters, to count a disturbance.
    #[cold]
    pub fn disturbed(&mut self) -> &mut CyclicCounters {
        self.disturbances += 1;
        &mut self.counters
    }
}

impl CyclicCounters {
    /// Of the lost frames, those that never came back.
    pub const fn missing(&self) -> u64 {
        self.lost.saturating_sub(self.lost_late).saturating_sub(self.lost_damaged)
    }
}

/// The counters and their order as words, listed once. A counter that is not in the list is a compile error.
macro_rules! as_words {
    ($($counter:ident),+) => {
        impl CyclicCounters {
            /// Number of counters.
            pub const COUNT: usize = [$(stringify!($counter)),+].len();

            /// All counters, to hand them to another thread one by one.
            pub const fn to_words(&self) -> [u64; CyclicCounters::COUNT] {
                [$(self.$counter),+]
            }

            /// The counters of [`CyclicCounters::to_words`].
            pub const fn from_words(words: [u64; CyclicCounters::COUNT]) -> CyclicCounters {
                let [$($counter),+] = words;
                CyclicCounters { $($counter),+ }
            }
        }
    };
}

as_words!(
    sent,
    bytes,
    received,
    lost,
    lost_late,
    lost_damaged,
    half,
    copies_lost,
    overtaken,
    late,
    corrupt,
    foreign,
    other,
    skipped,
    incomplete,
    stale_copies,
    sent_again,
    saved
);
