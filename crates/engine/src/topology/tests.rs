use std::string::ToString;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;
use ringcat_wire::address::Position;
use ringcat_wire::register::{DlStatus, PortKind};

use super::port::Connection;
use super::{Finding, Node, NodeStatus, PortOf, Topology};
use walk_model::{End, Segment};

mod local_rings;
mod walk_model;

/// A SubDevice with this high byte of DL_STATUS (protocol 2.3), and a link on each port with communication.
fn status(high: u8) -> NodeStatus {
    let links = (0..4).filter(|port| high >> (2 * port + 1) & 1 != 0).map(|port| 0x10 << port).sum::<u16>();
    node(u16::from(high) << 8 | links)
}

fn node(bits: u16) -> NodeStatus {
    NodeStatus { dl_status: DlStatus::from_bits(bits), receive_times: None, ports: [PortKind::Mii; 4] }
}

const END: u8 = 0x56;
const PASS: u8 = 0x5A;
const HEAD: u8 = 0x59;

const fn at(node: usize, port: u8) -> PortOf {
    PortOf { node, port }
}

fn parents(topology: &Topology) -> Vec<Option<(usize, u8)>> {
    topology.nodes.iter().map(|node| node.parent).collect()
}

#[test]
fn a_line_of_three_connects_port_1_to_port_0() {
    let topology = Topology::build(&[status(PASS), status(PASS), status(END)], 3);
    assert_eq!(parents(&topology), [None, Some((0, 1)), Some((1, 1))]);
    assert_eq!(topology.nodes[1], Node { parent: Some((0, 1)), entry_port: 0, children: [None, Some(2), None, None] });
    assert_eq!((topology.open_ports, topology.findings), (vec![], vec![]));
}

#[test]
fn a_closed_ring_leaves_the_port_of_the_redundant_link_open() {
    let topology = Topology::build(&[status(PASS), status(PASS)], 2);
    assert_eq!(topology.open_ports, [at(1, 1)]);
    assert_eq!((topology.redundant_head, topology.findings), (None, vec![]));
}

#[test]
fn a_ring_cut_between_1_and_2_has_a_stub_whose_head_is_next_to_the_break() {
    let topology = Topology::build(&[status(PASS), status(END), status(HEAD), status(PASS)], 2);
    assert_eq!(parents(&topology), [None, Some((0, 1)), None, Some((2, 1))]);
    assert_eq!(topology.redundant_head, Some(2));
    assert_eq!(topology.open_ports, [at(3, 1)]);
    assert_eq!(topology.findings, []);
}

#[test]
fn a_ring_cut_at_the_main_link_is_one_stub() {
    let topology = Topology::build(&[status(HEAD), status(PASS)], 0);
    assert_eq!(parents(&topology), [None, Some((0, 1))]);
    assert_eq!((topology.redundant_head, topology.findings), (Some(0), vec![]));
}

#[test]
fn a_line_on_the_redundant_link_alone_is_a_line() {
    let topology = Topology::build(&[status(PASS), status(END)], 0);
    assert_eq!(parents(&topology), [None, Some((0, 1))]);
    assert_eq!((topology.redundant_head, topology.findings), (None, vec![]));
}

#[test]
fn a_closed_port_with_link_is_a_finding() {
    // 0xD6: port 0 open, port 3 has communication but is closed.
    let topology = Topology::build(&[status(0xD6)], 1);
    assert_eq!(topology.findings, [Finding::ClosedWithLink { node: 0, port: 3 }]);
}

#[test]
fn a_forced_open_port_and_a_link_without_communication_are_findings() {
    // Port 1 open without communication; link bit of port 2 without communication.
    let topology = Topology::build(&[node(0x5250 | 0x0040)], 1);
    let expected = [Finding::ForcedOpen { node: 0, port: 1 }, Finding::LinkWithoutCommunication { node: 0, port: 2 }];
    assert_eq!(topology.findings, expected);
}

