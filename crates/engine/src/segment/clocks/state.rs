//! All clocks of a segment.

use alloc::vec::Vec;
use core::borrow::Borrow;

use ringcat_wire::address::{Position, StationAddress};

use super::asked::{ClockChanges, ClockKey};
use super::life::{Compensation, Delays, Due, Life, Lock, Running, Unwritten};
use super::node::Node;
use super::status::{ClockStatus, HiddenDelay};
use super::timeline::{Times, common_pattern};
use crate::board::clocks::References;
use crate::clocks::DelayRange;
use crate::clocks::{Cables, FRACTION, KnownClocks, Measured, Passage, Wiring, branches, round};
use crate::config::{ClockConfig, ReferenceClock, SubDeviceConfig, WhenUnlocked};
use crate::declared::SubDeviceId;
use crate::info::SubDeviceInfo;
use crate::link::Link;
use crate::time::Instant;
use crate::topology::Topology;

/// DC_FILTER_DIFFERENCE of clocks behind their reference: the received time is exact, and a mean that lags behind the
/// samples makes the loop oscillate at large drift.
const EXACT_DEPTH: u8 = 0;
/// For clocks that receive the time predicted by the host: its reset value, which removes most of the host's jitter.
const HOST_DEPTH: u8 = 4;
/// DC_FILTER_SPEED: its reset value.
const SPEED_DEPTH: u8 = 12;
/// For a reference that is steered: the host's jitter must not change its speed.
const STEADY_DEPTH: u8 = 15;

/// All clocks of a segment.
#[derive(Debug)]
pub struct Clocks {
    /// The declaration.
    pub config: ClockConfig,
    /// Phase of the clocks.
    pub(in crate::segment) life: Life,
    /// Changes so far.
    pub(in crate::segment) changes: ClockChanges,
    /// Clocks by position of the scan, then clocks that came later.
    pub nodes: Vec<Node>,
    /// The reference.
    pub reference: Option<StationAddress>,
    /// Measured cable times.
    pub cables: Cables,
    /// Measurements so far.
    pub(in crate::segment) measured: u32,
    /// The last measurement.
    pub(in crate::segment) last: Option<Measured>,
    /// Rings with these cables were opened, and the cable times are still unknown.
    pub opened_without_result: Option<Wiring>,
    /// System time of the reference clock at host time zero.
    pub epoch: u64,
    /// The application's time.
    pub(in crate::segment) times: Times,
}

impl Clocks {
    /// No clocks, or those of a scan, if clocks are declared: `members` contains index and declaration of each
    /// SubDevice.
    pub fn new<'a>(
        config: Option<ClockConfig>,
        scanned: &[impl Borrow<SubDeviceInfo>],
        topology: &Topology,
        members: impl Fn(&SubDeviceInfo) -> Option<(usize, &'a SubDeviceConfig)>,
    ) -> Clocks {
        let node = |info: &SubDeviceInfo| Node::new(info, members(info));
        let scanned = scanned.iter().map(Borrow::borrow).filter(|_| config.is_some());
        let nodes: Vec<Node> = scanned.map(node).collect();
        let has_clock: Vec<bool> = nodes.iter().map(|node| node.has_clock).collect();
        let life = match &config {
            None => Life::Undeclared,
            Some(_) if branches::are_hidden(topology, &has_clock) => Life::StartingWithoutBranches,
            Some(_) => Life::Starting,
        };
        let config = config.unwrap_or_default();
        let epoch = config.epoch;
        let (reference, cables, measured, opened_without_result) = (None, Cables::default(), 0, None);
        Clocks {
            config,
            life,
            changes: ClockChanges::default(),
            nodes,
            reference,
            cables,
            measured,
            last: None,
            opened_without_result,
            epoch,
            times: Times::default(),
        }
    }

    /// No clocks.
    pub fn undeclared() -> Clocks {
        let scanned: [SubDeviceInfo; 0] = [];
        Clocks::new(None, &scanned, &Topology::default(), |_| None)
    }

