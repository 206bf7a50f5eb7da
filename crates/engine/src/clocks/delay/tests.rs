//! The vectors of protocol 7.1 and 7.5, and trees compared with a model of the wire with known delays.

use super::*;
use crate::clocks::FRACTION;
use crate::clocks::delays::Unknown;
use crate::topology::{Closing, LocalRing, Node, Topology};

fn stations(count: usize) -> Vec<StationAddress> {
    (0..count).map(|node| StationAddress(node as u16 + 1)).collect()
}

fn wiring(topology: &Topology) -> Wiring {
    Wiring::new(topology, false, |_| true)
}

fn propagation(topology: &Topology, times: &[Option<PortTimes>]) -> Delays {
    let (wiring, stations) = (wiring(topology), stations(topology.nodes.len()));
    Segment { wiring: &wiring, stations: &stations, passages: &[] }.propagation(times, 0, &mut Cables::default())
}

fn entry_ports(topology: &Topology) -> Vec<u8> {
    wiring(topology).entry_ports()
}

/// A tree from (parent, port, child); frames enter all SubDevices at port 0.
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

/// S1..S7 of protocol 7.1 as 0..6.
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

// covers: 7.1, dc-delays
#[test]
fn the_example_tree_has_its_delays() {
    let (topology, times) = vector();
    let delays = propagation(&topology, &times);
    assert_eq!(rounded(&delays, 0), [0, 400, 2_280, 2_670, 770, 1_130, 4_380].map(Some));
    // With another reference clock all delays shift by the same time.
    assert_eq!(delays.between(1, 0), Some(-400));
    assert_eq!(entry_ports(&topology), [0; 7]);
}

// covers: 7.1, dc-delays
#[test]
fn devices_without_a_clock_are_part_of_the_cable() {
    // S1 - X - S2: 300 ns per SubDevice, 100 ns per cable.
    let topology = tree(3, &[(0, 1, 1), (1, 1, 2)]);
    let delays = propagation(&topology, &[times([0, 1_600, 0, 0]), None, times([0; 4])]);
    assert_eq!(rounded(&delays, 0), [Some(0), None, Some(800)]);
    // A fork with only SubDevices without a clock behind it hides no delay.
    let topology = tree(4, &[(0, 1, 1), (1, 3, 2), (1, 1, 3)]);
    let delays = propagation(&topology, &[times([0, 2_400, 0, 0]), None, None, None]);
    assert_eq!((rounded(&delays, 0), delays.unknown), (vec![Some(0), None, None, None], vec![]));
}

fn unknown(node: usize, fork: usize, range: Option<(i64, i64)>) -> Unknown {
    Unknown { node, fork: Some(fork), range: range.map(|(least, most)| (least << FRACTION, most << FRACTION)) }
}

// covers: 7.1, dc-delays
#[test]
fn behind_forks_without_a_clock_delays_are_known_within_a_branch_only() {
    // The junction upstream has no clock: no clock measures the path through it, but the branches have clocks.
    let topology = tree(4, &[(0, 3, 1), (0, 1, 2), (2, 1, 3)]);
    let all = [None, times([0; 4]), times([0, 780, 0, 0]), times([0; 4])];
    let delays = propagation(&topology, &all);
    assert_eq!(rounded(&delays, 1), [None, Some(0), None, None]);
    assert_eq!(delays.unknown, [unknown(2, 0, None), unknown(3, 0, None)]);
    // Delays are known in the branch of the reference clock.
    let (wiring, stations) = (wiring(&topology), stations(4));
    let segment = Segment { wiring: &wiring, stations: &stations, passages: &[] };
    let delays = segment.propagation(&all, 3, &mut Cables::default());
    assert_eq!(
        (rounded(&delays, 3), delays.unknown),
        (vec![None, None, Some(-390), Some(0)], vec![unknown(1, 0, None)])
    );
    // A fork between clocks: into the first branch, back, into the second branch, back, to the first SubDevice. The
    // frame reaches the first branch in the first half of the time, the second branch in the second half.
    let topology = tree(4, &[(0, 1, 1), (1, 3, 2), (1, 1, 3)]);
    let delays = propagation(&topology, &[times([0, 2_400, 0, 0]), None, times([0; 4]), times([0; 4])]);
    assert_eq!(rounded(&delays, 0), [Some(0), None, None, None]);
    assert_eq!(delays.unknown, [unknown(2, 1, Some((0, 1_200))), unknown(3, 1, Some((1_200, 2_400)))]);
}