#[test]
fn a_junction_has_its_branches_in_the_order_3_1_2() {
    // Ports 0..3 open, then three ends.
    let topology = Topology::build(&[status(0xAA), status(END), status(END), status(END)], 4);
    assert_eq!(parents(&topology), [None, Some((0, 3)), Some((0, 1)), Some((0, 2))]);
    assert_eq!(topology.findings, []);
}

#[test]
fn a_branch_on_port_2_of_a_closed_ring_is_on_the_redundant_link() {
    // Protocol 2.9: S5 on port 2 of S2; the main copy visits 1 2 3 4 and leaves at S4 port 1, the other one visits S5.
    let nodes = [status(PASS), status(0x6A), status(PASS), status(PASS), status(END)];
    let topology = Topology::build(&nodes, 4);
    assert_eq!(parents(&topology), [None, Some((0, 1)), Some((1, 1)), Some((2, 1)), Some((1, 2))]);
    assert_eq!(topology.open_ports, [at(3, 1)]);
    assert_eq!((topology.redundant_head, topology.findings), (None, vec![]));
}

#[test]
fn a_branch_on_port_2_of_a_stub_precedes_its_head() {
    // Protocol 2.9, break between S1 and S2: main 1, redundant 5 2 3 4.
    let nodes = [status(END), status(END), status(0x69), status(PASS), status(PASS)];
    let topology = Topology::build(&nodes, 1);
    assert_eq!(parents(&topology), [None, Some((2, 2)), None, Some((2, 1)), Some((3, 1))]);
    assert_eq!(topology.redundant_head, Some(2));
    assert_eq!((topology.open_ports, topology.findings), (vec![at(4, 1)], vec![]));
}

#[test]
fn a_crossed_subdevice_in_a_line_is_a_finding_without_receive_times() {
    // LC-07: S3 crossed, the line visits 1 2 4 3.
    let topology = Topology::build(&[status(PASS), status(PASS), status(END), status(PASS)], 4);
    assert_eq!(parents(&topology), [None, Some((0, 1)), Some((3, 0)), Some((1, 1))]);
    assert_eq!(topology.findings, [Finding::CrossedLine { node: 3, entry_port: 1 }]);
}

#[test]
fn a_crossed_subdevice_in_a_closed_ring_is_found() {
    // LC-07: S3 crossed, main 1 2 4, redundant 3.
    let topology = Topology::build(&[status(PASS), status(PASS), status(PASS), status(PASS)], 3);
    assert_eq!(topology.findings, [Finding::CrossedLine { node: 3, entry_port: 1 }]);
    assert_eq!(topology.open_ports, [at(2, 1)]);
}

#[test]
fn an_unconnected_port_0_at_the_end_of_a_line_is_a_finding() {
    // Protocol 2.9: S2 and S3 entered at port 1, port 0 of S3 unconnected: visits 1 3 2.
    let topology = Topology::build(&[status(PASS), status(HEAD), status(PASS)], 3);
    assert_eq!(parents(&topology), [None, Some((2, 0)), Some((0, 1))]);
    let expected = [
        Finding::UnconnectedPort0 { node: 1 },
        Finding::CrossedLine { node: 1, entry_port: 1 },
        Finding::CrossedLine { node: 2, entry_port: 1 },
    ];
    assert!(expected.iter().all(|finding| topology.findings.contains(finding)), "{:?}", topology.findings);
    assert_eq!(topology.findings.len(), 3);
}

#[test]
fn receive_times_are_compared_across_the_wrap_of_the_clock() {
    let mut crossed = status(PASS);
    crossed.receive_times = Some([0x0000_0010, 0xFFFF_FFF0, 0, 0]);
    let mut straight = status(PASS);
    straight.receive_times = Some([0xFFFF_FFF0, 0x0000_0010, 0, 0]);
    let ends = [straight, status(END), crossed];
    let topology = Topology::build(&ends, 3);
    assert_eq!(topology.findings, [Finding::CrossedLine { node: 2, entry_port: 1 }]);
    assert_eq!(Topology::build(&[straight, status(END)], 2).findings, []);
}

#[test]
fn more_subdevices_than_open_ports_are_inconsistent() {
    let topology = Topology::build(&[status(END), status(END)], 2);
    assert_eq!(topology.findings, [Finding::Inconsistent { node: 1 }]);
}