    /// Whether distributed clocks are declared.
    pub fn are_declared(&self) -> bool {
        !matches!(self.life, Life::Undeclared)
    }

    /// Whether branches may be closed for the first set-up.
    pub fn are_branches_closed(&self) -> bool {
        matches!(self.life, Life::StartingWithoutBranches)
    }

    /// Whether delays and offsets are written.
    pub fn are_set_up(&self) -> bool {
        self.running().is_some()
    }

    /// Whether all required clocks have reached the window.
    pub fn are_locked(&self) -> bool {
        self.running().is_some_and(|running| matches!(running.lock, Lock::Locked(_)))
    }

    /// Time since which the delays may be wrong.
    pub fn doubtful_since(&self) -> Option<Instant> {
        match self.running()?.delays {
            Delays::Valid => None,
            Delays::Doubtful(since) => Some(since),
        }
    }

    /// Whether the next answers must confirm the last ones.
    pub fn are_links_unconfirmed(&self) -> bool {
        self.running().is_some_and(|running| running.unconfirmed.is_some())
    }

    /// The links with known delays that are not yet written.
    pub fn unwritten(&self) -> Vec<Link> {
        let links = self.running().map_or([false; 2], |running| running.unwritten.links);
        Link::ALL.into_iter().filter(|link| links[link.index()]).collect()
    }

    /// Number of SubDevices that were measured last.
    pub fn measured_count(&self) -> Option<usize> {
        self.last.as_ref().map(|measured| measured.stations.len())
    }

    /// What is known for the next set-up, if the last measurement is that of the segment.
    pub(in crate::segment) fn known(&self) -> Option<KnownClocks> {
        let Running { delays: Delays::Valid, unwritten, .. } = self.running()? else { return None };
        let mut measured = self.last.clone().filter(|_| *unwritten == Unwritten::default())?;
        for (station, drift_ppb) in measured.stations.iter().zip(&mut measured.drift_ppb) {
            *drift_ppb = self.node_at(*station).filter(|node| node.has_clock).map(|node| node.drift_ppb);
        }
        let backwards = self.nodes.iter().filter(|node| node.latches_backwards).map(|node| node.station);
        Some(KnownClocks { measured, cables: self.cables.known(), backwards: backwards.collect() })
    }

    /// The registers to write next.
    pub fn due(&self) -> Due {
        self.running().map_or(Due::Nothing, |running| running.due)
    }

    pub(in crate::segment) fn running(&self) -> Option<&Running> {
        if let Life::Running(running) = &self.life { Some(running) } else { None }
    }

    pub(in crate::segment) fn running_mut(&mut self) -> Option<&mut Running> {
        if let Life::Running(running) = &mut self.life { Some(running) } else { None }
    }

    /// The static drift compensation has ended.
    pub(in crate::segment) fn end_compensation(&mut self) {
        if let Some(running) = self.running_mut() {
            running.compensation = Compensation::Idle;
        }
    }

    pub(in crate::segment) fn is_compensating(&self) -> bool {
        self.running().is_some_and(|running| running.compensation == Compensation::Running)
    }

    /// Whether any SubDevice has a clock.
    pub fn is_any(&self) -> bool {
        self.nodes.iter().any(|node| node.has_clock)
    }

    /// Whether a required clock is outside its window, or has been inside for too short a time.
    pub fn is_any_outside(&self) -> bool {
        let samples = self.config.lock_samples;
        self.nodes.iter().any(|node| self.is_waited_for(node) && node.good < samples)
    }

    /// Whether OP requires that the clock is locked: it has SYNC signals or follows the reference. A clock without SYNC
    /// signals upstream of the reference receives the host's estimate of the time: it never locks if the host sends
    /// hundreds of microseconds late, and its time controls nothing.
    pub fn is_required(&self, node: &Node) -> bool {
        node.has_clock && (node.is_configured || !self.is_in_front(node))
    }

