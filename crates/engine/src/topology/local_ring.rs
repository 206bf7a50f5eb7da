//! Rings behind a junction (facts 9.4): how they lie in the tree, and which cables they have.
//!
//! A local ring leaves its junction through one port, passes its members, and comes back through a later one; frames
//! meet the members in the same order whether it is whole or broken at one place. So the tree has it as a branch on the
//! port where it begins, with the two ports of the closing cable left out: whole and broken, it reads the same.

use alloc::vec::Vec;

use super::place::Walk;
use super::{Finding, NodeStatus, PortOf, Topology};

/// The cable through which a local ring comes back to its junction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Closing {
    /// The junction, and the port at which frames come back.
    pub head: PortOf,
    /// The last SubDevice of the ring, and the port through which they leave it.
    pub tail: PortOf,
}

/// A cable of a local ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct RingCable {
    /// The port from which frames come. `None` where it is not known: the ring was broken there when it was looked at.
    pub near: Option<PortOf>,
    /// The port that they reach.
    pub far: PortOf,
}

/// A ring behind a junction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocalRing {
    /// Where it closes.
    pub closing: Closing,
    /// Its cables in the order in which frames run, the closing one last. From the break on where it was broken when it
    /// was looked at.
    pub cables: Vec<RingCable>,
}

impl LocalRing {
    /// Whether one of its cables ends at a port.
    pub fn is_at(&self, at: PortOf) -> bool {
        self.cables.iter().any(|cable| cable.near == Some(at) || cable.far == at)
    }
}

/// The local rings among the SubDevices that frames meet in this order.
#[derive(Clone, Debug, Default)]
pub(super) struct Rings {
    closings: Vec<Closing>,
    /// Members of broken rings that have nothing on their port 0.
    pub(super) orphans: Vec<usize>,
    /// SubDevices whose receive times say nothing about their place: some port never receives, or frames pass twice.
    pub(super) untimed: Vec<bool>,
}

impl Rings {
    /// Rings that close like this. A broken one is that which holds a SubDevice with nothing on its port 0.
    pub(super) fn new(status: &[NodeStatus], closings: &[Closing]) -> Rings {
        let count = status.len();
        let fits = |closing: &&Closing| closing.head.node < closing.tail.node && closing.tail.node < count;
        let closings: Vec<Closing> = closings.iter().filter(fits).copied().collect();
        let mut rings = Rings { closings, orphans: Vec::new(), untimed: alloc::vec![false; count] };
        for (node, status) in status.iter().enumerate() {
            if unconnected(status) && rings.around(node).is_some() {
                rings.orphans.push(node);
            }
        }
        for closing in &rings.closings {
            rings.untimed[closing.head.node..=closing.tail.node].fill(true);
        }
        rings
    }

    /// The innermost ring of which a SubDevice is a member.
    fn around(&self, node: usize) -> Option<&Closing> {
        let holds = |closing: &&Closing| closing.head.node < node && node <= closing.tail.node;
        self.closings.iter().filter(holds).max_by_key(|closing| closing.head.node)
    }

    /// Whether a port belongs to a closing cable.
    pub(super) fn closes(&self, node: usize, port: u8) -> bool {
        let at = PortOf { node, port };
        self.closings.iter().any(|closing| closing.head == at || closing.tail == at)
    }

    /// The rings with their cables, from the tree in which they are branches.
    pub(super) fn finish(&self, topology: &mut Topology) {
        topology.local_rings = self.closings.iter().map(|closing| trace(topology, *closing)).collect();
    }
}

/// Nothing leads to its port 0, though frames reach it.
pub(super) fn unconnected(status: &NodeStatus) -> bool {
    let port = status.dl_status.ports[0];
    !port.communication || port.loop_closed
}

impl Topology {
    /// Whether a SubDevice is a member of a local ring that is broken before it, from where is not known.
    pub(crate) fn is_behind_unknown_cable(&self, node: usize) -> bool {
        let mut cables = self.local_rings.iter().flat_map(|ring| &ring.cables);
        cables.any(|cable| cable.near.is_none() && cable.far.node == node)
    }

    /// Hangs a member of a broken local ring where the cable begins that is broken: as it hangs when the ring is whole.
    pub fn hang_behind_break(&mut self, near: PortOf, node: usize) {
        let port = usize::from(near.port & 3);
        let is_free = self.nodes.get(near.node).is_some_and(|parent| parent.children[port].is_none());
        match self.nodes.get_mut(node).filter(|orphan| is_free && orphan.parent.is_none()) {
            Some(orphan) => orphan.parent = Some((near.node, near.port)),
            None => return,
        }
        self.nodes[near.node].children[port] = Some(node);
        self.local_rings = self.local_rings.iter().map(|ring| trace(self, ring.closing)).collect();
    }
}