#[test]
fn connections_are_found_and_displayed_by_subdevice_and_port() {
    let topology = Topology::build(&[status(PASS), status(PASS), status(END)], 3);
    let connection = Connection { near: at(1, 1), far: at(2, 0) };
    assert_eq!(topology.connection_to(Position(2)), Some(connection));
    assert_eq!(connection.to_string(), "between SubDevice 1 port 1 and SubDevice 2 port 0");
}

/// A random tree with every port 0 towards the main link: each SubDevice is connected to a free port of an earlier one.
fn trees() -> impl Strategy<Value = Segment> {
    proptest::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>()), 0..24).prop_map(|picks| {
        let mut segment = Segment::new();
        segment.add(End::Main, 0);
        for (node, port) in picks {
            let free = segment.free_ports();
            let near: Vec<usize> = free.iter().map(|(node, _)| *node).collect();
            let chosen = near[node.index(near.len())];
            let ports: Vec<u8> = free.iter().filter(|(n, _)| *n == chosen).map(|(_, port)| *port).collect();
            segment.add(End::Port(chosen, ports[port.index(ports.len())]), 0);
        }
        segment
    })
}

proptest! {
    // covers: topology
    #[test]
    fn any_tree_is_rebuilt_from_its_dl_status(segment in trees(), times in any::<bool>()) {
        let seen = segment.walk();
        prop_assert_eq!(seen.main_count, segment.len());
        let topology = Topology::build(&seen.status(times), seen.main_count);
        prop_assert_eq!(parents(&topology), seen.parents(&segment));
        prop_assert_eq!(&topology.findings, &[]);
        prop_assert_eq!(&topology.open_ports, &[]);
    }

    // covers: topology
    #[test]
    fn any_closed_ring_is_rebuilt_from_its_dl_status(
        mut segment in trees(), tail in any::<prop::sample::Index>(), times in any::<bool>()
    ) {
        let free = segment.free_ports();
        let (node, port) = free[tail.index(free.len())];
        segment.connect(End::Port(node, port), End::Redundant);
        let seen = segment.walk();
        let topology = Topology::build(&seen.status(times), seen.main_count);
        prop_assert_eq!(parents(&topology), seen.parents(&segment));
        prop_assert_eq!(&topology.findings, &[]);
        prop_assert_eq!(&topology.open_ports, &[at(seen.order.iter().position(|n| *n == node).unwrap(), port)]);
    }

    // covers: topology
    #[test]
    fn any_ring_cut_anywhere_is_rebuilt_with_receive_times(
        mut segment in trees(), tail in any::<prop::sample::Index>(), cut in any::<prop::sample::Index>()
    ) {
        let free = segment.free_ports();
        let (node, port) = free[tail.index(free.len())];
        segment.connect(End::Port(node, port), End::Redundant);
        let trunk = segment.trunk(node);
        let head = trunk[cut.index(trunk.len())];
        segment.cut(head, 0);
        let seen = segment.walk();
        prop_assert_eq!(seen.order.len(), segment.len());
        let topology = Topology::build(&seen.status(true), seen.main_count);
        prop_assert_eq!(parents(&topology), seen.parents(&segment));
        prop_assert_eq!(topology.redundant_head.map(|at| seen.order[at]), Some(head));
        prop_assert_eq!(&topology.findings, &[]);
    }

    // covers: topology
    #[test]
    fn any_one_crossed_subdevice_of_a_line_is_located(length in 2usize..20, crossed in any::<prop::sample::Index>()) {
        // A crossed last SubDevice would have an unconnected port 0 instead.
        let crossed = crossed.index(length - 1);
        let mut segment = Segment::new();
        let mut end = End::Main;
        for node in 0..length {
            let (entry, exit) = if node == crossed { (1, 0) } else { (0, 1) };
            segment.add(end, entry);
            end = End::Port(node, exit);
        }
        let seen = segment.walk();
        let topology = Topology::build(&seen.status(true), seen.main_count);
        prop_assert_eq!(parents(&topology), seen.parents(&segment));
        let node = seen.order.iter().position(|n| *n == crossed).unwrap();
        prop_assert_eq!(&topology.findings, &[Finding::CrossedLine { node, entry_port: 1 }]);
    }

    // covers: ring-places
    #[test]
    fn any_crossed_subdevices_of_a_ring_that_is_cut_anywhere_are_found(
        crossed in proptest::collection::vec(any::<bool>(), 1..12), cut in any::<prop::sample::Index>(),
        times in any::<bool>()
    ) {
        let cut = cut.index(crossed.len() + 1);
        // This is a line on the redundant link, without crossed SubDevices.
        prop_assume!(cut > 0 || !crossed.iter().all(|crossed| *crossed));
        let mut segment = Segment::new();
        let ports = |node: usize| if crossed[node] { (1, 0) } else { (0, 1) };
        let mut end = End::Main;
        for node in 0..crossed.len() {
            segment.add(end, ports(node).0);
            end = End::Port(node, ports(node).1);
        }
        segment.connect(end, End::Redundant);
        match cut.checked_sub(1) {
            Some(node) => segment.cut(node, ports(node).1),
            None => segment.cut(0, ports(0).0),
        }
        let seen = segment.walk();
        prop_assert_eq!(seen.main_count, cut);
        let mut status = seen.status(times);
        // With more than two ports, several ports could be the end of a stub.
        let two = [PortKind::Mii, PortKind::Mii, PortKind::NotImplemented, PortKind::NotImplemented];
        status.iter_mut().for_each(|status| status.ports = two);
        let topology = Topology::build(&status, cut);
        let is_crossed = |node: &usize| {
            let here = |finding: &&Finding| matches!(finding, Finding::CrossedLine { node: at, .. } if at == node);
            topology.findings.iter().any(|finding| here(&finding))
        };
        for (node, device) in seen.order.iter().enumerate() {
            prop_assert_eq!(is_crossed(&node), crossed[*device], "device {}", device);
        }
        let dl_status: Vec<_> = status.iter().map(|status| Some(status.dl_status)).collect();
        let place = |device: usize, port: u8| at(seen.order.iter().position(|passed| *passed == device).unwrap(), port);
        let near = cut.checked_sub(1).map(|node| place(node, ports(node).1));
        let far = (cut < crossed.len()).then(|| place(cut, ports(cut).0));
        let counts = [cut as u16, (crossed.len() - cut) as u16];
        prop_assert_eq!(super::ends_of_break(&topology, &dl_status, counts), Some((near, far)));
    }

    #[test]
    fn any_status_words_give_a_tree_without_panic(
        nodes in proptest::collection::vec((any::<u16>(), any::<Option<[u32; 4]>>(), 0u8..2), 0..40),
        main_count in 0usize..50,
    ) {
        let nodes: Vec<NodeStatus> = nodes
            .into_iter()
            .map(|(bits, receive_times, kinds)| {
                let ports = if kinds == 0 { [PortKind::NotImplemented; 4] } else { [PortKind::Mii; 4] };
                NodeStatus { dl_status: DlStatus::from_bits(bits), receive_times, ports }
            })
            .collect();
        let topology = Topology::build(&nodes, main_count);
        prop_assert_eq!(topology.nodes.len(), nodes.len());
        let dl_status: Vec<_> = nodes.iter().map(|node| Some(node.dl_status)).collect();
        let counts = [main_count as u16, nodes.len().saturating_sub(main_count) as u16];
        let _ = super::ends_of_break(&topology, &dl_status, counts);
        for (index, node) in topology.nodes.iter().enumerate() {
            if let Some((parent, port)) = node.parent {
                prop_assert_eq!(topology.nodes[parent].children[usize::from(port)], Some(index));
            }
            // The chain of parents ends.
            let mut at = index;
            let steps = core::iter::from_fn(|| { at = topology.nodes[at].parent?.0; Some(()) });
            prop_assert!(steps.take(nodes.len() + 1).count() <= nodes.len());
        }
    }
}
