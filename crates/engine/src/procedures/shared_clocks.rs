//! What is known about the clocks of a segment.

use alloc::rc::Rc;
use alloc::string::String;
use alloc::vec::Vec;
use core::cell::{RefCell, RefMut};
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::PortKind;

use crate::clocks::cable_ends::End;
use crate::clocks::{Cables, SyncWindow, Unknown, Wiring, branches, round};
use crate::config::{ClockConfig, Passage, ReferenceClock, SubDeviceConfig};
use crate::info::SubDeviceInfo;
use crate::link::Link;
use crate::supervisor::Bus;
use crate::time::Instant;
use crate::topology::{PortOf, Topology};

/// Pause between two looks whether branches are in reach.
const PAUSE: Duration = Duration::from_millis(1);
/// Depth of the mean of differences of clocks that are told what the host believes.
const AVERAGE: u32 = 5;

/// A SubDevice of the scan, or a declared one that came later, as far as clocks are concerned.
#[derive(Clone, Debug)]
pub(crate) struct Node {
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
    /// Where that counts from: measurements and links number these places.
    pub origin: u32,
    /// DC_LATCH_MODE says that frames enter it from behind.
    pub latches_backwards: bool,
    /// What was written to DC_FILTER_DIFFERENCE and DC_FILTER_SPEED.
    pub filter_depths: Option<[u8; 2]>,
    /// It has lost its offset and has not got one since.
    pub is_unset: bool,
    /// What was written to DC_SYSTEM_TIME_DELAY.
    pub delay_ns: i64,
    /// What was written to DC_SYSTEM_TIME_OFFSET.
    pub offset_ns: i64,
    /// How much faster than the reference it would run by itself.
    pub drift_ppb: i64,
    /// DC_SYSTEM_TIME_DIFFERENCE, when it answered last.
    pub difference_ns: Option<i32>,
    /// Where frames meet it before its reference: a mean of that, with [`AVERAGE`] fractional bits.
    pub average: Option<i64>,
    /// Largest magnitude of that since it was locked.
    pub worst_ns: u32,
    /// Samples in a row within the window.
    pub good: u32,
    /// On which link it answered last.
    pub link: Option<Link>,
}

/// What is known about the clocks of a segment.
#[derive(Debug, Default)]
pub(crate) struct Clocks {
    /// `None`: distributed clocks were not declared.
    pub config: Option<ClockConfig>,
    /// By position of the scan, then those that came later.
    pub nodes: Vec<Node>,
    /// Which of them is the reference.
    pub reference: Option<usize>,
    /// Both ends of the closing cables of local rings.
    pub closings: Vec<[End; 2]>,
    /// What was measured of cables.
    pub cables: Cables,
    /// Measurements so far.
    pub measured: u32,
    /// On which links SubDevices answered at the last look, by index, where these are others than before.
    pub moving: Option<Vec<Option<Option<Link>>>>,
    /// Since when delays may not be what they were.
    pub is_doubtful: Option<Instant>,
    /// Delays and offsets are written.
    pub is_set_up: bool,
    /// Why that failed, as it was told.
    pub trouble: Option<String>,
    /// Rings were opened on these cables, and which of them takes how long is not known all the same.
    pub in_vain: Option<Wiring>,
    /// Branches of forks without a clock may be left out: SubDevices there do not answer.
    pub leaves_out: bool,
    /// The static drift phase runs: what differences show then does not hold for the pace of cycles.
    pub is_drifting: bool,
    /// All clocks were within the window for long enough.
    pub is_locked: bool,
    /// While some are told what the host believes: whether differences have left their window.
    pub window: SyncWindow,
    /// System time when host time is zero, as the reference clock has it.
    pub epoch: u64,
}

/// Shared by the procedures of one MainDevice.
#[derive(Clone, Debug, Default)]
pub struct SharedClocks {
    clocks: Rc<RefCell<Clocks>>,
}

/// What is known about the clock of one SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockStatus {
    /// Position in the scan, or where it was found later.
    pub position: u16,
    /// Its station address.
    pub station: StationAddress,
    /// Index in the declaration.
    pub subdevice: Option<usize>,
    /// It is the reference of the segment.
    pub is_reference: bool,
    /// Nanoseconds from the reference of its part of the segment (0x0928).
    pub delay_ns: i64,
    /// That cannot be measured where it is, and why.
    pub hidden: Option<HiddenDelay>,
    /// System time less local time when it was set up (0x0920).
    pub offset_ns: i64,
    /// How much faster than the reference it would run by itself, in parts per billion: as it ran within the
    /// milliseconds of the first measurement, to some tens of thousands; once it was locked, what its control loop
    /// makes up for (0x0932).
    pub drift_ppb: i64,
    /// Its time less that of the reference in nanoseconds (0x092C); `None` before it was read.
    pub difference_ns: Option<i32>,
    /// Largest magnitude of that since it was locked.
    pub worst_ns: u32,
    /// It was within the window for as many samples as configured.
    pub is_locked: bool,
}

/// Why the delay of a SubDevice is not known (protocol 7.1): it is behind a fork without a clock, and what was latched
/// shows only what the branches of that take together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HiddenDelay {
    /// Position of the fork; `None` where it is not known what is between this SubDevice and the reference.
    pub fork: Option<Position>,
    /// The least and the most that it may be away from the reference, in nanoseconds; `None` where nothing is known.
    pub range_ns: Option<(i64, i64)>,
    /// The middle of that was written ([`ClockConfig::estimated_delays`]); otherwise no delay was.
    pub is_estimated: bool,
}

