//! One SubDevice, as far as clocks are concerned.

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::PortKind;

use crate::clocks::Unknown;
use crate::config::{Passage, SubDeviceConfig};
use crate::info::SubDeviceInfo;
use crate::link::Link;

/// Depth of the mean of differences of clocks that receive the time that the host predicts.
const AVERAGE: u32 = 5;

/// A SubDevice of the scan, or a declared one that came later, as far as clocks are concerned.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its station address.
    pub station: StationAddress,
    /// Where it was found.
    pub position: u16,
    /// Kinds of its ports.
    pub ports: [PortKind; 4],
    /// Index in the declaration.
    pub member: Option<usize>,
    /// It has a clock.
    pub has_clock: bool,
    /// SYNC signals are declared for it.
    pub is_configured: bool,
    /// What is declared of passages through it.
    pub passage: Option<Passage>,
    /// From where frames come in to its processing unit, with fraction.
    pub unit: Option<i64>,
    /// That cannot be measured, since a fork without a clock hides it.
    pub hidden: Option<Unknown>,
    /// The fork, and whether an estimate was written, as reported for [`Node::hidden`].
    pub reported_hidden: Option<(Option<usize>, bool)>,
    /// Where that counts from: measurements and links number these places.
    pub origin: u32,
    /// DC_LATCH_MODE says that frames enter it from behind.
    pub latches_backwards: bool,
    /// Last written DC_FILTER_DIFFERENCE and DC_FILTER_SPEED.
    pub filter_depths: Option<[u8; 2]>,
    /// It has lost its offset and has not got another one since.
    pub is_unset: bool,
    /// Last written DC_SYSTEM_TIME_DELAY.
    pub delay_ns: i64,
    /// Last written DC_SYSTEM_TIME_OFFSET.
    pub offset_ns: i64,
    /// How much faster than the reference it would run by itself.
    pub drift_ppb: i64,
    /// DC_SYSTEM_TIME_DIFFERENCE of its last answer.
    pub difference_ns: Option<i32>,
    /// Where frames pass it before its reference: a mean of that, with [`AVERAGE`] fractional bits.
    pub average: Option<i64>,
    /// Largest magnitude of that since it was locked.
    pub worst_ns: u32,
    /// Samples in a row within the window.
    pub good: u32,
    /// The link of its last answer.
    pub link: Option<Link>,
}

impl Node {
    /// A SubDevice, and its index and declaration if it is declared.
    pub fn new(info: &SubDeviceInfo, member: Option<(usize, &SubDeviceConfig)>) -> Node {
        Node {
            station: info.station,
            position: info.position.0,
            ports: info.controller.ports,
            member: member.map(|(index, _)| index),
            has_clock: info.controller.features.dc,
            is_configured: member.is_some_and(|(_, config)| config.sync.is_some()),
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

    /// It has a clock with a known or estimated delay.
    pub const fn has_delay(&self) -> bool {
        self.has_clock && (self.unit.is_some() || self.hidden.is_none())
    }

    /// Adds a difference to the mean: differences of a clock that receives the time that the host predicts have the
    /// jitter of the host.
    pub fn average(&mut self, ahead_ns: i32) -> i32 {
        let before = self.average.unwrap_or(i64::from(ahead_ns) << AVERAGE);
        let now = before + i64::from(ahead_ns) - (before >> AVERAGE);
        self.average = Some(now);
        (now >> AVERAGE) as i32
    }
}
