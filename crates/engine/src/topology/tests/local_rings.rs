//! Rings behind junctions (protocol 9.4): vectors, and random trees with rings that are intact or broken at one cable.

use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use super::walk_model::{End, Segment};
use super::{END, HEAD, PASS, at, parents, status, trees};
use crate::topology::{Closing, NodeStatus, RingCable, Topology, candidates_with};

/// All sets, without knowledge of single cables.
fn candidates(nodes: &[NodeStatus], main_count: usize, ring_closed: bool, most: usize) -> Vec<Vec<Closing>> {
    candidates_with(nodes, main_count, ring_closed, most, (&[], &[]))
}

/// Junction J with the ring 10, 11, 12 from its port 3 to its port 1 (closed from port 1 of 12), and 20 on port 2.
const JUNCTION: u8 = 0xAA;
const CLOSING: Closing = Closing { head: at(0, 1), tail: at(3, 1) };

// covers: JR-01
#[test]
fn an_intact_local_ring_is_a_branch_on_the_port_where_it_begins() {
    let nodes = [status(JUNCTION), status(PASS), status(PASS), status(PASS), status(END)];
    let topology = Topology::with_local_rings(&nodes, 5, &[CLOSING]);
    assert_eq!(parents(&topology), [None, Some((0, 3)), Some((1, 1)), Some((2, 1)), Some((0, 2))]);
    assert_eq!((topology.open_ports, topology.findings), (vec![], vec![]));
    let cable = |near, far| RingCable { near: Some(near), far };
    let cables = vec![
        cable(at(0, 3), at(1, 0)),
        cable(at(1, 1), at(2, 0)),
        cable(at(2, 1), at(3, 0)),
        cable(at(3, 1), at(0, 1)),
    ];
    assert_eq!(topology.local_rings[0].cables, cables);
}

// covers: LC-06, junctions
#[test]
fn a_broken_local_ring_keeps_its_order_and_is_no_crossed_line() {
    // The cable between 10 and 11 is cut.
    let nodes = [status(JUNCTION), status(END), status(HEAD), status(PASS), status(END)];
    let topology = Topology::with_local_rings(&nodes, 5, &[CLOSING]);
    assert_eq!(parents(&topology), [None, Some((0, 3)), None, Some((2, 1)), Some((0, 2))]);
    assert_eq!((topology.open_ports, topology.findings), (vec![], vec![]));
    assert_eq!(topology.local_rings[0].cables[0], RingCable { near: None, far: at(2, 0) });
    assert_eq!(topology.local_rings[0].cables.len(), 3);
}

// covers: JR-04
#[test]
fn without_junction_redundancy_a_broken_ring_is_reported_as_a_crossed_line() {
    let nodes = [status(0x9A), status(END), status(HEAD), status(PASS)];
    let topology = Topology::build(&nodes, 4);
    assert!(topology.findings.contains(&super::Finding::CrossedLine { node: 2, entry_port: 1 }));
    assert!(topology.findings.contains(&super::Finding::UnconnectedPort0 { node: 2 }));
}

// covers: junctions
#[test]
fn open_ports_allow_every_member_to_be_the_last_of_its_ring() {
    let nodes = [status(JUNCTION), status(PASS), status(PASS), status(PASS), status(END)];
    let tails = |found: Vec<Vec<Closing>>| found.iter().map(|set| (set[0].tail, set.len())).collect::<Vec<_>>();
    assert_eq!(tails(candidates(&nodes, 5, false, 9)), [(at(1, 1), 1), (at(2, 1), 1), (at(3, 1), 1)]);
    assert_eq!(tails(candidates(&nodes, 5, false, 2)).len(), 2);
    // A line, and a closed ring without junctions.
    assert_eq!(candidates(&[status(PASS), status(PASS), status(END)], 3, false, 9), Vec::<Vec<_>>::new());
    assert_eq!(candidates(&[status(PASS), status(PASS), status(PASS)], 3, true, 9), Vec::<Vec<_>>::new());
}