impl SharedClocks {
    /// Clocks of a scan, and what is declared of whom: index in the declaration, and what it says.
    pub fn new<'a>(
        config: Option<ClockConfig>,
        scanned: &[SubDeviceInfo],
        topology: &Topology,
        members: impl Fn(&SubDeviceInfo) -> Option<(usize, &'a SubDeviceConfig)>,
    ) -> SharedClocks {
        let node = |info: &SubDeviceInfo| {
            let member = members(info);
            Node::new(info, member)
        };
        let epoch = config.as_ref().map_or(0, |config| config.epoch);
        let nodes: Vec<Node> = scanned.iter().map(node).collect();
        let end = |at: PortOf| Some((nodes.get(at.node)?.station, at.port));
        let rings = topology.local_rings.iter().map(|ring| ring.closing);
        let closings = rings.filter_map(|closing| Some([end(closing.head)?, end(closing.tail)?])).collect();
        let has_clock: Vec<bool> = nodes.iter().map(|node| node.has_clock).collect();
        let leaves_out = config.is_some() && branches::are_hidden(topology, &has_clock);
        let clocks = Clocks { config, nodes, epoch, closings, leaves_out, ..Clocks::default() };
        SharedClocks { clocks: Rc::new(RefCell::new(clocks)) }
    }

    pub(super) fn access(&self) -> RefMut<'_, Clocks> {
        self.clocks.borrow_mut()
    }

    /// Whether distributed clocks were declared.
    pub(crate) fn are_declared(&self) -> bool {
        self.access().config.is_some()
    }

    /// Returns when no SubDevices are out of reach for being measured, at once where none have to be.
    pub(crate) async fn all_in_reach(&self, bus: &Bus) {
        while self.access().leaves_out {
            bus.sleep(PAUSE).await;
        }
    }

    /// Whether all clocks are locked.
    pub fn are_locked(&self) -> bool {
        self.access().is_locked
    }

    /// Each clock of the segment, by position of the scan; then those that came later.
    pub fn status(&self) -> Vec<ClockStatus> {
        let clocks = self.access();
        let samples = clocks.config.as_ref().map_or(u32::MAX, |config| config.lock_samples);
        let with_clock = clocks.nodes.iter().enumerate().filter(|(_, node)| node.has_clock);
        let status = |(index, node): (usize, &Node)| ClockStatus {
            position: node.position,
            station: node.station,
            subdevice: node.member,
            is_reference: clocks.reference == Some(index),
            delay_ns: node.delay_ns,
            hidden: clocks.hidden(index),
            offset_ns: node.offset_ns,
            drift_ppb: node.drift_ppb,
            difference_ns: node.difference_ns,
            worst_ns: node.worst_ns,
            is_locked: node.good >= samples,
        };
        with_clock.map(status).collect()
    }
}

impl Node {
    /// What a scan or somebody who came later is, and which member: its index, and what is declared.
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
}

impl Node {
    /// It has a clock, and it is known how far away that is, or that was estimated.
    pub(super) const fn has_delay(&self) -> bool {
        self.has_clock && (self.unit.is_some() || self.hidden.is_none())
    }

    /// The mean of differences with one more of them: those of a clock that is told what the host believes have its
    /// jitter.
    pub fn average(&mut self, ahead_ns: i32) -> i32 {
        let before = self.average.unwrap_or(i64::from(ahead_ns) << AVERAGE);
        let now = before + i64::from(ahead_ns) - (before >> AVERAGE);
        self.average = Some(now);
        (now >> AVERAGE) as i32
    }
}

impl Clocks {
    /// Of all clocks, why their delays are not known.
    pub fn all_hidden(&self) -> Vec<Option<HiddenDelay>> {
        (0..self.nodes.len()).map(|index| self.hidden(index)).collect()
    }

    /// Why the delay of a clock is not known.
    pub fn hidden(&self, index: usize) -> Option<HiddenDelay> {
        let node = &self.nodes[index];
        let hidden = node.hidden?;
        let reference = self.reference_on(node.link.unwrap_or(Link::Main)).and_then(|index| self.nodes[index].unit);
        let range = hidden.range.zip(reference);
        Some(HiddenDelay {
            fork: hidden.fork.map(|fork| Position(fork as u16)),
            range_ns: range.map(|((least, most), reference)| (round(least - reference), round(most - reference))),
            is_estimated: node.unit.is_some(),
        })
    }

    /// Whether frames meet a clock before the reference of its link.
    pub fn is_in_front(&self, index: usize, reference: usize) -> bool {
        let (node, reference) = (&self.nodes[index], &self.nodes[reference]);
        node.has_clock
            && !node.is_unset
            && node.link == reference.link
            && node.unit.is_some()
            && node.unit < reference.unit
    }

    /// The reference among those that `can` be it: the chosen one, or the first as the configuration wants it.
    pub fn elect(&self, can: impl Fn(usize, &Node) -> bool) -> Option<usize> {
        let choice = self.config.as_ref()?.reference;
        let able = |(position, node): &(usize, &Node)| node.has_clock && !node.is_unset && can(*position, node);
        let candidates = || self.nodes.iter().enumerate().filter(able).map(|(position, _)| position);
        let preferred = match choice {
            ReferenceClock::FirstWithClock => None,
            ReferenceClock::FirstConfigured => candidates().find(|position| self.nodes[*position].is_configured),
            ReferenceClock::Declared(index) => {
                candidates().find(|position| self.nodes[*position].member == Some(index))
            }
        };
        preferred.or_else(|| candidates().next())
    }

    /// Position of a declared SubDevice.
    pub fn position_of(&self, member: usize) -> Option<usize> {
        self.nodes.iter().position(|node| node.member == Some(member))
    }
}
