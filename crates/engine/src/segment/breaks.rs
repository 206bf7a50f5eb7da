//! Places of breaks of the ring according to the ports of SubDevices.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::register::DlStatus;

use crate::ring::RingState;
use crate::ring_status::Cable;
use crate::topology::{PortOf, Topology, ends_of_earlier_break};

/// Breaks as reported.
#[derive(Debug, Default)]
pub(super) struct Breaks {
    /// The state of the ring at the last evaluation.
    pub state: RingState,
    /// Remaining scans for a place.
    pub readings: u8,
    /// Broken cables of the open ring that were reported.
    pub reported: Vec<Cable>,
}

/// The cables of the ring that no longer have communication, in its order. Branches are excluded: SubDevices behind a
/// broken branch are reported as lost. `dl_status` by position.
pub(super) fn locate_breaks(topology: &Topology, dl_status: &[Option<DlStatus>]) -> Vec<Cable> {
    let Some(first) = topology.nodes.first() else { return Vec::new() };
    let trunk = trunk(topology);
    let first = Cable { near: None, far: Some(PortOf { node: 0, port: first.entry_port }) };
    let inner = (0..topology.nodes.len()).filter(|node| trunk[*node] && !topology.has_ring_cable(*node));
    let inner = inner.filter_map(|node| topology.cable_to(node));
    let inner = inner.map(|it| Cable { near: Some(it.near), far: Some(it.far) });
    let last = topology.open_ports.iter().map(|at| Cable { near: Some(*at), far: None });
    // One end is sufficient: the SubDevice at the other may have no power.
    let all = core::iter::once(first).chain(inner).chain(last);
    let mut broken: Vec<Cable> = all.filter(|cable| is_broken(dl_status, cable) == Some(true)).collect();
    if broken.is_empty() {
        broken.extend(ends_of_earlier_break(topology, dl_status).map(|(near, far)| Cable { near, far }));
    }
    broken
}

/// Whether a cable has no communication at one of its ends, as far as known.
pub(super) fn is_broken(dl_status: &[Option<DlStatus>], cable: &Cable) -> Option<bool> {
    let ends = [cable.near, cable.far].into_iter().flatten().filter_map(|at| communicates(dl_status, at));
    ends.reduce(|one, other| one && other).map(|communicates| !communicates)
}

/// SubDevices on the path between the interfaces, by position; all if that path is not known.
fn trunk(topology: &Topology) -> Vec<bool> {
    let mut trunk = vec![false; topology.nodes.len()];
    let mut follow = |end: Option<usize>| {
        let mut next = end;
        while let Some(node) = next.filter(|node| !core::mem::replace(&mut trunk[*node], true)) {
            next = topology.nodes[node].parent.map(|(parent, _)| parent);
        }
    };
    let end = topology.open_ports.last().map(|at| at.node);
    follow(end);
    if topology.redundant_head.is_some() {
        follow(topology.main_count.checked_sub(1));
    }
    if end.is_none() {
        trunk.fill(true);
    }
    trunk
}

/// Whether a port has communication, if known.
fn communicates(dl_status: &[Option<DlStatus>], at: PortOf) -> Option<bool> {
    let status = dl_status.get(at.node).copied().flatten()?;
    Some(status.ports[usize::from(at.port & 3)].communication)
}
