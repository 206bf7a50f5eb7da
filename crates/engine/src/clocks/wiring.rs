//! The connections between ports, and the path of a frame over them (protocol 2.1, 7.1).
//!
//! Input: a [`Topology`], and which ports are open now. A topology contains local rings as branches; the wiring
//! contains their closing cables too. Output: the arrivals of a frame of either link, in order, and whether it passes
//! the processing unit after each arrival.

use alloc::vec;
use alloc::vec::Vec;

use crate::topology::{Closing, Finding, PortOf, Topology};

/// Order in which a frame passes the ports; the processing unit is behind port 0 (protocol 2.1).
const TRAVEL: [u8; 4] = [0, 3, 1, 2];
/// Number of open ports, from the last one, that are checked for the port of the redundant link.
const OPEN_PORTS: usize = 16;
/// Number of links: one tree for frames of the main link, one for those of the redundant link.
pub const TREES: usize = 2;

/// The cables of a segment that frames use.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wiring {
    /// By position and port: the port at the other end of the cable.
    pub(crate) far: Vec<[Option<PortOf>; 4]>,
    /// The ports at which frames of the main and of the redundant link enter and leave the segment.
    pub entries: [Option<PortOf>; TREES],
}

/// Arrival of a frame at a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// The port.
    pub at: PortOf,
    /// The frame passes the processing unit before it leaves the SubDevice.
    pub processed: bool,
}

impl Wiring {
    /// The wiring of a topology; `ring_closed`: the ring of both links is closed. Closing cables of local rings are
    /// included if `is_open` is true for both of their ports.
    pub fn new(topology: &Topology, ring_closed: bool, is_open: impl Fn(PortOf) -> bool) -> Wiring {
        let mut wiring = Wiring { far: vec![[None; 4]; topology.nodes.len()], entries: entries(topology, ring_closed) };
        for (node, here) in topology.nodes.iter().enumerate() {
            if let Some((parent, port)) = here.parent {
                wiring.connect(PortOf { node: parent, port }, PortOf { node, port: here.entry_port });
            }
        }
        for ring in &topology.local_rings {
            let (head, tail) = (ring.closing.head, ring.closing.tail);
            if is_open(head) && is_open(tail) {
                wiring.connect(head, tail);
            }
        }
        wiring
    }

    fn connect(&mut self, one: PortOf, other: PortOf) {
        if one.node.max(other.node) >= self.far.len() || one.port.max(other.port) > 3 {
            return;
        }
        for (here, there) in [(one, other), (other, one)] {
            if let Some(port) = self.far.get_mut(here.node).and_then(|ports| ports.get_mut(usize::from(here.port))) {
                *port = Some(there);
            }
        }
    }

    /// Opens rings: removes the cables at these ports. At the port of the redundant link this makes the ring of both
    /// links a line.
    pub fn open(&mut self, rings: &[PortOf]) {
        for at in rings {
            if let Some(far) = self.far(*at) {
                self.far[at.node][usize::from(at.port)] = None;
                self.far[far.node][usize::from(far.port)] = None;
            }
            if self.entries[1] == Some(*at) {
                self.entries[1] = None;
            }
        }
    }

    /// The ports to close so that every whole ring is open: both ends of the closing cable of a ring behind a junction,
    /// if frames enter all its members at port 0; the port of the redundant link in a closed ring of two links. With
    /// more than one open port, or an unconnected port 0, the port of the redundant link is not certain, for example
    /// with unknown rings behind junctions: closing a wrong port would cut off SubDevices.
    pub fn whole_rings(
        &self,
        topology: &Topology,
        ring_closed: bool,
        enters_at_port_0: impl Fn(usize) -> bool,
    ) -> Vec<PortOf> {
        let is_whole = |closing: &Closing| {
            let mut members = closing.head.node + 1..=closing.tail.node;
            self.far(closing.head).is_some() && members.all(&enters_at_port_0)
        };
        let local = topology.local_rings.iter().map(|ring| ring.closing).filter(is_whole);
        let ends = local.flat_map(|closing| [closing.head, closing.tail]);
        let is_unclear = |finding: &Finding| matches!(finding, Finding::UnconnectedPort0 { .. });
        let is_certain = topology.open_ports.len() == 1 && !topology.findings.iter().any(is_unclear);
        ends.chain(self.entries[1].filter(|_| ring_closed && is_certain)).collect()
    }

