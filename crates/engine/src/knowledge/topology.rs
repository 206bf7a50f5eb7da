//! Connections of SubDevices as bytes. A tree is checked when it is decoded: every procedure relies on it.

use alloc::vec;
use alloc::vec::Vec;

use super::code::{Input, choice, fields};
use super::error::KnowledgeError;
use crate::topology::{Closing, Finding, LocalRing, Node, PortOf, RingCable, Topology};

/// Ports of a controller.
const PORTS: u8 = 4;

fields!(PortOf { node: usize, port: u8 });
fields!(Node { parent: Option<(usize, u8)>, entry_port: u8, children: [Option<usize>; 4] });
fields!(Closing { head: PortOf, tail: PortOf });
fields!(RingCable { near: Option<PortOf>, far: PortOf });
fields!(LocalRing { closing: Closing, cables: Vec<RingCable> });
fields!(Topology {
    nodes: Vec<Node>,
    main_count: usize,
    redundant_head: Option<usize>,
    main_end: Option<PortOf>,
    open_ports: Vec<PortOf>,
    findings: Vec<Finding>,
    local_rings: Vec<LocalRing>,
});
choice!(Finding, "a finding about the cabling" {
    0 = UnconnectedPort0 { node: usize },
    1 = CrossedLine { node: usize, entry_port: u8 },
    2 = ForcedOpen { node: usize, port: u8 },
    3 = ClosedWithLink { node: usize, port: u8 },
    4 = LinkWithoutCommunication { node: usize, port: u8 },
    5 = Inconsistent { node: usize },
});

/// Takes the connections of this number of SubDevices.
pub(super) fn take_checked(input: &mut Input<'_>, count: usize) -> Result<Topology, KnowledgeError> {
    use super::code::Code;
    let nodes = input.expected("connections of as many SubDevices as are known");
    let ports = input.expected("ports of known SubDevices");
    let tree = input.expected("a tree: each SubDevice at one port of its parent, without a circle");
    let topology = Topology::take(input)?;
    if topology.nodes.len() != count || topology.main_count > count {
        return Err(nodes);
    }
    if !are_ports_valid(&topology) {
        return Err(ports);
    }
    if is_tree(&topology.nodes) { Ok(topology) } else { Err(tree) }
}

/// Whether all positions and ports exist.
fn are_ports_valid(topology: &Topology) -> bool {
    let Topology { nodes, redundant_head, main_end, open_ports, findings, local_rings, .. } = topology;
    let count = nodes.len();
    let is_port = |at: &PortOf| at.node < count && at.port < PORTS;
    let is_ring = |ring: &LocalRing| {
        let cables = ring.cables.iter().flat_map(|cable| [cable.near, Some(cable.far)]);
        cables.chain([Some(ring.closing.head), Some(ring.closing.tail)]).flatten().all(|at| is_port(&at))
    };
    let is_finding = |finding: &Finding| {
        let port = match *finding {
            Finding::UnconnectedPort0 { .. } | Finding::Inconsistent { .. } => 0,
            Finding::CrossedLine { entry_port: port, .. }
            | Finding::ForcedOpen { port, .. }
            | Finding::ClosedWithLink { port, .. }
            | Finding::LinkWithoutCommunication { port, .. } => port,
        };
        finding.node() < count && port < PORTS
    };
    redundant_head.is_none_or(|head| head < count)
        && main_end.iter().chain(open_ports).all(is_port)
        && findings.iter().all(is_finding)
        && local_rings.iter().all(is_ring)
}

/// Whether parents and children agree, and no SubDevice is behind itself.
fn is_tree(nodes: &[Node]) -> bool {
    let is_child = |(number, node): (usize, &Node)| match node.parent {
        None => true,
        Some((parent, port)) => {
            let children = nodes.get(parent).map(|parent| &parent.children);
            children.and_then(|all| *all.get(usize::from(port))?) == Some(number)
        }
    };
    let is_parent = |(number, node): (usize, &Node)| {
        let children = (0..PORTS).zip(&node.children);
        children
            .filter_map(|(port, child)| Some((port, (*child)?)))
            .all(|(port, child)| nodes.get(child).is_some_and(|child| child.parent == Some((number, port))))
    };
    nodes.iter().all(|node| node.entry_port < PORTS)
        && nodes.iter().enumerate().all(is_child)
        && nodes.iter().enumerate().all(is_parent)
        && are_rooted(nodes)
}

/// Whether each way through parents ends.
fn are_rooted(nodes: &[Node]) -> bool {
    let mut seen = vec![0; nodes.len()];
    for (number, start) in (1..).zip(0..nodes.len()) {
        let mut at = start;
        while seen[at] == 0 {
            seen[at] = number;
            let Some((parent, _)) = nodes[at].parent else { break };
            at = parent;
            if seen[at] == number {
                return false;
            }
        }
    }
    true
}
