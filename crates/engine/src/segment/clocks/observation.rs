//! Observations of clocks.

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::string::String;

#[cfg(feature = "standby")]
use ringcat_wire::address::StationAddress;

use super::asked::{ClockKey, ClockVersions};
use crate::clocks::{Cables, KnownClocks, Latched, Measured, Wiring};
use crate::config::ReferenceClock;
use crate::link::Link;
#[cfg(feature = "standby")]
use crate::time::Instant;

/// An observation of clocks: an order, the beginning of something, or a finding.
///
/// All but findings are as they are at this moment, without a wait before: they are never outdated. An order or a
/// beginning that concerns one clock is refused if that has lost its registers since the procedure began.
#[derive(Debug)]
pub enum ClockObservation<'a> {
    /// A finding, with the version of the clocks when it was asked for.
    Found(ClockVersions, ClockFinding<'a>),

    /// The application has chosen the reference.
    ReferenceChosen(ReferenceClock),
    /// Knowledge of another process about the clocks.
    Known(Rc<KnownClocks>),
    /// The set-up of all clocks begins.
    SetUpBegun,
    /// The segment has changed: its delays may be wrong, and a set-up may succeed.
    SegmentChanged,
    /// A declared SubDevice with a clock that was not found by the scan.
    Came {
        /// Its index in the declaration.
        member: usize,
    },
    /// Clocks have to be synchronized with their reference.
    TimeWanted,

    /// DC_LATCH_MODE is about to be written; true if frames enter from behind.
    LatchModes(&'a [(ClockKey, bool)]),
    /// SYNC signals of a clock are being started, or are off.
    Signals {
        /// The clock.
        key: ClockKey,
        /// The signals are being started; otherwise they are off.
        are_starting: bool,
    },
    /// The exchange has taken over a shift: it reports how far all offsets are set back.
    SlideBegun,
    /// All offsets are about to be set back by this number of nanoseconds.
    SteppingBack(u64),
}

/// A finding of clocks: measured, written or read values, or that this failed. Findings that were asked for before
/// another set-up of all clocks are refused; what else refuses each is in the rules (`segment::rules::clocks`).
#[derive(Debug)]
pub enum ClockFinding<'a> {
    /// The set-up failed, for this reason.
    SetUpFailed(String),
    /// Cable times from latched receive times.
    Cables(Cables),
    /// The cables whose times are still unknown after the rings with them were opened; `None` if all are known. It is
    /// compared with the cables of the next measurement.
    OpenedWithoutResult(Option<Wiring>),
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
    /// The delays could not be written; the reason.
    DelaysNotWritten(String),
    /// The measurement has ended and its delays are written, or the segment could not be measured for too long.
    MeasurementEnded {
        /// Why it could not be measured.
        failed: Option<String>,
    },
    /// Filter depths are written.
    FiltersWritten(&'a [(ClockKey, [u8; 2])]),

    /// The clocks were not locked when a member needed them.
    NotLocked {
        /// Its index in the declaration.
        member: usize,
        /// Its attempt.
        attempt: u32,
        /// The clock that is not locked, and why.
        reason: String,
        /// The delay of its clock is unknown.
        is_hidden: bool,
    },
    /// DC_SYSTEM_TIME_OFFSET of a clock whose SubDevice is configured.
    OffsetRead {
        /// The clock.
        key: ClockKey,
        /// Its offset when that was asked for.
        written_ns: i64,
        /// The lower half of the register.
        read: u32,
    },
    /// Local times latched by one frame, for the set-up of one clock.
    LatchedFor {
        /// The clock.
        key: ClockKey,
        /// Local times.
        latched: &'a LatchedTimes,
        /// System time according to the host, used without a reference.
        host: u64,
    },
    /// Offset and delay of that clock are written.
    OneSetUp(ClockKey),
    /// The static drift compensation has ended.
    Compensated,

    /// The differences of all clocks.
    Answers {
        /// Clocks of which the answer was lost are left out.
        answers: &'a Answers,
        /// A ring has opened or closed, which explains changes of ports.
        is_explained: bool,
    },
    /// The delays required by [`Due::Delays`](super::life::Due) are written, as far as possible. The version is that
    /// of the answers.
    Followed,
    /// The offsets that are due are written, except to these clocks.
    OffsetsWritten {
        /// Clocks that did not answer.
        missed: &'a [ClockKey],
    },
    /// The offsets of a step back are written, except to these clocks.
    SteppedBack {
        /// Clocks that did not answer.
        missed: &'a [ClockKey],
    },
    /// DC_SYSTEM_TIME of the reference, and the host time at which the frame was sent.
    ReferenceTime {
        /// The reference.
        key: ClockKey,
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
    /// Knowledge of that MainDevice about them.
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
pub type LatchedTimes = BTreeMap<ClockKey, Latched>;

/// Answers of clocks.
pub type Answers = BTreeMap<ClockKey, Answer>;

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