/// Clock 0; fork 1 without a clock with the branches 2, 3 and 4 (clocks), and fork 5 without a clock with the clocks 6
/// and 7.
const FORKS: [(usize, u8, usize); 7] = [(0, 1, 1), (1, 3, 2), (2, 1, 3), (1, 1, 4), (1, 2, 5), (5, 3, 6), (5, 1, 7)];

// covers: 7.1, dc-delays
#[test]
fn delays_behind_forks_are_exact_after_each_branch_was_measured_alone() {
    let wiring = wiring(&tree(8, &FORKS));
    let stations = stations(8);
    let mut cables = Cables::default();
    let mut run = |closed: &[(usize, u8)]| {
        let mut wiring = wiring.clone();
        wiring.open(&closed.iter().map(|(node, port)| PortOf { node: *node, port: *port }).collect::<Vec<_>>());
        let (mut times, truth) = walk(&wiring, &[], |at| 30 * at.node as i64 * at.node as i64);
        (times[1], times[5]) = (None, None);
        let delays =
            Segment { wiring: &wiring, stations: &stations, passages: &[] }.propagation(&times, 0, &mut cables);
        for (node, unit) in delays.units.iter().enumerate() {
            assert!(unit.is_none_or(|unit| unit == truth[node]), "{node}: {unit:?}, {}", truth[node]);
        }
        delays.unknown.iter().map(|unknown| (unknown.node, unknown.fork)).collect::<Vec<_>>()
    };
    let behind = |nodes: &[usize], fork: usize| nodes.iter().map(|node| (*node, Some(fork))).collect::<Vec<_>>();
    assert_eq!(run(&[]), [behind(&[2, 3, 4, 6], 1), behind(&[7], 5)].concat());
    // The path to the first fork, then into one of its branches each; then the same for the second fork.
    run(&[(1, 3), (1, 1), (1, 2)]);
    run(&[(1, 1), (1, 2)]);
    run(&[(1, 3), (1, 2)]);
    run(&[(1, 3), (1, 1), (5, 3), (5, 1)]);
    run(&[(1, 3), (1, 1), (5, 1)]);
    assert_eq!(run(&[]), []);
}

