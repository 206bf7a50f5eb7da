//! Rings behind junctions that could explain the open ports of a segment (protocol 9.4).
//!
//! Input: the port status of the SubDevices. Output: sets of closing cables that fit. A test with frames must show
//! which set is right.

use alloc::vec::Vec;

use super::finding::Finding;
use super::local_ring::Closing;
use super::port::PortOf;
use super::rings::unconnected;
use super::tree::{NodeStatus, Topology};

/// Sets of closing cables that could explain the open ports, those with early tails first; at most `most`.
///
/// Open ports alone do not show where a ring ends: any SubDevice after the junction could also be connected to the last
/// member of the ring. The caller must find out which set is right. If the redundant link has SubDevices (a broken
/// ring, or branches that only its frames pass), the result is empty.
///
/// Every set contains the closing cables known to be right, and none contains one known to be wrong.
pub(crate) fn candidates_with(
    nodes: &[NodeStatus],
    main_count: usize,
    ring_closed: bool,
    most: usize,
    (right, wrong): (&[Closing], &[Closing]),
) -> Vec<Vec<Closing>> {
    if main_count != nodes.len() {
        return Vec::new();
    }
    // One open port leads to the redundant link.
    let spare = usize::from(ring_closed);
    let rings = rings_shown(nodes, ring_closed);
    if rings == 0 || rings > MOST_RINGS {
        return Vec::new();
    }
    let mut search = Search { nodes, right, wrong, spare, rings, most, steps: STEPS, found: Vec::new() };
    search.go(0, Vec::new(), Vec::new());
    search.found
}

/// Number of rings behind junctions that the open ports show: each ring has two more open ports than its members need.
pub(crate) fn rings_shown(nodes: &[NodeStatus], ring_closed: bool) -> usize {
    let further = |node: &NodeStatus| (1..4).filter(|port| open(node, *port)).count();
    let open_ports: usize = nodes.iter().map(further).sum();
    let hanging = nodes.iter().skip(1).filter(|node| !unconnected(node)).count();
    open_ports.saturating_sub(usize::from(ring_closed) + hanging) / 2
}

/// The cabling with these rings. A ring may have been extended behind its known tail and be broken: then frames come in
/// at its closing end although a SubDevice behind the tail has no connection on port 0. In this case frames enter the
/// new members at another port than 0, but these are not crossed.
pub(crate) fn with_longer_rings(nodes: &[NodeStatus], main_count: usize, closings: &[Closing]) -> Topology {
    let mut topology = Topology::with_local_rings(nodes, main_count, closings);
    let mut closings = closings.to_vec();
    // A ring that is broken at its known closing cable, with an open port at its known tail, is a line that continues
    // there.
    let is_line = |it: &Closing| {
        let head = nodes.get(it.head.node).map(|node| node.dl_status.ports[usize::from(it.head.port & 3)]);
        head.is_some_and(|port| !port.communication)
            && nodes.get(it.tail.node).is_some_and(|node| open(node, it.tail.port))
    };
    let rings: Vec<Closing> = closings.iter().filter(|closing| !is_line(closing)).copied().collect();
    if rings.len() < closings.len() && crossed(&topology).next().is_some() {
        let without = Topology::with_local_rings(nodes, main_count, &rings);
        if crossed(&without).count() < crossed(&topology).count() {
            (topology, closings) = (without, rings);
        }
    }
    for at in 0..closings.len() {
        let Closing { head, tail } = closings[at];
        let Some(first) = nodes.get(head.node) else { continue };
        let passed = nodes.get(tail.node + 1..main_count.min(nodes.len())).unwrap_or_default();
        let is_longer = open(first, head.port) && passed.iter().any(unconnected);
        if !is_longer || crossed(&topology).next().is_none() {
            continue;
        }
        let ends = (tail.node + 1..nodes.len()).take(MOST_LONGER);
        let ends = ends.flat_map(|node| [1, 3, 2].map(|port| PortOf { node, port }));
        for tail in ends.filter(|end| open(&nodes[end.node], end.port)) {
            closings[at].tail = tail;
            let longer = Topology::with_local_rings(nodes, main_count, &closings);
            let is_explained = crossed(&longer).all(|node| node <= head.node || node > tail.node);
            // At most one port stays open: that of the redundant link.
            let is_explained = is_explained && longer.open_ports.len() <= 1;
            if is_explained && crossed(&longer).count() < crossed(&topology).count() {
                topology = longer;
                break;
            }
        }
        closings[at].tail = tail_of(&topology, head).unwrap_or(tail);
    }
    topology
}

