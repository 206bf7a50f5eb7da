//! Clock data of one SubDevice.

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::PortKind;

use super::asked::ClockKey;
use crate::clocks::Unknown;
use crate::clocks::start::whole_cycle;
use crate::config::{Passage, SubDeviceConfig, SyncSignals};
use crate::info::SubDeviceInfo;
use crate::link::Link;

/// Depth of the mean of differences, for clocks that receive the time predicted by the host.
const AVERAGE: u32 = 5;

/// Clock data of a SubDevice of the scan, or of a declared one that was added later.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its station address.
    pub station: StationAddress,
    /// How often it has lost its registers.
    pub losses: u32,
    /// Its position when it was found.
    pub position: u16,
    /// Kinds of its ports.
    pub ports: [PortKind; 4],
    /// Index in the declaration.
    pub member: Option<usize>,
    /// It has a clock.
    pub has_clock: bool,
    /// SYNC signals are declared for it.
    pub is_configured: bool,
    /// Time after which its SYNC signals repeat, in nanoseconds; 0 without.
    pub pattern_ns: u64,
    /// Its SYNC signals are being started, or run.
    pub has_signals: bool,
    /// Its offset was changed while it did not answer.
    pub missed_offset: bool,
    /// Its declared passage times.
    pub passage: Option<Passage>,
    /// Delay from the entry of frames into the segment to its processing unit, with fraction.
    pub unit: Option<i64>,
    /// Why this delay cannot be measured: a fork without a clock hides it.
    pub hidden: Option<Unknown>,
    /// The fork, and whether an estimate was written, as reported for [`Node::hidden`].
    pub reported_hidden: Option<(Option<usize>, bool)>,
    /// Number of the origin of that delay, by measurement and link.
    pub origin: u32,
    /// DC_LATCH_MODE is set for frames that enter from behind.
    pub latches_backwards: bool,
    /// Last written DC_FILTER_DIFFERENCE and DC_FILTER_SPEED.
    pub filter_depths: Option<[u8; 2]>,
    /// Its offset was lost and not written since.
    pub is_unset: bool,
    /// Last written DC_SYSTEM_TIME_DELAY.
    pub delay_ns: i64,
    /// Last written DC_SYSTEM_TIME_OFFSET.
    pub offset_ns: i64,
    /// Drift against the reference without its control loop.
    pub drift_ppb: i64,
    /// DC_SYSTEM_TIME_DIFFERENCE of its last answer.
    pub difference_ns: Option<i32>,
    /// For a clock that frames pass before its reference: mean of the difference, with [`AVERAGE`] fractional bits.
    pub average: Option<i64>,
    /// Largest magnitude of the difference since it was locked.
    pub worst_ns: u32,
    /// Consecutive samples within the window.
    pub good: u32,
    /// The link of its last answer.
    pub link: Option<Link>,
}

/// Time after which SYNC0 and SYNC1 repeat together, in nanoseconds.
const fn pattern_ns(signals: &SyncSignals) -> u64 {
    whole_cycle(signals.sync0_cycle_ns, signals.active_sync1_ns())
}

impl Node {
    /// A SubDevice, and its index and declaration if it is declared.
    pub fn new(info: &SubDeviceInfo, member: Option<(usize, &SubDeviceConfig)>) -> Node {
        Node {
            station: info.station,
            losses: 0,
            position: info.position.0,
            ports: info.controller.ports,
            member: member.map(|(index, _)| index),
            has_clock: info.controller.features.dc,
            is_configured: member.is_some_and(|(_, config)| config.sync.is_some()),
            pattern_ns: member.and_then(|(_, config)| config.sync).map_or(0, |signals| pattern_ns(&signals)),
            has_signals: false,
            missed_offset: false,
            passage: member.and_then(|(_, config)| config.passage),
            unit: None,
            hidden: None,
            reported_hidden: None,
            origin: 0,
            latches_backwards: false,
            filter_depths: None,
            is_unset: false,
            delay_ns: 0,
            offset_ns: 0,
            drift_ppb: 0,
            difference_ns: None,
            average: None,
            worst_ns: 0,
            good: 0,
            link: None,
        }
    }

    /// Its key, for a procedure that starts now.
    pub const fn key(&self) -> ClockKey {
        ClockKey { station: self.station, losses: self.losses }
    }

    /// It has a clock with a known or estimated delay.
    pub const fn has_delay(&self) -> bool {
        self.has_clock && (self.unit.is_some() || self.hidden.is_none())
    }

    /// Adds a difference to the mean: differences of a clock that receives the time predicted by the host contain the
    /// jitter of the host.
    pub fn average(&mut self, ahead_ns: i32) -> i32 {
        let before = self.average.unwrap_or(i64::from(ahead_ns) << AVERAGE);
        let now = before + i64::from(ahead_ns) - (before >> AVERAGE);
        self.average = Some(now);
        (now >> AVERAGE) as i32
    }
}
