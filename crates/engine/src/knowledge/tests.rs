//! Trees that cannot be, and errors that name their place.

use alloc::vec;

use super::*;
use crate::clocks::{Delays, KnownCable, Measured, Passage, Unknown, Wiring};
use crate::topology::{Node, PortOf};

fn of(nodes: Vec<Node>) -> Knowledge {
    let info = |at: usize| SubDeviceInfo {
        position: ringcat_wire::address::Position(at as u16),
        station: StationAddress(0x1001 + at as u16),
        ..SubDeviceInfo::default()
    };
    let known = |at| KnownSubDevice {
        info: info(at),
        target: AlState::PreOp,
        progress: KnownProgress::Reached,
        mailbox: Some(KnownMailbox { counter: 7, recent: vec![(1, 2)], ..KnownMailbox::default() }),
    };
    Knowledge {
        subdevices: (0..nodes.len()).map(known).collect(),
        others: Vec::new(),
        main_count: nodes.len(),
        topology: Topology { main_count: nodes.len(), nodes, ..Topology::default() },
        ring: RingState::Closed,
        sequence: 5,
        offered: StationAddress(0xC001),
        activations: 9,
        siis: Vec::new(),
        dictionaries: Vec::new(),
        clocks: Some(clocks_of_two()),
    }
}

/// A measurement of two SubDevices that are connected with each other.
fn clocks_of_two() -> KnownClocks {
    let [near, far] = [PortOf { node: 0, port: 1 }, PortOf { node: 1, port: 0 }];
    let ends = ((StationAddress(0x1001), 1), (StationAddress(0x1002), 0));
    let measured = Measured {
        stations: vec![StationAddress(0x1001), StationAddress(0x1002)],
        delays: Delays { units: vec![Some(0), Some(90_000)], trees: vec![0, 0], ..Delays::default() },
        drift_ppb: vec![Some(0), Some(-12_000)],
        passages: vec![Passage::default(); 2],
        wiring: Wiring {
            far: vec![[None, Some(far), None, None], [Some(near), None, None, None]],
            entries: [Some(PortOf { node: 0, port: 0 }), None],
        },
        port_times: vec![Some([0, 1_400, 9, 9]), None],
    };
    let cables = vec![KnownCable { ends: vec![ends], time: 50_000, is_old: false }];
    KnownClocks { measured, cables, backwards: vec![StationAddress(0x1002)] }
}

#[test]
fn clocks_with_impossible_places_or_times_are_refused() {
    let refused = |change: fn(&mut KnownClocks)| {
        let mut knowledge = of(vec![node(None, Some(1)), node(Some((0, 1)), None)]);
        change(knowledge.clocks.as_mut().expect("they are known"));
        let error = Knowledge::from_bytes(&knowledge.to_bytes()).expect_err("it cannot be");
        assert!(error.expected.contains("clocks"), "{error}");
    };
    refused(|known| known.measured.delays.units.truncate(1));
    refused(|known| known.measured.port_times.push(None));
    refused(|known| known.measured.delays.trees[1] = 2);
    refused(|known| known.measured.delays.units[1] = Some(i64::MAX));
    refused(|known| known.measured.delays.unknown.push(Unknown { node: 1, fork: Some(2), range: None }));
    refused(|known| known.measured.delays.unknown.push(Unknown { node: 1, fork: None, range: Some((0, i64::MAX)) }));
    refused(|known| known.measured.drift_ppb[0] = Some(i64::MIN));
    refused(|known| known.measured.passages[0].forwarded = i64::MIN);
    refused(|known| known.measured.wiring.far[1][0] = Some(PortOf { node: 2, port: 1 }));
    refused(|known| known.measured.wiring.entries[1] = Some(PortOf { node: 1, port: 4 }));
    refused(|known| known.cables[0].time = 1 << 40);
    refused(|known| known.cables[0].ends.clear());
}

fn node(parent: Option<(usize, u8)>, child: Option<usize>) -> Node {
    Node { parent, entry_port: 0, children: [None, child, None, None] }
}

#[test]
fn a_line_is_a_tree_and_survives() {
    let knowledge = of(vec![node(None, Some(1)), node(Some((0, 1)), Some(2)), node(Some((1, 1)), None)]);
    assert_eq!(Knowledge::from_bytes(&knowledge.to_bytes()), Ok(knowledge));
}

#[test]
fn connections_that_cannot_be_are_refused() {
    let circle = vec![node(Some((1, 1)), Some(1)), node(Some((0, 1)), Some(0))];
    let one_way = vec![node(None, Some(1)), node(None, None)];
    let beyond = vec![node(None, Some(2)), node(None, None)];
    let no_port = vec![Node { entry_port: 4, ..node(None, None) }];
    for nodes in [circle, one_way, beyond, no_port] {
        let error = Knowledge::from_bytes(&of(nodes).to_bytes()).expect_err("it is no tree");
        assert!(error.expected.starts_with("a tree"), "{error}");
    }
}

#[test]
fn addresses_counters_and_positions_that_cannot_be_are_refused() {
    let right = || of(vec![node(None, Some(1)), node(Some((0, 1)), None)]);
    let refused = |change: fn(&mut Knowledge)| {
        let mut wrong = right();
        change(&mut wrong);
        Knowledge::from_bytes(&wrong.to_bytes()).expect_err("it cannot be").expected
    };
    assert!(refused(|it| it.subdevices[1].info.station = StationAddress(0x1001)).contains("station address"));
    assert!(refused(|it| it.subdevices[1].info.station = StationAddress(0)).contains("station address"));
    assert!(refused(|it| it.subdevices[1].info.position.0 = 7).contains("positions"));
    assert!(refused(|it| it.main_count = 3).contains("main link"));
    assert!(refused(|it| it.topology.nodes.truncate(1)).contains("as many"));
    let counter = |it: &mut Knowledge| it.subdevices[0].mailbox.iter_mut().for_each(|mailbox| mailbox.counter = 8);
    assert!(refused(counter).contains("counters"));
}

#[test]
fn another_version_length_or_checksum_is_named() {
    let bytes = of(vec![node(None, None)]).to_bytes();
    let changed = |at: usize| {
        let mut bytes = bytes.clone();
        bytes[at] ^= 1;
        Knowledge::from_bytes(&bytes).expect_err("it is changed")
    };
    assert_eq!((changed(3).offset, changed(9).offset, changed(10).offset, changed(20).offset), (0, 8, 10, 14));
    assert_eq!(changed(HEADER).expected, "the checksum of the bytes behind the header");
    assert_eq!(Knowledge::from_bytes(&[]).map_err(|error| error.offset), Err(0));
}