    /// Whether the clock is required and its SubDevice answers: no SubDevice waits for the clock of an absent one.
    pub fn is_waited_for(&self, node: &Node) -> bool {
        self.is_required(node) && node.link.is_some()
    }

    /// Whether all offsets are being changed.
    pub fn are_offsets_due(&self) -> bool {
        self.due() == Due::Offsets
    }

    /// Whether readings of the reference are necessary, because the application's time is far from its time or was.
    pub fn is_time_pending(&self) -> bool {
        self.times.is_pending() || self.are_offsets_due() || self.times.is_sliding()
    }

    /// Whether all offsets are still to be set back in steps.
    pub fn is_slide_left(&self) -> bool {
        self.are_set_up() && self.times.left_ns() > 0
    }

    /// The next of these steps, this long after the last one; 0 while the paths of frames are doubtful.
    pub fn next_step_ns(&self, passed_ns: u64) -> u64 {
        let is_calm = self.running().is_some_and(|running| {
            running.delays == Delays::Valid && running.unwritten == Unwritten::default() && running.due == Due::Nothing
        });
        if is_calm { self.times.step_ns(passed_ns) } else { 0 }
    }

    /// Application time minus system time.
    pub fn shift(&self) -> u64 {
        self.times.timeline.shift
    }

    /// Offsets of the clocks that answer.
    pub fn offsets(&self) -> Vec<(ClockKey, i64)> {
        let answering = self.nodes.iter().filter(|node| node.has_clock && node.link.is_some());
        answering.map(|node| (node.key(), node.offset_ns)).collect()
    }

    /// Clocks that answer again, and whose offsets were changed meanwhile.
    pub fn without_offset(&self) -> Vec<StationAddress> {
        let lacking = self.nodes.iter().filter(|node| node.missed_offset && node.has_clock && node.link.is_some());
        lacking.map(|node| node.station).collect()
    }

    /// Clocks that are read next, and the offset of those that answer again, or after a change: they may have lost
    /// their registers.
    pub fn to_read(&self) -> Vec<(ClockKey, Option<i64>)> {
        let is_in_doubt = |node: &Node| {
            let is_set = node.unit.is_some() && !node.is_unset && !node.missed_offset;
            is_set && (node.link.is_none() || self.doubtful_since().is_some())
        };
        let with_clock = self.nodes.iter().filter(|node| node.has_clock);
        with_clock.map(|node| (node.key(), is_in_doubt(node).then_some(node.offset_ns))).collect()
    }

    /// The common pattern of the SYNC signals that run; `None` without any. A declared pattern counts also if it does
    /// not run yet.
    pub(in crate::segment) fn running_pattern(&self) -> Option<u64> {
        let runs = |node: &Node| node.has_signals && node.pattern_ns > 0 && node.link.is_some();
        let patterns = self.nodes.iter().map(|node| node.pattern_ns).filter(|pattern| *pattern > 0);
        self.nodes.iter().any(runs).then(|| common_pattern(patterns))
    }

    /// Each clock of the segment, by position of the scan; then later ones.
    pub fn status(&self) -> Vec<ClockStatus> {
        let with_clock = self.nodes.iter().filter(|node| node.has_clock);
        let status = |node: &Node| ClockStatus {
            position: Position(node.position),
            station: node.station,
            subdevice: node.member.map(SubDeviceId),
            is_reference: self.is_reference(node),
            delay_ns: node.delay_ns,
            hidden: self.hidden(node),
            offset_ns: node.offset_ns,
            drift_ppb: node.drift_ppb,
            difference_ns: node.difference_ns,
            worst_ns: node.worst_ns,
            is_locked: node.good >= self.config.lock_samples,
            is_required: self.is_required(node),
        };
        with_clock.map(status).collect()
    }