// covers: 7.5, dc-delays
#[test]
fn a_stub_of_the_redundant_link_has_the_same_delay_differences() {
    // dc_delay.py: slaves 4 and 3 from the redundant link, the break before 3; the head is node 0.
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
fn inconsistent_input_neither_panics_nor_loops() {
    let mut topology = tree(3, &[(0, 1, 1), (1, 1, 2)]);
    topology.nodes[0].parent = Some((2, 1));
    topology.nodes[2].children[1] = Some(0);
    propagation(&topology, &[times([i64::from(i32::MAX); 4]), times([-5; 4]), None]);
    topology.nodes[1].children[3] = Some(99);
    propagation(&topology, &[]);
    assert_eq!(propagation(&Topology::default(), &[]), Delays::default());
}

/// Simulates a frame: the times that each SubDevice latches, and the true time at each processing unit. `cable` returns
/// the delay of a cable by its far end.
fn walk(wiring: &Wiring, passages: &[Passage], cable: impl Fn(PortOf) -> i64) -> (Vec<Option<PortTimes>>, Vec<i64>) {
    let count = wiring.count();
    let (mut at, mut arrivals, mut units) = (0, vec![[0; 4]; count], vec![0; count]);
    let mut first: Vec<Option<i64>> = vec![None; count];
    let path = wiring.path(0);
    for (step, arrival) in path.iter().enumerate() {
        let PortOf { node, port } = arrival.at;
        if step > 0 {
            let near = wiring.far(arrival.at).expect("every arrival but the first has a cable");
            let passage = passages.get(near.node).copied().unwrap_or_default();
            at += if path[step - 1].processed { passage.processed } else { passage.forwarded };
            at += (300 + cable(near.max(arrival.at))) << FRACTION;
        }
        let begin = *first[node].get_or_insert(at);
        arrivals[node][usize::from(port)] = at - begin;
        if arrival.processed && units[node] == 0 {
            units[node] = at;
        }
    }
    (arrivals.into_iter().map(|ports| Some(PortTimes(ports))).collect(), units)
}

/// Seven SubDevices: a local ring from port 3 of SubDevice 1 over 2, 3, 4 to its port 1; 5 and 6 behind its port 2.
fn local_ring(broken: Option<usize>) -> Wiring {
    let links = [(0, 1, 1), (1, 3, 2), (2, 1, 3), (3, 1, 4), (1, 2, 5), (5, 1, 6)];
    let there: Vec<_> = links.into_iter().filter(|(_, _, child)| broken != Some(*child)).collect();
    let mut topology = tree(7, &there);
    let closing = Closing { head: PortOf { node: 1, port: 1 }, tail: PortOf { node: 4, port: 1 } };
    topology.local_rings = vec![LocalRing { closing, cables: Vec::new() }];
    Wiring::new(&topology, false, |_| broken != Some(7))
}

/// Errors of the delays with this break, in nanoseconds, `None` if a delay is not known; `cables` keeps the measured
/// times.
fn errors(broken: Option<usize>, passages: &[Passage], cables: &mut Cables) -> Vec<Option<i64>> {
    let wiring = local_ring(broken);
    // Each cable has a length of its own.
    let (times, truth) = walk(&wiring, passages, |at| 20 * (3 * at.node as i64 + i64::from(at.port)));
    let stations = stations(7);
    let segment = Segment { wiring: &wiring, stations: &stations, passages };
    segment.set_present(cables);
    let delays = segment.propagation(&times, 0, cables);
    (0..7).map(|node| Some((delays.units[node]? - truth[node]) >> FRACTION)).collect()
}

// covers: 7.5, 9.4, dc-delays
#[test]
fn delays_of_an_intact_local_ring_follow_from_measurements_of_the_open_ring() {
    let mixed: Vec<Passage> = (0..7).map(|node| passage(150 * (node % 3) + 40, 140 * (node % 3))).collect();
    for passages in [vec![], vec![passage(40, 0); 7], mixed] {
        let is_mixed = passages.iter().any(|other| *other != passages[0]);
        let mut cables = Cables::default();
        // In an intact ring no delay is known; delays behind it are exact.
        let [right, none] = [Some(0), None];
        assert_eq!(errors(None, &passages, &mut cables), [right, right, none, none, none, right, right]);
        let mut cables = Cables::default();
        // Open at its closing cable, as at set-up; then intact, and broken anywhere.
        for broken in [Some(7), None, Some(3), None, Some(2), Some(4), None, Some(7), None] {
            assert_eq!(errors(broken, &passages, &mut cables), [Some(0); 7], "{broken:?}, mixed {is_mixed}");
        }
    }
}

// covers: dc-ring
#[test]
fn delays_of_a_closed_ring_are_those_measured_as_a_line_or_guessed() {
    let mut topology = tree(4, &[(0, 1, 1), (1, 1, 2), (2, 1, 3)]);
    let (mut cables, stations) = (Cables::default(), stations(4));
    let mut run = |wiring: &Wiring, times: &[Option<PortTimes>]| {
        let delays = Segment { wiring, stations: &stations, passages: &[] }.propagation(times, 0, &mut cables);
        (rounded(&delays, 0), delays.is_guessed)
    };
    topology.open_ports = vec![PortOf { node: 3, port: 1 }];
    let closed = Wiring::new(&topology, true, |_| true);
    let once = [times([0; 4]); 4];
    assert!(run(&closed, &once).1);
    let line = wiring(&Topology { open_ports: Vec::new(), ..topology });
    let (times, truth) = walk(&line, &[], |at| 10 * at.node as i64);
    let truth: Vec<Option<i64>> = truth.into_iter().map(|unit| Some(unit >> FRACTION)).collect();
    assert_eq!(run(&line, &times), (truth.clone(), false));
    assert_eq!(run(&closed, &once), (truth, false));
}

/// A passage from nanoseconds.
fn passage(processed: i64, forwarded: i64) -> Passage {
    Passage { processed: processed << FRACTION, forwarded: forwarded << FRACTION }
}

/// Errors of the delays in a line of nine SubDevices with these passages, of which `known` are known.
fn errors_of_line(passages: &[Passage], known: &[Passage]) -> Vec<i64> {
    let links: Vec<(usize, u8, usize)> = (1..9).map(|node| (node - 1, 1, node)).collect();
    let wiring = wiring(&tree(9, &links));
    let (times, truth) = walk(&wiring, passages, |_| 50);
    let segment = Segment { wiring: &wiring, stations: &stations(9), passages: known };
    let delays = segment.propagation(&times, 0, &mut Cables::default());
    delays.units.iter().zip(&truth).map(|(unit, truth)| (unit.unwrap() - truth) >> FRACTION).collect()
}

// covers: 7.1, dc-delays
#[test]
fn longer_processing_than_forwarding_is_a_half_per_hop_unless_known() {
    let passages = [passage(40, 0); 9];
    // The last SubDevice processes the frame at its entry, so its passage is not part of its delay.
    assert_eq!(errors_of_line(&passages, &[]), [0, -20, -40, -60, -80, -100, -120, -140, -140]);
    assert_eq!(errors_of_line(&passages, &passages), [0; 9]);
}

// covers: 7.1, dc-delays
#[test]
fn neighbours_of_two_types_are_off_by_half_of_an_unknown_difference() {
    // A coupler, terminals and drives.
    let passages: Vec<Passage> = [(550, 540), (150, 150), (150, 150), (750, 700), (750, 700), (150, 150), (150, 150)]
        .map(|(processed, forwarded)| passage(processed, forwarded))
        .to_vec();
    let passages = [passages, vec![passage(0, 0); 2]].concat();
    assert_eq!(errors_of_line(&passages, &[])[..4], [0, -200, -200, 75]);
    assert_eq!(errors_of_line(&passages, &passages), [0; 9]);
    // A base time that all have in common may be omitted.
    let less: Vec<Passage> = passages
        .iter()
        .map(|known| Passage {
            processed: known.processed - (100 << FRACTION),
            forwarded: known.forwarded - (100 << FRACTION),
        })
        .collect();
    assert_eq!(errors_of_line(&passages, &less), [0; 9]);
}

proptest::proptest! {
    // covers: dc-delays
    #[test]
    fn any_tree_with_clocks_everywhere_has_exact_delays(
        parents in proptest::collection::vec((0usize..1000, 0usize..3, 0i64..400), 1..40),
        passages in proptest::collection::vec((0i64..800, 0i64..800), 40),
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
        let wiring = wiring(&topology);
        let passages: Vec<Passage> =
            passages.into_iter().map(|(processed, forwarded)| passage(processed, forwarded)).collect();
        let (times, truth) = walk(&wiring, &passages, |at| cables[at.node]);
        let stations = stations(topology.nodes.len());
        let segment = Segment { wiring: &wiring, stations: &stations, passages: &passages };
        let delays = segment.propagation(&times, 0, &mut Cables::default());
        for (node, truth) in truth.iter().enumerate() {
            proptest::prop_assert_eq!(delays.units[node], Some(*truth));
        }
    }
}
