//! Local rings during and after the construction of a tree: their members, and their cables in it.

use alloc::vec::Vec;

use super::local_ring::{Closing, LocalRing, RingCable};
use super::port::PortOf;
use super::tree::{NodeStatus, Topology};

/// The local rings among the SubDevices, in the order in which frames pass them.
#[derive(Clone, Debug, Default)]
pub(super) struct Rings {
    closings: Vec<Closing>,
    /// Members of broken rings with port 0 unconnected.
    pub(super) orphans: Vec<usize>,
    /// By position: receive times do not show the place of the SubDevice, because some port never receives or frames
    /// pass twice.
    pub(super) untimed: Vec<bool>,
}

impl Rings {
    /// Rings with these closing cables. A ring is broken if it has a SubDevice with port 0 unconnected.
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

/// Whether port 0 is unconnected, although frames reach the SubDevice.
pub(super) fn unconnected(status: &NodeStatus) -> bool {
    let port = status.dl_status.ports[0];
    !port.communication || port.loop_closed
}

impl Topology {
    /// Whether a SubDevice is a member of a local ring that is broken before it, with an unknown other end.
    pub(crate) fn is_behind_unknown_cable(&self, node: usize) -> bool {
        let mut cables = self.local_rings.iter().flat_map(|ring| &ring.cables);
        cables.any(|cable| cable.near.is_none() && cable.far.node == node)
    }

    /// Attaches a member of a broken local ring to the near end of the broken cable: its place in the closed ring.
    pub(crate) fn attach_behind_break(&mut self, near: PortOf, node: usize) {
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
