//! Delays and offsets as measurements and latched times give them.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;

use crate::clocks::{Latched, Unknown, round};
use crate::link::Link;
use crate::segment::clocks::{Clocks, Measured, Node};

/// Delays that differ by no more than this from the written ones are what the same way gives when it is measured again.
const SAME_NS: i64 = 30;

/// What a measurement has changed.
pub(super) struct Changes {
    /// Links with other delays.
    pub links: Vec<Link>,
    /// Clocks that get another delay.
    pub clocks: usize,
    /// The largest change.
    pub largest_ns: u32,
}

impl Clocks {
    /// Takes over a measurement: the link of each SubDevice and its delay, which counts from the reference there.
    pub(super) fn take_over(&mut self, measured: &Measured) {
        self.measured = self.measured.wrapping_add(1);
        let are_estimated = self.config.estimated_delays;
        let positions: Vec<(StationAddress, usize)> =
            self.nodes.iter().map(|node| (node.station, usize::from(node.position))).collect();
        for node in &mut self.nodes {
            let Some(at) = measured.stations.iter().position(|station| *station == node.station) else { continue };
            let tree = measured.delays.trees.get(at).copied().unwrap_or(0);
            // Later it runs as fast as the reference, because its loop makes it.
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
                // Its delay at another place does not hold here.
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

    /// Takes over a measurement after a change of the segment. Where all delays on a link are what they were, nothing
    /// changes there.
    pub(super) fn measure_again(&mut self, measured: &Measured) -> Changes {
        let before: Vec<Node> = self.nodes.clone();
        self.take_over(measured);
        let links = Link::ALL.into_iter().filter(|link| !self.keep_same(&before, *link)).collect();
        let change = |(node, before): (&Node, &Node)| (node.delay_ns - before.delay_ns).unsigned_abs();
        let changes = self.nodes.iter().zip(&before).map(change).filter(|change| *change > 0);
        let largest_ns = changes.clone().max().unwrap_or(0).min(u32::MAX.into()) as u32;
        Changes { links, clocks: changes.count(), largest_ns }
    }

    /// Where all delays on a link are what they were, what is known stays as it was: it may count from one place on
    /// both links, and measurements in a broken ring do not. Returns whether it is so.
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

    /// Delays on a link count from the reference there. Returns whether any has changed.
    pub(super) fn refer(&mut self, link: Link) -> bool {
        let Some(reference) = self.reference_on(link).and_then(|index| self.nodes[index].unit) else {
            return false;
        };
        let mut changed = false;
        for node in self.nodes.iter_mut().filter(|node| node.link == Some(link)) {
            let Some(unit) = node.unit else { continue };
            let delay = round(unit - reference);
            changed |= node.delay_ns != delay;
            node.delay_ns = delay;
        }
        changed
    }

    /// Offsets with which all clocks show `wanted` where the frame came in, plus their delay.
    pub(super) fn set_offsets(&mut self, latched: &[Option<Latched>], wanted: u64) {
        let references = Link::ALL.map(|link| self.reference_on(link).and_then(|index| self.nodes[index].unit));
        for (node, latched) in self.nodes.iter_mut().zip(latched) {
            let Some(latched) = latched else { continue };
            // Without a delay it shows what it receives: the time at which the frame passes the reference.
            let received = || references[usize::from(node.link == Some(Link::Redundant))];
            let unit = node.unit.or_else(received).map_or(0, round);
            node.offset_ns = wanted.wrapping_add_signed(unit).wrapping_sub(latched.unit) as i64;
        }
    }

    /// The offset of one clock, by a frame that it and its reference have latched; by the time of the host where there
    /// is no reference.
    pub(super) fn set_offset(&mut self, index: usize, latched: &[Option<Latched>], host: u64) {
        let time = |index: usize| latched.get(index).copied().flatten().map(|latched| latched.unit);
        let Some(own) = time(index) else { return };
        let link = self.nodes[index].link.unwrap_or(Link::Main);
        let reference = self.reference_on(link).filter(|reference| *reference != index);
        let system = match reference.and_then(|reference| Some((reference, time(reference)?))) {
            Some((reference, local)) => local.wrapping_add_signed(self.nodes[reference].offset_ns),
            None => host.wrapping_add(self.epoch),
        };
        let node = &mut self.nodes[index];
        node.offset_ns = system.wrapping_add_signed(node.delay_ns).wrapping_sub(own) as i64;
        (node.good, node.difference_ns, node.average, node.worst_ns) = (0, None, None, 0);
    }
}
