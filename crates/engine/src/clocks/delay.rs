//! Propagation delays of any tree, from the times at which one frame came in at each port (facts 7.1).
//!
//! The frame's way through the tree is followed port by port. Between two arrivals at a SubDevice with a clock lies a
//! branch: what its clock says the branch took, less what the SubDevices in the branch say that they took, is the time
//! on cables, and that is shared evenly among them. SubDevices without a clock are part of the cable.

use alloc::vec;
use alloc::vec::Vec;

use super::round;
use crate::topology::{PortOf, Topology};

/// Order in which a frame passes the ports; the processing unit is behind port 0 (facts 2.1).
const TRAVEL: [u8; 4] = [0, 3, 1, 2];
/// So many open ports are looked at for the one that leads to the redundant link; it is the last one.
const OPEN_PORTS: usize = 16;
/// Frames of the main and of the redundant link: in a broken ring each has a tree of its own.
pub const TREES: usize = 2;

/// Times at which the frame came in at port 0..3 after it came in at the port of entry, with fraction
/// ([`super::FRACTION`]). Those of ports that it did not come in at say nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortTimes(pub [i64; 4]);

/// What each SubDevice is away from where the frame came into its tree.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Delays {
    /// By position, to the processing unit, with fraction; `None` without a clock or without times.
    pub units: Vec<Option<i64>>,
    /// By position, the tree: 0 for the main link, 1 for the redundant one.
    pub trees: Vec<usize>,
}

impl Delays {
    /// Nanoseconds from the reference's processing unit to that of a SubDevice of the same tree; negative where the
    /// frame meets that one first.
    pub fn between(&self, reference: usize, node: usize) -> Option<i64> {
        let of = |node: usize| self.units.get(node).copied().flatten();
        (self.trees.get(reference) == self.trees.get(node)).then_some(())?;
        Some(round(of(node)? - of(reference)?))
    }
}

/// Where frames come in: the SubDevice and its port, by tree.
pub fn entries(topology: &Topology) -> [Option<(usize, u8)>; TREES] {
    let root = |mut range: core::ops::Range<usize>| range.find(|node| topology.nodes[*node].parent.is_none());
    let (count, main) = (topology.nodes.len(), topology.main_count.min(topology.nodes.len()));
    let first = root(0..main).or_else(|| root(0..count).filter(|_| main == 0 && topology.redundant_head.is_none()));
    let at_main = first.map(|node| (node, topology.nodes[node].entry_port));
    // Frames of the redundant link come in where the trunk of its tree leads out of it.
    let at_redundant = topology.redundant_head.and_then(|head| {
        let leads_out = |at: &&PortOf| at.node >= main && tree_root(topology, at.node) == head;
        topology.open_ports.iter().rev().take(OPEN_PORTS).find(leads_out).map(|at| (at.node, at.port))
    });
    [at_main, at_redundant]
}

fn tree_root(topology: &Topology, mut node: usize) -> usize {
    for _ in 0..topology.nodes.len() {
        match topology.nodes[node].parent {
            Some((parent, _)) => node = parent,
            None => break,
        }
    }
    node
}

/// The port at which frames come in, by position.
pub fn entry_ports(topology: &Topology) -> Vec<u8> {
    let mut ports: Vec<Option<u8>> = vec![None; topology.nodes.len()];
    for (node, entry) in entries(topology).into_iter().flatten() {
        for (node, port) in way(topology, node, entry) {
            ports[node].get_or_insert(port);
        }
    }
    ports.iter().zip(&topology.nodes).map(|(port, node)| port.unwrap_or(node.entry_port)).collect()
}

/// Arrivals of a frame in order: SubDevice and port.
fn way(topology: &Topology, node: usize, entry: u8) -> Vec<(usize, u8)> {
    let limit = 4 * topology.nodes.len() + 4;
    let mut arrivals = vec![(node, entry)];
    let (mut node, mut port) = (node, entry);
    while arrivals.len() < limit {
        let at = TRAVEL.iter().position(|p| *p == port).unwrap_or(0);
        let onwards = (1..=4).map(|step| TRAVEL[(at + step) % 4]);
        let back_out = |p: u8| arrivals[0] == (node, p);
        let mut next = None;
        for out in onwards {
            if back_out(out) {
                return arrivals;
            }
            if let Some(far) = neighbour(topology, node, out) {
                next = Some(far);
                break;
            }
        }
        let Some(far) = next else { break };
        (node, port) = far;
        arrivals.push(far);
    }
    arrivals
}

/// Who is at the other end of a port's cable.
fn neighbour(topology: &Topology, node: usize, port: u8) -> Option<(usize, u8)> {
    let here = topology.nodes.get(node)?;
    if port == here.entry_port {
        return here.parent;
    }
    let child = (*here.children.get(usize::from(port))?)?;
    Some((child, topology.nodes.get(child)?.entry_port))
}