    /// Number of SubDevices.
    pub fn count(&self) -> usize {
        self.far.len()
    }

    /// The other end of the cable on a port.
    pub fn far(&self, at: PortOf) -> Option<PortOf> {
        self.far.get(at.node)?.get(usize::from(at.port)).copied().flatten()
    }

    /// Both ends of each cable.
    pub fn cables(&self) -> impl Iterator<Item = (PortOf, PortOf)> + '_ {
        let ports = (0..self.far.len()).flat_map(|node| (0..4).map(move |port| PortOf { node, port }));
        ports.filter_map(|near| Some((near, self.far(near)?))).filter(|(near, far)| near < far)
    }

    /// Arrivals of a frame that was sent on a link (0 or 1), in order.
    pub fn path(&self, tree: usize) -> Vec<Arrival> {
        let limit = 4 * self.far.len() + 4;
        let mut arrivals = Vec::new();
        let mut next = self.entries[tree];
        while let Some(at) = next.take().filter(|_| arrivals.len() < limit) {
            let mut processed = at.port == 0;
            let place = TRAVEL.iter().position(|port| *port == at.port).unwrap_or(0);
            for step in 1..=4 {
                let out = PortOf { node: at.node, port: TRAVEL[(place + step) % 4] };
                if self.entries.contains(&Some(out)) {
                    break;
                }
                next = self.far(out);
                if next.is_some() {
                    break;
                }
                // A closed port 0 loops the frame to the processing unit.
                processed |= out.port == 0;
            }
            arrivals.push(Arrival { at, processed });
        }
        arrivals
    }

    /// By position: the port at which the frame that the SubDevice processes first comes in.
    pub fn entry_ports(&self) -> Vec<u8> {
        let mut ports: Vec<Option<u8>> = vec![None; self.far.len()];
        for tree in 0..TREES {
            let path = self.path(tree);
            let processed = processed_in(&path, self.far.len());
            for Arrival { at, .. } in path.iter().filter(|arrival| processed[arrival.at.node]) {
                ports[at.node].get_or_insert(at.port);
            }
        }
        ports.into_iter().map(Option::unwrap_or_default).collect()
    }
}

impl Wiring {
    /// By position: the ports at which the frame that the SubDevice processes comes in, and the link of this frame (0
    /// or 1).
    pub fn arrival_ports(&self) -> (Vec<[bool; 4]>, Vec<usize>) {
        let mut ports = vec![[false; 4]; self.far.len()];
        let mut trees = vec![0; self.far.len()];
        let mut is_seen = vec![false; self.far.len()];
        for tree in 0..TREES {
            let path = self.path(tree);
            let here = processed_in(&path, self.far.len());
            for Arrival { at, .. } in path.iter().filter(|arrival| here[arrival.at.node] && !is_seen[arrival.at.node]) {
                ports[at.node][usize::from(at.port & 3)] = true;
                trees[at.node] = tree;
            }
            is_seen.iter_mut().zip(here).for_each(|(seen, here)| *seen |= here);
        }
        (ports, trees)
    }
}

/// By position: whether the SubDevice processes the frame.
pub(super) fn processed_in(path: &[Arrival], count: usize) -> Vec<bool> {
    let mut processed = vec![false; count];
    path.iter().filter(|arrival| arrival.processed).for_each(|arrival| processed[arrival.at.node] = true);
    processed
}

