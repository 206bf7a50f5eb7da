//! Observations of clocks.

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::string::String;

use ringcat_wire::address::StationAddress;

use crate::clocks::{Cables, KnownClocks, Latched, Measured, Wiring};
use crate::config::ReferenceClock;
use crate::link::Link;
#[cfg(feature = "standby")]
use crate::time::Instant;

/// An observation of clocks: measured, written, read or lost.
#[derive(Debug)]
pub enum ClockObservation<'a> {
    /// The application has chosen the reference.
    ReferenceChosen(ReferenceClock),
    /// The set-up of all clocks begins.
    SetUpBegun,
    /// The set-up failed, for this reason.
    SetUpFailed(String),
    /// The segment has changed: its delays may be wrong, and a set-up may succeed.
    SegmentChanged,
    /// DC_LATCH_MODE is about to be written; true if frames enter from behind.
    LatchModes(&'a [(StationAddress, bool)]),
    /// Cable times from latched receive times.
    Cables(Cables),
    /// The cables whose times are still unknown after the rings with them were opened; `None` if all are known.
    OpenedWithoutResult(Option<Wiring>),
    /// What another process knows of the clocks.
    Known(Rc<KnownClocks>),
    /// The segment is the one that was measured before: cable times and latch modes are those of that measurement.
    Recalled(&'a KnownClocks),
    /// The delays of all clocks, for their set-up.
    Measured(&'a Measured),
    /// Local times latched by one frame, and the system time that they are to show.
    Latched {
        /// Local times.
        latched: &'a LatchedTimes,
        /// System time of that frame where it entered the segment.
        wanted: u64,
    },
    /// Offsets and delays of all clocks are written.
    SetUp,
    /// Another MainDevice has set the clocks up: they go on as they are.
    #[cfg(feature = "standby")]
    Adopted(&'a AdoptedClocks<'a>),

    /// The delays of all clocks after a change of the segment.
    MeasuredAgain(&'a Measured),
    /// The delays of the clocks on a link are written.
    DelaysWritten(Link),
    /// They could not be written, for this reason.
    DelaysNotWritten(String),
    /// The measurement has ended and its delays are written, or the segment could not be measured for too long.
    MeasurementEnded {
        /// Why it could not be measured.
        failed: Option<String>,
        /// The number of stops of the distribution when it began.
        holds: u32,
    },
    /// A member goes on although the clocks were not locked in time.
    WentOnUnlocked {
        /// Its index in the declaration.
        member: usize,
        /// The clock that is not locked.
        reason: String,
    },
    /// Filter depths are written.
    FiltersWritten(&'a [(StationAddress, [u8; 2])]),

    /// A declared SubDevice with a clock that was not found by the scan.
    Came {
        /// Its index in the declaration.
        member: usize,
    },
    /// The registers of a clock do not hold the written values, or were never written.
    RegistersLost(StationAddress),
    /// Local times latched by one frame, for the set-up of one clock.
    LatchedFor {
        /// Its station address.
        station: StationAddress,
        /// Local times.
        latched: &'a LatchedTimes,
        /// System time according to the host, used without a reference.
        host: u64,
    },
    /// Offset and delay of that clock are written.
    OneSetUp(StationAddress),
    /// Clocks have to be synchronized with their reference.
    TimeWanted,
    /// The static drift compensation has ended.
    Compensated,

    /// The differences of all clocks.
    Answers {
        /// Clocks of which the answer was lost are left out.
        answers: &'a Answers,
        /// A ring has opened or closed, which explains changes of ports.
        is_explained: bool,
        /// The number of stops of the distribution when they were read.
        holds: u32,
    },
    /// The delays required by [`Due::Delays`](super::life::Due) are written, as far as possible.
    Followed {
        /// The number of stops of the distribution when the answers were read.
        holds: u32,
    },
    /// SYNC signals of a clock are being started, or are off.
    Signals {
        /// Its station address.
        station: StationAddress,
        /// They are being started.
        are_starting: bool,
    },
    /// The offsets that are due are written, except to these clocks.
    OffsetsWritten {
        /// Clocks that did not answer.
        missed: &'a [StationAddress],
    },
    /// The exchange has taken over a shift: it says how far all offsets are set back.
    SlideBegun,
    /// All offsets are about to be set back by this number of nanoseconds.
    SteppingBack(u64),
    /// They are written, except to these clocks.
    SteppedBack {
        /// Clocks that did not answer.
        missed: &'a [StationAddress],
    },
    /// DC_SYSTEM_TIME of the reference, and the host time at which the frame was sent.
    ReferenceTime {
        /// The lower half of the system time.
        low: u32,
        /// Host time in nanoseconds.
        sent_at: u64,
    },
}

/// Clocks that another MainDevice has set up.
#[cfg(feature = "standby")]
#[derive(Clone, Copy, Debug)]
pub struct AdoptedClocks<'a> {
    /// What that MainDevice knows of them.
    pub known: &'a KnownClocks,
    /// Their registers, as far as they answer.
    pub clocks: &'a [AdoptedClock],
    /// DC_SYSTEM_TIME of the reference.
    pub time: u64,
    /// When the frame left that has read it.
    pub sent_at: Instant,
}

/// Registers of a clock.
#[cfg(feature = "standby")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdoptedClock {
    /// Its station address.
    pub station: StationAddress,
    /// DC_SYSTEM_TIME_OFFSET.
    pub offset_ns: i64,
    /// DC_SYSTEM_TIME_DELAY.
    pub delay_ns: u32,
    /// DC_FILTER_DIFFERENCE and DC_FILTER_SPEED.
    pub filters: [u8; 2],
}

/// Local times latched by one frame.
pub type LatchedTimes = BTreeMap<StationAddress, Latched>;

/// Answers of clocks.
pub type Answers = BTreeMap<StationAddress, Answer>;

/// The answer of one clock, and the link on which it arrived.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answer {
    /// `None`: no answer.
    pub link: Option<Link>,
    /// Its time minus that of its reference.
    pub difference: Difference,
    /// Speed-up by its control loop.
    pub deviation_ppb: i64,
}

/// The time of a clock minus that of its reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Difference {
    /// Not read.
    #[default]
    Unknown,
    /// Value of DC_SYSTEM_TIME_DIFFERENCE.
    Own(i32),
    /// For a clock that frames pass before the reference: computed from one frame that read both.
    InFront(i32),
}