/// SubDevices that frames seem to enter at another port than 0.
fn crossed(topology: &Topology) -> impl Iterator<Item = usize> + '_ {
    topology.findings.iter().filter_map(|finding| match finding {
        Finding::CrossedLine { node, .. } | Finding::UnconnectedPort0 { node } => Some(*node),
        _ => None,
    })
}

/// The end of the ring that closes at a port.
fn tail_of(topology: &Topology, head: PortOf) -> Option<PortOf> {
    topology
        .local_rings
        .iter()
        .map(|ring| ring.closing)
        .find(|closing| closing.head == head)
        .map(|closing| closing.tail)
}

/// Number of SubDevices by which a ring may have been extended.
const MOST_LONGER: usize = 64;

/// Steps of a search: enough for all possible closing ports of a ring of a thousand SubDevices.
const STEPS: usize = 200_000;

/// Number of local rings searched.
const MOST_RINGS: usize = 16;

struct Search<'s> {
    nodes: &'s [NodeStatus],
    right: &'s [Closing],
    wrong: &'s [Closing],
    /// Number of ports that stay open in the end.
    spare: usize,
    rings: usize,
    most: usize,
    steps: usize,
    found: Vec<Vec<Closing>>,
}

impl Search<'_> {
    fn go(&mut self, mut node: usize, mut slots: Vec<PortOf>, closings: Vec<Closing>) {
        while self.found.len() < self.most && self.steps > 0 {
            self.steps -= 1;
            if closings.len() < self.rings
                && let Some(closing) = closing_at(&slots, self.nodes).filter(|closing| self.may_be(closing))
            {
                let mut closed = closings.clone();
                closed.push(closing);
                self.go(node, slots[..slots.len() - 2].to_vec(), closed);
                if self.right.contains(&closing) {
                    return;
                }
            }
            let Some(status) = self.nodes.get(node) else {
                if slots.len() == self.spare && closings.len() == self.rings {
                    self.found.push(closings);
                }
                return;
            };
            if node > 0 && !unconnected(status) && slots.pop().is_none() {
                return;
            }
            // Frames pass port 3, then 1, then 2.
            let ports = [2, 1, 3].into_iter().filter(|port| open(status, *port));
            slots.extend(ports.map(|port| PortOf { node, port }));
            node += 1;
        }
    }
}

impl Search<'_> {
    /// Whether a closing cable is neither known to be wrong nor in conflict with a known ring.
    fn may_be(&self, closing: &Closing) -> bool {
        let takes_from =
            |right: &Closing| right != closing && (right.head == closing.head || right.tail == closing.tail);
        !self.wrong.contains(closing) && !self.right.iter().any(takes_from)
    }
}

/// The cable of a frame that leaves through the next slot and returns through the one below it.
fn closing_at(slots: &[PortOf], nodes: &[NodeStatus]) -> Option<Closing> {
    let [.., head, tail] = *slots else { return None };
    // A ring begins at a port that frames pass before the port at which they return.
    let before: &[u8] = match head.port {
        1 => &[3],
        2 => &[3, 1],
        _ => &[],
    };
    let begins = before.iter().any(|port| exists(&nodes[head.node], *port));
    (begins && head.node < tail.node).then_some(Closing { head, tail })
}

fn exists(node: &NodeStatus, port: u8) -> bool {
    use ringcat_wire::register::PortKind::NotImplemented;
    node.ports[usize::from(port)] != NotImplemented || node.ports == [NotImplemented; 4]
}

fn open(node: &NodeStatus, port: u8) -> bool {
    let state = node.dl_status.ports[usize::from(port)];
    exists(node, port) && state.communication && !state.loop_closed
}