    /// Why the delay of a clock is not known.
    pub fn hidden(&self, node: &Node) -> Option<HiddenDelay> {
        let hidden = node.hidden?;
        let reference = self.reference_on(node.link.unwrap_or(Link::Main)).and_then(|reference| reference.unit);
        let range = hidden.range.zip(reference);
        Some(HiddenDelay {
            fork: hidden.fork.map(|fork| Position(fork as u16)),
            range: range.map(|((least, most), reference)| DelayRange {
                least_ns: round(least - reference),
                most_ns: round(most - reference),
            }),
            is_estimated: node.unit.is_some(),
        })
    }

    /// Elects the reference among the nodes with `can`: the configured one, or the first that the configuration allows.
    pub fn elect(&self, can: impl Fn(&Node) -> bool) -> Option<StationAddress> {
        let able = |node: &&Node| node.has_clock && !node.is_unset && can(node);
        let candidates = || self.nodes.iter().filter(able);
        let preferred = match self.config.reference {
            ReferenceClock::FirstWithClock => None,
            ReferenceClock::FirstConfigured => candidates().find(|node| node.is_configured),
            ReferenceClock::Declared(SubDeviceId(member)) => candidates().find(|node| node.member == Some(member)),
        };
        preferred.or_else(|| candidates().next()).map(|node| node.station)
    }

    /// Makes a clock the reference, or none. If not all clocks were locked, they are not near each other: samples
    /// against another reference are not valid for this one.
    pub(in crate::segment) fn refer_to(&mut self, reference: Option<StationAddress>) {
        let is_other = core::mem::replace(&mut self.reference, reference) != reference;
        if is_other && self.is_any_outside() {
            self.nodes.iter_mut().for_each(|node| (node.good, node.difference_ns, node.average) = (0, None, None));
        }
        self.changes.delays = self.changes.delays.wrapping_add(u32::from(is_other));
    }

    /// Whether it is the reference of the segment.
    pub fn is_reference(&self, node: &Node) -> bool {
        self.reference == Some(node.station)
    }

    /// The reference of the segment.
    pub fn reference_node(&self) -> Option<&Node> {
        self.node_at(self.reference?)
    }

    /// The reference clock on a link: the reference of the segment if it is on that link, otherwise the first
    /// clock that frames pass. `None` if delays on that link have different origins.
    pub fn reference_on(&self, link: Link) -> Option<&Node> {
        if self.is_mixed(link) {
            return None;
        }
        let here = |node: &&Node| node.has_clock && !node.is_unset && node.link == Some(link) && node.unit.is_some();
        let first = || self.nodes.iter().filter(here).min_by_key(|node| node.unit);
        self.reference_node().filter(here).or_else(first)
    }

    /// The references whose time the copies of cyclic frames distribute.
    pub fn references(&self) -> References {
        let station = |link| self.reference_on(link).map(|node| node.station);
        let redundant_leads = self.reference_node().and_then(|node| node.link) == Some(Link::Redundant);
        References { main: station(Link::Main), redundant: station(Link::Redundant), redundant_leads }
    }

    /// Whether a member without a locked clock goes on nevertheless. One with an unknown delay never does: its time may
    /// be wrong by any amount.
    pub fn goes_on_unlocked(&self, is_hidden: bool) -> bool {
        self.config.when_unlocked == WhenUnlocked::GoOn && !is_hidden
    }

    /// Whether delays on a link have different origins.
    pub fn is_mixed(&self, link: Link) -> bool {
        let mut here =
            self.nodes.iter().filter(|node| node.has_clock && node.link == Some(link) && node.unit.is_some());
        let first = here.next().map(|node| node.origin);
        here.any(|node| Some(node.origin) != first)
    }

    /// The reference of a link and the clocks that frames pass before it.
    pub fn in_front_on(&self, link: Link) -> Option<(&Node, Vec<&Node>)> {
        let is_used = |node: &&Node| node.has_clock && !node.is_unset && node.link == Some(link);
        let in_front = self.nodes.iter().filter(is_used).filter(|node| self.is_in_front(node));
        Some((self.reference_on(link)?, in_front.collect()))
    }

