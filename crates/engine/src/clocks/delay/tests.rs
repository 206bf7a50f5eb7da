//! The vectors of facts 7.1 and 7.5, and trees against a model of the wire that knows the truth.

use super::*;
use crate::clocks::FRACTION;
use crate::topology::Node;

/// A tree from (parent, port, child), all entered at port 0; the child is named by its number.
fn tree(count: usize, links: &[(usize, u8, usize)]) -> Topology {
    let mut nodes = vec![Node::default(); count];
    for (parent, port, child) in links {
        nodes[*parent].children[usize::from(*port)] = Some(*child);
        nodes[*child].parent = Some((*parent, *port));
    }
    Topology { nodes, main_count: count, ..Topology::default() }
}

fn times(ports: [i64; 4]) -> Option<PortTimes> {
    Some(PortTimes(ports.map(|ns| ns << FRACTION)))
}

fn rounded(delays: &Delays, reference: usize) -> Vec<Option<i64>> {
    (0..delays.units.len()).map(|node| delays.between(reference, node)).collect()
}

/// S1..S7 of facts 7.1 as 0..6.
fn vector() -> (Topology, Vec<Option<PortTimes>>) {
    let topology = tree(7, &[(0, 1, 1), (1, 3, 4), (4, 1, 5), (1, 1, 2), (2, 1, 3), (0, 2, 6)]);
    let times = vec![
        times([0, 3_880, 4_880, 0]),
        times([0, 3_080, 0, 1_460]),
        times([0, 780, 0, 0]),
        times([0; 4]),
        times([0, 720, 0, 0]),
        times([0; 4]),
        times([0; 4]),
    ];
    (topology, times)
}

#[test]
fn the_tree_of_facts_7_1_has_its_delays() {
    let (topology, times) = vector();
    let delays = propagation(&topology, &times);
    assert_eq!(rounded(&delays, 0), [0, 400, 2_280, 2_670, 770, 1_130, 4_380].map(Some));
    // Another reference only moves all of them.
    assert_eq!(delays.between(1, 0), Some(-400));
    assert_eq!(entry_ports(&topology), [0; 7]);
}

#[test]
fn devices_without_a_clock_are_part_of_the_cable_facts_7_1() {
    // S1 - X - S2: 300 ns a pass, 100 ns a cable.
    let topology = tree(3, &[(0, 1, 1), (1, 1, 2)]);
    let delays = propagation(&topology, &[times([0, 1_600, 0, 0]), None, times([0; 4])]);
    assert_eq!(rounded(&delays, 0), [Some(0), None, Some(800)]);
    // A junction without a clock in front: what it does to the frame nobody measures, its branches are.
    let topology = tree(4, &[(0, 3, 1), (0, 1, 2), (2, 1, 3)]);
    let delays = propagation(&topology, &[None, times([0; 4]), times([0, 780, 0, 0]), times([0; 4])]);
    assert_eq!(rounded(&delays, 2), [None, Some(0), Some(0), Some(390)]);
    // One in between shares its cables with both branches: out, back, out, back, home.
    let topology = tree(4, &[(0, 1, 1), (1, 3, 2), (1, 1, 3)]);
    let delays = propagation(&topology, &[times([0, 2_400, 0, 0]), None, times([0; 4]), times([0; 4])]);
    assert_eq!(rounded(&delays, 0), [Some(0), None, Some(800), Some(1_600)]);
}

#[test]
fn a_stub_that_is_entered_from_behind_keeps_its_differences_facts_7_5() {
    // dc_delay.py: slaves 4 and 3 from the redundant link, the break in front of 3; the head is node 0.
    let mut topology = tree(2, &[(0, 1, 1)]);
    topology.main_count = 0;
    topology.redundant_head = Some(0);
    topology.open_ports = vec![PortOf { node: 1, port: 1 }];
    assert_eq!(entry_ports(&topology), [1, 1]);
    let delays = propagation(&topology, &[times([0; 4]), times([780, 0, 0, 0])]);
    assert_eq!((delays.trees.clone(), delays.between(0, 1)), (vec![1, 1], Some(390)));
}

#[test]
fn trees_of_a_broken_ring_have_delays_of_their_own() {
    let mut topology = tree(4, &[(0, 1, 1), (2, 1, 3)]);
    topology.main_count = 2;
    topology.redundant_head = Some(2);
    topology.open_ports = vec![PortOf { node: 3, port: 1 }];
    let all = [times([0, 780, 0, 0]), times([0; 4]), times([0; 4]), times([780, 0, 0, 0])];
    let delays = propagation(&topology, &all);
    assert_eq!((delays.between(0, 1), delays.between(2, 3), delays.between(0, 3)), (Some(390), Some(390), None));
}

#[test]
fn nonsense_neither_panics_nor_hangs() {
    let mut topology = tree(3, &[(0, 1, 1), (1, 1, 2)]);
    topology.nodes[0].parent = Some((2, 1));
    topology.nodes[2].children[1] = Some(0);
    propagation(&topology, &[times([i64::from(i32::MAX); 4]), times([-5; 4]), None]);
    topology.nodes[1].children[3] = Some(99);
    propagation(&topology, &[]);
    assert_eq!(propagation(&Topology::default(), &[]), Delays::default());
}

/// A frame through a random tree with what each port's clock notes, and the truth at each unit.
fn walk(topology: &Topology, entry: (usize, u8), cable: impl Fn(usize, u8) -> i64) -> (Vec<PortTimes>, Vec<i64>) {
    let count = topology.nodes.len();
    let (mut at, mut arrivals, mut units) = (0, vec![[0; 4]; count], vec![0; count]);
    let mut first: Vec<Option<i64>> = vec![None; count];
    let all = way(topology, entry.0, entry.1);
    for (step, (node, port)) in all.iter().enumerate() {
        if step > 0 {
            let (from, _) = all[step - 1];
            let child = if topology.nodes[*node].parent.map(|p| p.0) == Some(from) { *node } else { from };
            at += (300 + cable(child, 0)) << FRACTION;
        }
        let begin = *first[*node].get_or_insert(at);
        arrivals[*node][usize::from(*port)] = at - begin;
        if *port == 0 {
            units[*node] = at;
        }
    }
    (arrivals.into_iter().map(PortTimes).collect(), units)
}

proptest::proptest! {
    #[test]
    fn any_tree_with_clocks_everywhere_has_exact_delays(
        parents in proptest::collection::vec((0usize..1000, 0usize..3, 0i64..400), 1..40),
    ) {
        let mut topology = tree(1, &[]);
        let mut cables = vec![0];
        for (parent, port, cable) in parents {
            let parent = parent % topology.nodes.len();
            let port = [3u8, 1, 2][port];
            if topology.nodes[parent].children[usize::from(port)].is_some() {
                continue;
            }
            let child = topology.nodes.len();
            topology.nodes.push(Node { parent: Some((parent, port)), ..Node::default() });
            topology.nodes[parent].children[usize::from(port)] = Some(child);
            cables.push(cable);
        }
        topology.main_count = topology.nodes.len();
        let (times, truth) = walk(&topology, (0, 0), |child, _| cables[child]);
        let times: Vec<_> = times.into_iter().map(Some).collect();
        let delays = propagation(&topology, &times);
        for (node, truth) in truth.iter().enumerate() {
            proptest::prop_assert_eq!(delays.units[node], Some(*truth));
        }
    }
}