/// Follows the tree from the tail up to the junction, or to the break.
fn trace(topology: &Topology, closing: Closing) -> LocalRing {
    let mut cables = alloc::vec![RingCable { near: Some(closing.tail), far: closing.head }];
    let mut node = closing.tail.node;
    while node > closing.head.node {
        let Some(here) = topology.nodes.get(node) else { break };
        let near = here.parent.map(|(node, port)| PortOf { node, port });
        cables.push(RingCable { near, far: PortOf { node, port: here.entry_port } });
        let Some(parent) = near else { break };
        node = parent.node;
    }
    cables.reverse();
    LocalRing { closing, cables }
}

/// Sets of closing cables that would explain the open ports, those first whose tails are met early; at most `most`.
///
/// Open ports alone do not tell where a ring ends: whatever follows the junction could as well hang on its last member.
/// Whoever asks has to find out which of these it is. Where the redundant link meets somebody (a broken ring, or branches
/// that only its frames meet), nothing is looked for.
pub fn candidates(nodes: &[NodeStatus], main_count: usize, ring_closed: bool, most: usize) -> Vec<Vec<Closing>> {
    candidates_with(nodes, main_count, ring_closed, most, (&[], &[]))
}

/// As [`candidates`], with those among them that are known to be right, and without those known to be wrong.
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

/// How many rings behind junctions the open ports show: each has two more than its members need.
pub(crate) fn rings_shown(nodes: &[NodeStatus], ring_closed: bool) -> usize {
    let further = |node: &NodeStatus| (1..4).filter(|port| open(node, *port)).count();
    let open_ports: usize = nodes.iter().map(further).sum();
    let hanging = nodes.iter().skip(1).filter(|node| !unconnected(node)).count();
    open_ports.saturating_sub(usize::from(ring_closed) + hanging) / 2
}

/// The cabling with these rings, also where one has been made longer behind its known tail and is broken: frames come from
/// where it closes though somebody behind the tail has nothing on port 0. Members that nobody knows of are entered from behind then, and
/// not crossed.
pub(crate) fn with_longer_rings(nodes: &[NodeStatus], main_count: usize, closings: &[Closing]) -> Topology {
    let mut topology = Topology::with_local_rings(nodes, main_count, closings);
    let mut closings = closings.to_vec();
    // Broken where it closes now, it is a line that leads on behind its known tail.
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
        let met = nodes.get(tail.node + 1..main_count.min(nodes.len())).unwrap_or_default();
        let is_longer = open(first, head.port) && met.iter().any(unconnected);
        if !is_longer || crossed(&topology).next().is_none() {
            continue;
        }
        let ends = (tail.node + 1..nodes.len()).take(MOST_LONGER);
        let ends = ends.flat_map(|node| [1, 3, 2].map(|port| PortOf { node, port }));
        for tail in ends.filter(|end| open(&nodes[end.node], end.port)) {
            closings[at].tail = tail;
            let longer = Topology::with_local_rings(nodes, main_count, &closings);
            let is_explained = crossed(&longer).all(|node| node <= head.node || node > tail.node);
            // No more is left open than what leads to the redundant link.
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

/// Who is entered at another port than 0, as it seems.
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

/// SubDevices by which a ring may have been made longer.
const MOST_LONGER: usize = 64;
/// Steps of a search: enough for all places where a ring of a thousand SubDevices may close.
const STEPS: usize = 200_000;
/// Local rings that are looked for.
const MOST_RINGS: usize = 16;

struct Search<'s> {
    nodes: &'s [NodeStatus],
    right: &'s [Closing],
    wrong: &'s [Closing],
    /// Ports that stay open in the end.
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
    /// Neither wrong nor in the place of one that is right.
    fn may_be(&self, closing: &Closing) -> bool {
        let takes_from =
            |right: &Closing| right != closing && (right.head == closing.head || right.tail == closing.tail);
        !self.wrong.contains(closing) && !self.right.iter().any(takes_from)
    }
}

/// The cable that a frame would take if it left through the next slot and came back through the one below it.
fn closing_at(slots: &[PortOf], nodes: &[NodeStatus]) -> Option<Closing> {
    let [.., head, tail] = *slots else { return None };
    // A ring begins at a port that frames pass before the one at which they come back.
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

impl Walk<'_> {
    /// Hangs a member of a broken ring that has nothing on its port 0 nowhere, as if it were entered there.
    pub(super) fn orphan(&mut self, node: usize) {
        self.hang(node, None, 0);
        self.expect_children(node, 0);
    }
}