/// A segment with a local ring, and the closing cable of the ring.
#[derive(Clone, Debug)]
struct WithRing {
    segment: Segment,
    closing: Closing,
}

/// All segments in which one more cable makes a local ring without a change of the order in which frames pass the
/// SubDevices.
fn rings_of(tree: &Segment) -> Vec<WithRing> {
    let before = tree.walk().order;
    let free = tree.free_ports();
    let pairs = free.iter().flat_map(|head| free.iter().map(move |tail| (*head, *tail)));
    let place = |node: usize| before.iter().position(|passed| *passed == node).unwrap();
    pairs
        .filter(|((head, _), (tail, _))| tree.trunk(*tail).contains(head) && head != tail)
        .filter_map(|(head, tail)| {
            let mut segment = tree.clone();
            segment.connect(End::Port(head.0, head.1), End::Port(tail.0, tail.1));
            let closing = Closing { head: at(place(head.0), head.1), tail: at(place(tail.0), tail.1) };
            (segment.walk().order == before).then_some(WithRing { segment, closing })
        })
        .collect()
}

fn with_ring() -> impl Strategy<Value = WithRing> {
    (trees(), any::<prop::sample::Index>()).prop_filter_map("no ports for a ring", |(tree, pick)| {
        let rings = rings_of(&tree);
        (!rings.is_empty()).then(|| rings[pick.index(rings.len())].clone())
    })
}

proptest! {
    // covers: JR-02, junctions
    #[test]
    fn frames_pass_any_local_ring_in_the_same_order_intact_and_broken(
        WithRing { segment, closing } in with_ring(), cut in any::<prop::sample::Index>(), times in any::<bool>()
    ) {
        let whole = segment.walk();
        prop_assert_eq!(whole.main_count, segment.len());
        let topology = Topology::with_local_rings(&whole.status(times), segment.len(), &[closing]);
        prop_assert_eq!(parents(&topology), whole.parents(&segment));
        prop_assert_eq!(&topology.findings, &[]);
        prop_assert_eq!(&topology.open_ports, &[]);
        let found = candidates(&whole.status(false), segment.len(), false, usize::MAX);
        prop_assert!(found.contains(&vec![closing]), "{:?} not in {:?}", closing, found);

        let cables = topology.local_rings[0].cables.clone();
        let cable = cables[cut.index(cables.len())];
        let mut broken = segment.clone();
        broken.cut(whole.order[cable.far.node], cable.far.port);
        let seen = broken.walk();
        prop_assert_eq!(&seen.order, &whole.order);
        let again = Topology::with_local_rings(&seen.status(times), segment.len(), &[closing]);
        let mut expected = parents(&topology);
        if cable.far != closing.head {
            expected[cable.far.node] = None;
        }
        prop_assert_eq!(parents(&again), expected);
        prop_assert_eq!(&again.findings, &[]);
        prop_assert_eq!(&again.open_ports, &[]);
        let last = |topology: &Topology| topology.local_rings[0].cables.last().copied();
        prop_assert_eq!(last(&again), last(&topology));
    }

    // covers: junctions
    #[test]
    fn any_connections_and_status_words_give_a_tree_without_panic(
        nodes in proptest::collection::vec(any::<u8>(), 0..24),
        connections in proptest::collection::vec((0usize..30, any::<u8>(), 0usize..30, any::<u8>()), 0..4),
        ring_closed in any::<bool>(),
    ) {
        let nodes: Vec<_> = nodes.into_iter().map(status).collect();
        let closing = |(a, b, c, d)| Closing { head: at(a, b), tail: at(c, d) };
        let closings: Vec<Closing> = connections.into_iter().map(closing).collect();
        let topology = Topology::with_local_rings(&nodes, nodes.len(), &closings);
        prop_assert_eq!(topology.nodes.len(), nodes.len());
        prop_assert!(topology.local_rings.iter().all(|ring| ring.cables.len() <= nodes.len() + 1));
        for set in candidates(&nodes, nodes.len(), ring_closed, 8) {
            Topology::with_local_rings(&nodes, nodes.len(), &set);
        }
    }
}