    /// Whether frames pass the clock before the reference of its link.
    fn is_in_front(&self, node: &Node) -> bool {
        let reference = node.link.and_then(|link| self.reference_on(link));
        reference.is_some_and(|reference| node.unit.is_some() && node.unit < reference.unit)
    }

    /// Filter depths that differ from the written ones: DC_FILTER_DIFFERENCE and DC_FILTER_SPEED. References and
    /// clocks before them receive the time predicted by the host, all others the time of a reference.
    pub fn filters(&self) -> Vec<(ClockKey, [u8; 2])> {
        let references = Link::ALL.map(|link| self.reference_on(link));
        let nodes = self.nodes.iter().filter(|node| node.has_clock && node.link.is_some());
        let depths = nodes.map(|node| {
            let reference = references[usize::from(node.link == Some(Link::Redundant))];
            (node, self.filter_depths(node, reference))
        });
        let changed = depths.filter(|(node, depths)| node.filter_depths != Some(*depths));
        changed.map(|(node, depths)| (node.key(), depths)).collect()
    }

    fn filter_depths(&self, node: &Node, reference: Option<&Node>) -> [u8; 2] {
        let is_behind = reference.is_some_and(|reference| match node.unit {
            Some(_) => node.unit > reference.unit,
            None => node.position > reference.position,
        });
        let is_on_link = reference.is_some_and(|reference| reference.station == node.station);
        let is_steered = is_on_link && (self.config.bus_shift || !self.is_reference(node));
        let difference = if is_behind { EXACT_DEPTH } else { HOST_DEPTH };
        [difference, if is_steered { STEADY_DEPTH } else { SPEED_DEPTH }]
    }

    /// A declared SubDevice.
    pub fn of_member(&self, member: usize) -> Option<&Node> {
        self.nodes.iter().find(|node| node.member == Some(member))
    }

    /// The SubDevice with a station address.
    pub fn node_at(&self, station: StationAddress) -> Option<&Node> {
        self.nodes.iter().find(|node| node.station == station)
    }

    /// The SubDevice with a key; `None` if it has lost its registers since.
    pub fn node_of(&self, key: ClockKey) -> Option<&Node> {
        self.node_at(key.station).filter(|node| node.key() == key)
    }

    /// The same, to be changed.
    pub(in crate::segment) fn node_of_mut(&mut self, key: ClockKey) -> Option<&mut Node> {
        self.nodes.iter_mut().find(|node| node.key() == key)
    }

    /// Keys, by position of the scan, then of later ones.
    pub fn keys(&self) -> Vec<ClockKey> {
        self.nodes.iter().map(Node::key).collect()
    }

    /// The declared passage times of a SubDevice.
    pub fn passage_of(&self, station: StationAddress) -> Passage {
        let own = self.node_at(station).and_then(|node| node.passage);
        let declared = own.unwrap_or(self.config.passage);
        let exact = |ns: u16| i64::from(ns) << FRACTION;
        Passage { processed: exact(declared.processing_ns), forwarded: exact(declared.forwarding_ns) }
    }

    /// Clocks whose DC_LATCH_MODE differs from the setting that these entry ports need (protocol 3.12, 7.5).
    pub fn latch_modes(&self, stations: &[StationAddress], entries: &[u8]) -> Vec<(ClockKey, bool)> {
        let wanted = stations.iter().zip(entries).map(|(station, entry)| (*station, *entry != 0));
        let is_other = |node: &&Node, backwards: bool| node.has_clock && node.latches_backwards != backwards;
        let other = |(station, backwards): (StationAddress, bool)| {
            let node = self.node_at(station).filter(|node| is_other(node, backwards))?;
            Some((node.key(), backwards))
        };
        wanted.filter_map(other).collect()
    }
}
