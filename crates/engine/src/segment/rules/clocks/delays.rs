//! Delays and offsets computed from measurements and latched times.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::clocks::{Measured, Unknown, round};
use crate::link::Link;
use crate::segment::clocks::{Clocks, LatchedTimes, Node};

/// Repeated measurements of the same path differ by no more than this: such delays count as unchanged.
const SAME_NS: i64 = 30;

/// Changes due to a measurement.
pub(super) struct Changes {
    /// Links with changed delays.
    pub links: Vec<Link>,
    /// Clocks with a changed delay.
    pub clocks: usize,
    /// The largest change.
    pub largest_ns: u32,
}

impl Clocks {
    /// Takes over a measurement: the link of each SubDevice and its delay from the reference on that link.
    pub(super) fn take_over(&mut self, measured: &Measured) {
        self.measured = self.measured.wrapping_add(1);
        self.changes.delays = self.changes.delays.wrapping_add(1);
        self.last = Some(measured.clone());
        let are_estimated = self.config.estimated_delays;
        let positions: Vec<(StationAddress, usize)> =
            self.nodes.iter().map(|node| (node.station, usize::from(node.position))).collect();
        for node in &mut self.nodes {
            let Some(at) = measured.stations.iter().position(|station| *station == node.station) else { continue };
            let tree = measured.delays.trees.get(at).copied().unwrap_or(0);
            // Once set up, the control loop makes it run as fast as the reference.
            let is_free = node.unit.is_none() || node.is_unset;
            if let Some(drift_ppb) = measured.drift_ppb.get(at).copied().flatten().filter(|_| is_free) {
                node.drift_ppb = drift_ppb;
            }
            node.unit = measured.delays.units.get(at).copied().flatten();
            node.hidden = None;
            if let Some(unknown) = measured.delays.unknown.iter().find(|unknown| unknown.node == at) {
                let at_fork = |fork: usize| positions.iter().find(|(station, _)| *station == measured.stations[fork]);
                let fork = unknown.fork.and_then(at_fork);
                node.hidden = Some(Unknown { fork: fork.map(|(_, position)| *position), ..*unknown });
                node.unit = unknown.range.filter(|_| are_estimated).map(|(least, most)| (least + most) / 2);
                // The delay of its previous place is not valid here.
                if node.is_unset {
                    node.delay_ns = 0;
                }
            }
            node.origin = 2 * self.measured + tree as u32;
            node.link = Some(if tree == 0 { Link::Main } else { Link::Redundant });
        }
        for link in Link::ALL {
            self.refer(link);
        }
    }

    /// Takes over a measurement after a change of the segment. If all delays on a link are unchanged, nothing changes
    /// there.
    pub(super) fn measure_again(&mut self, measured: &Measured) -> Changes {
        let before: Vec<Node> = self.nodes.clone();
        self.take_over(measured);
        let links = Link::ALL.into_iter().filter(|link| !self.keep_same(&before, *link)).collect();
        let change = |(node, before): (&Node, &Node)| (node.delay_ns - before.delay_ns).unsigned_abs();
        let changes = self.nodes.iter().zip(&before).map(change).filter(|change| *change > 0);
        let largest_ns = changes.clone().max().unwrap_or(0).min(u32::MAX.into()) as u32;
        Changes { links, clocks: changes.count(), largest_ns }
    }

    /// If all delays on a link are unchanged, the previous values and their origin are kept: they may have one origin
    /// for both links, which measurements in an open ring do not. Returns whether they were kept.
    fn keep_same(&mut self, before: &[Node], link: Link) -> bool {
        let here: Vec<usize> = (0..before.len())
            .filter(|index| self.nodes[*index].has_delay() && self.nodes[*index].link == Some(link))
            .collect();
        let origin = here.first().map(|index| before[*index].origin);
        let is_same = |index: &usize| {
            let (now, before) = (&self.nodes[*index], &before[*index]);
            let is_known = before.link == Some(link) && before.unit.is_some() && Some(before.origin) == origin;
            is_known && (now.delay_ns - before.delay_ns).abs() <= SAME_NS
        };
        if !here.iter().all(is_same) {
            return false;
        }
        for index in here {
            let (node, before) = (&mut self.nodes[index], &before[index]);
            (node.unit, node.origin, node.delay_ns) = (before.unit, before.origin, before.delay_ns);
        }
        true
    }

    /// Computes the delays on a link from the reference there. Returns whether any has changed.
    pub(super) fn refer(&mut self, link: Link) -> bool {
        let Some(reference) = self.reference_on(link).and_then(|reference| reference.unit) else {
            return false;
        };
        let mut changed = false;
        for node in self.nodes.iter_mut().filter(|node| node.link == Some(link)) {
            let Some(unit) = node.unit else { continue };
            let delay = round(unit - reference);
            changed |= node.delay_ns != delay;
            node.delay_ns = delay;
        }
        self.changes.delays = self.changes.delays.wrapping_add(u32::from(changed));
        changed
    }

    /// Computes the offsets with which all clocks show `wanted` where the frame enters the segment, plus their delay.
    pub(super) fn set_offsets(&mut self, latched: &LatchedTimes, wanted: u64) {
        self.changes.offsets = self.changes.offsets.wrapping_add(1);
        let references = Link::ALL.map(|link| self.reference_on(link).and_then(|reference| reference.unit));
        for node in &mut self.nodes {
            let Some(latched) = latched.get(&node.key()) else { continue };
            // Without a delay it shows the received time: the time at which the frame passes the reference.
            let received = || references[usize::from(node.link == Some(Link::Redundant))];
            let unit = node.unit.or_else(received).map_or(0, round);
            node.offset_ns = wanted.wrapping_add_signed(unit).wrapping_sub(latched.unit) as i64;
        }
    }

    /// The offset of one clock, from a frame that it and its reference have latched; from the time of the host without
    /// a reference.
    pub(super) fn set_offset(&mut self, station: StationAddress, latched: &LatchedTimes, host: u64) {
        let time = |node: &Node| latched.get(&node.key()).map(|latched| latched.unit);
        let Some(node) = self.node_at(station) else { return };
        let Some(own) = time(node) else { return };
        let reference = self.reference_on(node.link.unwrap_or(Link::Main));
        let reference = reference.filter(|reference| reference.station != station);
        let system = match reference.and_then(|reference| Some((reference, time(reference)?))) {
            Some((reference, local)) => local.wrapping_add_signed(reference.offset_ns),
            None => host.wrapping_add(self.epoch),
        };
        let key = node.key();
        let Some(node) = self.node_of_mut(key) else { return };
        node.offset_ns = system.wrapping_add_signed(node.delay_ns).wrapping_sub(own) as i64;
        (node.good, node.difference_ns, node.average, node.worst_ns) = (0, None, None, 0);
    }
}