/// The ports at which frames of both links enter the segment.
fn entries(topology: &Topology, ring_closed: bool) -> [Option<PortOf>; TREES] {
    let root = |mut range: core::ops::Range<usize>| range.find(|node| topology.nodes[*node].parent.is_none());
    let (count, main) = (topology.nodes.len(), topology.main_count.min(topology.nodes.len()));
    let first = root(0..main).or_else(|| root(0..count).filter(|_| main == 0 && topology.redundant_head.is_none()));
    let at_main = first.map(|node| PortOf { node, port: topology.nodes[node].entry_port });
    // In an open ring, frames of the redundant link enter at the open port of the tree of the redundant head.
    let at_redundant = match topology.redundant_head {
        Some(head) => {
            let leads_out = |at: &&PortOf| at.node >= main && tree_root(topology, at.node) == head;
            topology.open_ports.iter().rev().take(OPEN_PORTS).find(leads_out)
        }
        None => topology.open_ports.last().filter(|_| ring_closed),
    };
    [at_main, at_redundant.copied()]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{LocalRing, Node};

    /// A junction with a local ring of three SubDevices from port 3 to port 1, and one SubDevice on port 2.
    fn junction() -> Topology {
        let mut nodes = vec![Node::default(); 5];
        for (parent, port, child) in [(0, 3, 1), (1, 1, 2), (2, 1, 3), (0, 2, 4)] {
            nodes[parent].children[usize::from(port)] = Some(child);
            nodes[child].parent = Some((parent, port));
        }
        let closing = Closing { head: PortOf { node: 0, port: 1 }, tail: PortOf { node: 3, port: 1 } };
        let local_rings = vec![LocalRing { closing, cables: Vec::new() }];
        Topology { nodes, main_count: 5, local_rings, ..Topology::default() }
    }

    fn paths(wiring: &Wiring, tree: usize) -> Vec<(usize, u8, bool)> {
        wiring.path(tree).iter().map(|arrival| (arrival.at.node, arrival.at.port, arrival.processed)).collect()
    }

    // covers: 9.4, dc-delays
    #[test]
    fn a_frame_passes_a_local_ring_once_and_a_broken_one_there_and_back() {
        let whole = Wiring::new(&junction(), false, |_| true);
        let round =
            [(0, 0, true), (1, 0, true), (2, 0, true), (3, 0, true), (0, 1, false), (4, 0, true), (0, 2, false)];
        assert_eq!(paths(&whole, 0), round);
        assert_eq!(whole.cables().count(), 5);
        let open = Wiring::new(&junction(), false, |at| at.node != 3);
        assert_eq!(paths(&open, 0).len(), 9);
        // Broken between 1 and 2: frames enter the second half at its other end.
        let mut topology = junction();
        (topology.nodes[2].parent, topology.nodes[1].children[1]) = (None, None);
        let broken = Wiring::new(&topology, false, |_| true);
        let parts = [
            (0, 0, true),
            (1, 0, true),
            (0, 3, false),
            (3, 1, false),
            (2, 1, true),
            (3, 0, true),
            (0, 1, false),
            (4, 0, true),
            (0, 2, false),
        ];
        assert_eq!(paths(&broken, 0), parts);
        assert_eq!(broken.entry_ports(), [0, 0, 1, 1, 0]);
    }

    // covers: 2.9
    #[test]
    fn in_a_closed_ring_a_branch_on_port_2_processes_frames_of_one_link_only() {
        // S1, S2 with S5 on port 2, S3.
        let mut topology = Topology { nodes: vec![Node::default(); 4], main_count: 3, ..Topology::default() };
        for (parent, port, child) in [(0, 1, 1), (1, 1, 2), (1, 2, 3)] {
            topology.nodes[parent].children[usize::from(port)] = Some(child);
            topology.nodes[child].parent = Some((parent, port));
        }
        topology.open_ports = vec![PortOf { node: 2, port: 1 }];
        let wiring = Wiring::new(&topology, true, |_| true);
        assert_eq!(paths(&wiring, 0), [(0, 0, true), (1, 0, true), (2, 0, true)]);
        assert_eq!(paths(&wiring, 1), [(2, 1, false), (1, 1, false), (3, 0, true), (1, 2, false), (0, 1, false)]);
    }
}
