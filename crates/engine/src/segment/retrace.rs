//! Known rings behind junctions in a rescanned segment: where they close now, and where they are broken.
//!
//! Hot connect groups may be parts of them. A ring without its last SubDevices ends at the SubDevice before these. No
//! port shows the cable to the SubDevice behind a break: it is traced from the junction on, along the previous members
//! and new ones, as long as there is only one possibility.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::PortKind;

use super::cabling::{Cabling, End};
use super::view::position;
use crate::junction::{HEAD_PORT, START_PORT};
use crate::topology::{Closing, LocalRing, NodeStatus, PortOf, Topology};

/// The places where the known rings close in a segment with these SubDevices, by position.
pub fn closings(known: &Cabling, stations: &[StationAddress]) -> Vec<Closing> {
    let place = |(station, port): End| Some(PortOf { node: position(stations, station)?, port });
    let known = known.closings.iter().filter_map(|[head, tail]| {
        let head_now = place(*head)?;
        // Its last members may have left.
        let left = || before(known, *head)?.cables.iter().rev().find_map(|cable| place(end(known, cable.near?)?));
        let tail = place(*tail).or_else(left)?;
        (head_now.node < tail.node).then_some(Closing { head: head_now, tail })
    });
    known.collect()
}

/// The cabling of a segment with these SubDevices and these rings. SubDevices behind a break are placed as in the whole
/// ring, as far as this is known.
pub fn cabling(known: &Cabling, stations: &[StationAddress], status: &[NodeStatus], main_count: usize) -> Topology {
    let mut topology = Topology::with_local_rings(status, main_count, &closings(known, stations));
    for at in 0..topology.local_rings.len() {
        let ring = &topology.local_rings[at];
        let Some(orphan) = ring.cables.first().filter(|cable| cable.near.is_none()).map(|cable| cable.far.node) else {
            continue;
        };
        if let Some(near) = last_before_break(known, stations, status, &topology, ring) {
            topology.attach_behind_break(near, orphan);
        }
    }
    topology
}

/// The port at which the members before a break end.
fn last_before_break(
    known: &Cabling,
    stations: &[StationAddress],
    status: &[NodeStatus],
    topology: &Topology,
    ring: &LocalRing,
) -> Option<PortOf> {
    let head = ring.closing.head;
    let ring_before = before(known, (*stations.get(head.node)?, head.port));
    // The port at which the ring left a SubDevice when it was seen last.
    let port_before = |node: usize| {
        let cables = ring_before.map(|ring| ring.cables.as_slice()).unwrap_or_default();
        let nears = cables.iter().filter_map(|cable| end(known, cable.near?));
        nears.into_iter().find(|(station, _)| stations.get(node) == Some(station)).map(|(_, port)| port)
    };
    let is_member = |node: usize| head.node < node && node <= ring.closing.tail.node;
    let begin = || {
        let children = topology.nodes[head.node].children;
        let begins = (0..4).find(|port| children[usize::from(*port)].is_some_and(is_member));
        begins.or_else(|| (head.port == HEAD_PORT).then_some(START_PORT))
    };
    let mut at = PortOf { node: head.node, port: port_before(head.node).or_else(begin)? };
    for _ in 0..topology.nodes.len() {
        let Some(next) = topology.nodes[at.node].children[usize::from(at.port & 3)] else {
            return Some(at);
        };
        let port = port_before(next).or_else(|| only_way_on(topology, status, next))?;
        at = PortOf { node: next, port };
    }
    None
}

/// The port at which a line continues or ends behind a SubDevice, if there is only one possibility.
fn only_way_on(topology: &Topology, status: &[NodeStatus], node: usize) -> Option<u8> {
    let here = topology.nodes.get(node)?;
    let kinds = status.get(node)?.ports;
    let exists =
        |port: &u8| kinds[usize::from(*port)] != PortKind::NotImplemented || kinds == [PortKind::NotImplemented; 4];
    let taken: Vec<u8> = (0..4).filter(|port| here.children[usize::from(*port)].is_some()).collect();
    match taken[..] {
        [] => [1, 3, 2].into_iter().find(|port| *port != here.entry_port && exists(port)),
        [1] => Some(1),
        _ => None,
    }
}

/// The previously known ring that closes at a port of a junction.
fn before(known: &Cabling, head: End) -> Option<&LocalRing> {
    known.topology.local_rings.iter().find(|ring| end(known, ring.closing.head) == Some(head))
}

fn end(known: &Cabling, at: PortOf) -> Option<End> {
    Some((*known.stations.get(at.node)?, at.port))
}
