//! The cables of a segment, from its topology, and the error counters of the ports at their ends.
//!
//! The controller that first detects an invalid frame counts it (protocol 2.5), at the receiving end of the cable that
//! damaged the frame. The following controllers count it as a forwarded error, which says nothing about their own
//! cables.

use alloc::vec::Vec;
use core::fmt;

use ringcat_wire::register::ErrorCounters;

use super::Cable;
use crate::link::LinkSet;
use crate::topology::{PortOf, Topology};

/// Errors counted by the ports at both ends of a cable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CableErrors {
    /// Damaged frames received at either end: damaged on this cable.
    pub invalid_frames: u64,
    /// Link losses at either end.
    pub lost_links: u64,
}

/// A cable, and the errors counted at its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CableReport {
    /// The cable.
    pub cable: Cable,
    /// Errors at both ends together.
    pub errors: CableErrors,
}

impl CableReport {
    /// A cable with its errors.
    pub const fn new(cable: Cable, errors: CableErrors) -> CableReport {
        CableReport { cable, errors }
    }
}

impl CableErrors {
    /// All counters zero.
    pub const fn is_none(&self) -> bool {
        self.invalid_frames == 0 && self.lost_links == 0
    }

    /// Sum of both.
    #[must_use]
    pub const fn plus(self, other: CableErrors) -> CableErrors {
        CableErrors {
            invalid_frames: self.invalid_frames + other.invalid_frames,
            lost_links: self.lost_links + other.lost_links,
        }
    }
}

impl fmt::Display for CableErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} damaged frames, {} lost links", self.invalid_frames, self.lost_links)
    }
}

/// Errors counted by one port. Symbol errors are left out: every unplugged cable causes some.
pub fn port_errors(counters: &ErrorCounters, port: u8) -> CableErrors {
    let at = usize::from(port & 3);
    CableErrors { invalid_frames: counters.rx[at].invalid_frames.into(), lost_links: counters.lost_link[at].into() }
}

/// All cables: first the cable to each SubDevice by position, then the closing cables of rings behind junctions, last
/// the cable of the redundant link. Broken cables are included, except a broken cable of a local ring with an unknown
/// end.
pub fn cables(topology: &Topology, links: LinkSet) -> Vec<Cable> {
    let port = |node: usize| PortOf { node, port: topology.nodes[node].entry_port };
    let mut cables = Vec::with_capacity(topology.nodes.len() + 1);
    let is_headed = |node: usize| topology.redundant_head == Some(node);
    let is_swapped = topology.is_assumed() && topology.main_count == 0;
    for (node, it) in topology.nodes.iter().enumerate() {
        let near = match it.parent {
            Some((parent, port)) => Some(PortOf { node: parent, port }),
            None if is_headed(node) => {
                let usual = || last_leaf(topology, topology.main_count).map(|last| loose_end(topology, last));
                topology.main_end.or_else(usual)
            }
            // The interfaces are swapped: all SubDevices process frames of the redundant link.
            None if is_swapped => {
                cables.push(Cable { near: Some(port(node)), far: None });
                continue;
            }
            None if topology.is_behind_unknown_cable(node) => continue,
            None => None,
        };
        cables.push(Cable { near, far: Some(port(node)) });
    }
    let closings = topology.local_rings.iter().map(|ring| ring.closing);
    cables.extend(closings.map(|closing| Cable { near: Some(closing.tail), far: Some(closing.head) }));
    let Some(last) = last_leaf(topology, topology.nodes.len()).filter(|_| links == LinkSet::Ring) else {
        return cables;
    };
    let open = topology.open_ports.first().copied();
    let is_main_whole = topology.main_count == topology.nodes.len();
    let end = open.or(topology.main_end.filter(|_| is_main_whole)).or_else(|| Some(loose_end(topology, last)));
    cables.push(if is_swapped { Cable { near: None, far: end } } else { Cable { near: end, far: None } });
    cables
}

/// End of the line of the first `count` SubDevices: the last one without a successor. It need not be the last by
/// position, because crossed SubDevices process frames on the way back.
fn last_leaf(topology: &Topology, count: usize) -> Option<usize> {
    let is_leaf = |node: &usize| topology.nodes[*node].children.iter().all(Option::is_none);
    (0..count).rev().find(is_leaf).or(count.checked_sub(1))
}

/// The port at which a line ends, among the ports without a neighbour: the usual exit (port 1, for a crossed SubDevice
/// port 0), otherwise the next port in the order of processing.
fn loose_end(topology: &Topology, node: usize) -> PortOf {
    let it = &topology.nodes[node];
    let is_loose = |port: &u8| *port != it.entry_port && it.children[usize::from(*port)].is_none();
    let order = if it.entry_port == 0 { [1, 3, 2, 0] } else { [0, 1, 3, 2] };
    PortOf { node, port: order.into_iter().find(is_loose).unwrap_or(1) }
}

#[cfg(test)]
mod tests {
    use std::string::{String, ToString};
    use std::vec::Vec;

    use ringcat_wire::register::{DlStatus, PortKind};

    use super::*;
    use crate::topology::NodeStatus;

    /// High bytes of DL_STATUS (protocol 2.3).
    fn named(high: &[u8], main_count: usize, links: LinkSet) -> Vec<String> {
        let node = |high: &u8| NodeStatus {
            dl_status: DlStatus::from_bits(u16::from(*high) << 8),
            receive_times: None,
            ports: [PortKind::Mii; 4],
        };
        let nodes: Vec<NodeStatus> = high.iter().map(node).collect();
        let cables = cables(&Topology::build(&nodes, main_count), links);
        cables.iter().map(ToString::to_string).collect()
    }

    const END: u8 = 0x56;
    const PASS: u8 = 0x5A;
    const HEAD: u8 = 0x59;

    // covers: ring-status
    #[test]
    fn a_closed_ring_lists_every_cable() {
        let expected = [
            "between the MAIN interface and SubDevice 0 port 0",
            "between SubDevice 0 port 1 and SubDevice 1 port 0",
            "between SubDevice 1 port 1 and the REDUNDANT interface",
        ];
        assert_eq!(named(&[PASS, PASS], 2, LinkSet::Ring), expected);
    }

    // covers: ring-status
    #[test]
    fn a_broken_cable_is_listed_wherever_it_is() {
        let expected = [
            "between the MAIN interface and SubDevice 0 port 0",
            "between SubDevice 0 port 1 and SubDevice 1 port 0",
            "between SubDevice 1 port 1 and the REDUNDANT interface",
        ];
        assert_eq!(named(&[END, HEAD], 1, LinkSet::Ring), expected);
        assert_eq!(named(&[PASS, END], 2, LinkSet::Ring), expected);
        assert_eq!(named(&[HEAD, PASS], 0, LinkSet::Ring), expected);
    }

    #[test]
    fn a_line_has_no_cable_to_the_redundant_link() {
        assert_eq!(named(&[PASS, END], 2, LinkSet::Single).len(), 2);
    }

    // covers: cable-errors
    #[test]
    fn errors_are_read_from_the_counters_of_the_port() {
        let mut bytes = [0; ErrorCounters::LEN];
        (bytes[2], bytes[0x11]) = (7, 2);
        let counters = ErrorCounters::decode(&bytes);
        let errors = port_errors(&counters, 1);
        assert_eq!(errors, CableErrors { invalid_frames: 7, lost_links: 2 });
        assert_eq!(errors.plus(errors).to_string(), "14 damaged frames, 4 lost links");
        assert!(port_errors(&counters, 0).is_none());
    }
}