/// Propagation delays. `times` by position, on one clock (see [`super::Measurements::mean`]); `None` without a clock.
pub fn propagation(topology: &Topology, times: &[Option<PortTimes>]) -> Delays {
    let count = topology.nodes.len();
    let mut delays = Delays { units: vec![None; count], trees: vec![0; count] };
    for (tree, entry) in entries(topology).into_iter().enumerate() {
        let Some((node, port)) = entry else { continue };
        let way = way(topology, node, port);
        way.iter().for_each(|(node, _)| delays.trees[*node] = tree);
        let clock = |node: usize| times.get(node).copied().flatten();
        Walk::new(&way, count, &clock).run(&mut delays.units);
    }
    delays
}

/// The arrivals of one frame, with what clocks say about them.
struct Walk<'a, C: Fn(usize) -> Option<PortTimes>> {
    way: &'a [(usize, u8)],
    clock: &'a C,
    /// Place of each SubDevice's last arrival.
    last: Vec<usize>,
    /// Place of its next arrival, by place.
    next: Vec<Option<usize>>,
}

impl<'a, C: Fn(usize) -> Option<PortTimes>> Walk<'a, C> {
    fn new(way: &'a [(usize, u8)], count: usize, clock: &'a C) -> Walk<'a, C> {
        let mut last = vec![0; count];
        let mut seen: Vec<Option<usize>> = vec![None; count];
        let mut next = vec![None; way.len()];
        for (place, (node, _)) in way.iter().enumerate() {
            if let Some(before) = seen[*node].replace(place) {
                next[before] = Some(place);
            }
            last[*node] = place;
        }
        Walk { way, clock, last, next }
    }

    fn run(&self, units: &mut [Option<i64>]) {
        let mut entered = vec![None; units.len()];
        // What comes before the first clock, and between the branches in front of it, nobody measures.
        self.branch(0, self.way.len(), None, 0, &mut entered);
        for place in 0..self.way.len() {
            let (node, port) = self.way[place];
            let (Some(delay), Some(times)) = (entered[node], (self.clock)(node)) else { continue };
            let is_first = units[node].is_none();
            if is_first {
                units[node] = Some(delay + self.to_unit(place, &times));
            }
            if let Some(next) = self.next[place] {
                let at = |port: u8| times.0[usize::from(port & 3)];
                let from = if is_first { 0 } else { at(port) };
                let took = at(self.way[next].1) - from;
                self.branch(place + 1, next, Some(took), delay + from, &mut entered);
            }
        }
    }

    /// From the port of entry to the processing unit: it is behind the arrival at port 0, or where port 0 is closed,
    /// behind the last arrival before the frame is looped there.
    fn to_unit(&self, first: usize, times: &PortTimes) -> i64 {
        let (_, entry) = self.way[first];
        if entry == 0 {
            return 0;
        }
        let order = |port: u8| TRAVEL.iter().position(|p| *p == port).unwrap_or(0);
        let (mut place, mut port) = (first, entry);
        while let Some(next) = self.next[place] {
            let (_, to) = self.way[next];
            // Having gone round past port 0 without an arrival there, the frame was looped.
            if to != 0 && order(to) <= order(port) {
                break;
            }
            (place, port) = (next, to);
            if to == 0 {
                break;
            }
        }
        if port == entry { 0 } else { times.0[usize::from(port & 3)] }
    }

    /// Shares the time of a branch, which arrivals `from..to` belong to, among its cables. `begin` is the delay at the
    /// arrival before it.
    fn branch(&self, from: usize, to: usize, took: Option<i64>, begin: i64, entered: &mut [Option<i64>]) {
        let (mut inside, mut cables) = (0, to.saturating_sub(from) as i64 + 1);
        self.in_branch(from, to, |_, span, length| {
            inside += span;
            cables -= length;
        });
        let on_cables = took.map_or(0, |took| (took - inside).max(0));
        let (mut done, mut spent) = (0, 0);
        let mut before = from;
        self.in_branch(from, to, |place, span, length| {
            done += (place - before) as i64 + 1;
            before = place + length as usize + 1;
            entered[self.way[place].0] = Some(begin + spent + on_cables * done / cables.max(1));
            spent += span;
        });
    }

    /// SubDevices with a clock in a branch, those behind them left out: place of the first arrival, time from there to
    /// the last one, arrivals between.
    fn in_branch(&self, from: usize, to: usize, mut found: impl FnMut(usize, i64, i64)) {
        let mut place = from;
        while place < to {
            let (node, _) = self.way[place];
            match (self.clock)(node) {
                Some(times) => {
                    let last = self.last[node].min(to.saturating_sub(1)).max(place);
                    let span = if last == place { 0 } else { times.0[usize::from(self.way[last].1 & 3)] };
                    found(place, span, (last - place) as i64);
                    place = last + 1;
                }
                None => place += 1,
            }
        }
    }
}

#[cfg(test)]
mod tests;
