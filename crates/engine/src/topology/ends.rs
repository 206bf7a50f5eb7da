//! The ends of a broken cable, from the port status. They do not depend on the assumed neighbours, which are uncertain
//! while SubDevices are crossed or connected to a port 2 (LC-02).

use alloc::vec::Vec;

use ringcat_wire::register::DlStatus;

use super::{Finding, Node, PortOf, Topology};
use crate::order::InOrder;

/// Both ends of a cable, the end nearer to MAIN first, as far as known. `None` is an interface of the host: MAIN as the
/// first, REDUNDANT as the second end.
pub type Ends = (Option<PortOf>, Option<PortOf>);

/// Whether the neighbours in a ring are an assumption: SubDevices are or may be crossed, or the ring is open and has
/// branches.
pub fn are_doubtful(topology: &Topology) -> bool {
    let odd = |finding: &Finding| matches!(finding, Finding::CrossedLine { .. } | Finding::Inconsistent { .. });
    let was_open = topology.redundant_head.is_some() || topology.open_ports.is_empty();
    let branches = |node: &Node| node.entry_port > 1 || node.children[2..].iter().any(Option::is_some);
    topology.is_assumed()
        || topology.findings.iter().any(odd)
        || (was_open && (topology.nodes.iter().any(branches) || topology.open_ports.iter().any(|at| at.port > 1)))
}

/// The ends of the cable at which a ring is open, from the current port status of all SubDevices. `counts` are the
/// current numbers of SubDevices on each link. All SubDevices must answer: the neighbours of a SubDevice without power
/// are not the ends of one cable.
pub fn ends_of_break(topology: &Topology, dl_status: &[Option<DlStatus>], counts: [u16; 2]) -> Option<Ends> {
    if dl_status.contains(&None) || dl_status.len() != topology.nodes.len() {
        return None;
    }
    let is_down =
        |at: &PortOf| dl_status[at.node].is_some_and(|status| !status.ports[usize::from(at.port & 3)].communication);
    let lost: Vec<PortOf> = connected_ports(topology).into_iter().filter(is_down).collect();
    match (&lost[..], counts) {
        (&[end], [0, _]) => Some((None, Some(end))),
        (&[end], [_, 0]) => Some((Some(end), None)),
        (&[near, far], _) if near.node != far.node => Some((Some(near), Some(far))),
        // The ring was already open there at the last scan.
        (&[], [main, _]) if usize::from(main) == topology.main_count => ends_of_earlier_break(topology, dl_status),
        _ => None,
    }
}

/// Ports that were connected at the last scan, without those of rings behind junctions.
fn connected_ports(topology: &Topology) -> Vec<PortOf> {
    let mut seen = topology.open_ports.clone();
    for (node, it) in topology.nodes.iter().enumerate() {
        // The entry port of a stub's head is at the break.
        let entry = (topology.redundant_head != Some(node)).then_some(it.entry_port);
        let children = (0..4).filter(|port| it.children[usize::from(*port)].is_some());
        seen.extend(children.chain(entry).map(|port| PortOf { node, port }));
    }
    seen.retain(|at| !topology.local_rings.iter().any(|ring| ring.is_at(*at)));
    seen.put_in_order();
    seen.dedup();
    seen
}

/// The ends of a cable that was already broken at the last scan, if they are certain.
pub fn ends_of_earlier_break(topology: &Topology, dl_status: &[Option<DlStatus>]) -> Option<Ends> {
    let is_down = |at: &PortOf| {
        let status = dl_status.get(at.node).copied().flatten();
        status.is_some_and(|status| !status.ports[usize::from(at.port & 3)].communication)
    };
    let near = topology.main_end.filter(is_down);
    match topology.redundant_head {
        Some(head) => {
            let far = PortOf { node: head, port: topology.nodes.get(head)?.entry_port };
            let is_certain = is_down(&far) && (near.is_some() || topology.main_count == 0);
            is_certain.then_some((near, Some(far)))
        }
        None if topology.main_count == 0 => Some((None, Some(near?))),
        None if topology.main_count == topology.nodes.len() && topology.open_ports.is_empty() => {
            Some((Some(near?), None))
        }
        None => None,
    }
}
