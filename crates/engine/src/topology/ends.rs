//! The ends of a broken cable by what the ports themselves say: it does not depend on who was taken for whose neighbour, which
//! is an assumption while SubDevices are crossed or hang on a port 2 (LC-02).

use alloc::vec::Vec;

use ringcat_wire::register::DlStatus;

use super::{Finding, PortOf, Topology};

/// Both ends of a cable, the first nearer to MAIN as far as that is known. `None` is an interface: MAIN where it is the first
/// one, REDUNDANT the second.
pub type Ends = (Option<PortOf>, Option<PortOf>);

/// Whether neighbours in a ring are an assumption.
pub fn are_doubtful(topology: &Topology) -> bool {
    let odd = |finding: &Finding| matches!(finding, Finding::CrossedLine { .. } | Finding::Inconsistent { .. });
    topology.is_assumed() || topology.findings.iter().any(odd)
}

/// The ends of the cable at which a ring is open, from the ports of all SubDevices now. `counts` is how many of them live on each
/// link now. Both ends have to be seen, and everybody: the neighbours of one without power are not the ends of one
/// cable.
pub fn ends_of_break(topology: &Topology, dl_status: &[Option<DlStatus>], counts: [u16; 2]) -> Option<Ends> {
    if dl_status.contains(&None) || dl_status.len() != topology.nodes.len() {
        return None;
    }
    let is_down =
        |at: &PortOf| dl_status[at.node].is_some_and(|status| !status.ports[usize::from(at.port & 3)].communication);
    let lost: Vec<PortOf> = seen(topology).into_iter().filter(is_down).collect();
    match (&lost[..], counts) {
        (&[end], [0, _]) => Some((None, Some(end))),
        (&[end], [_, 0]) => Some((Some(end), None)),
        (&[near, far], _) if near.node != far.node => Some((Some(near), Some(far))),
        // It was open there when it was looked at.
        (&[], [main, redundant]) if usize::from(main) == topology.main_count => {
            let near = loose_end(dl_status, 0..topology.main_count);
            let far = loose_end(dl_status, topology.main_count..dl_status.len());
            match (near, far) {
                (Some(near), _) if redundant == 0 => Some((Some(near), None)),
                (_, Some(far)) if main == 0 => Some((None, Some(far))),
                (Some(near), Some(far)) => Some((Some(near), Some(far))),
                _ => None,
            }
        }
        _ => None,
    }
}

/// Ports that led somewhere when the segment was looked at, those of rings behind junctions left out.
fn seen(topology: &Topology) -> Vec<PortOf> {
    let mut seen = topology.open_ports.clone();
    for (node, it) in topology.nodes.iter().enumerate() {
        // The head of a stub is entered from the break.
        let entry = (topology.redundant_head != Some(node)).then_some(it.entry_port);
        let children = (0..4).filter(|port| it.children[usize::from(*port)].is_some());
        seen.extend(children.chain(entry).map(|port| PortOf { node, port }));
    }
    seen.retain(|at| !topology.local_rings.iter().any(|ring| ring.is_at(*at)));
    seen.sort_unstable();
    seen.dedup();
    seen
}

/// Where a stub without branches ends: the one SubDevice with a single port that leads on, and its other port, the usual way on
/// where that is any.
fn loose_end(dl_status: &[Option<DlStatus>], stub: core::ops::Range<usize>) -> Option<PortOf> {
    let mut ends = stub.filter_map(|node| {
        let ports = dl_status[node]?.ports;
        let mut open = (0..4u8).filter(|port| ports[usize::from(*port)].communication);
        match (open.next(), open.next()) {
            (Some(only), None) => Some(PortOf { node, port: if only == 0 { 1 } else { 0 } }),
            _ => None,
        }
    });
    let end = ends.next()?;
    ends.next().is_none().then_some(end)
}
