//! The example segments have the intended properties.

use std::collections::BTreeSet;
use std::path::Path;

use ringcat_sim::cable::HostLink::{Main, Redundant};
use ringcat_sim::cable::{CableId, Endpoint, HostLink};
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::frame::Frame;

use crate::wiring::{SETTLE, shortest};

fn example(name: &str) -> Network {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("segments").join(name);
    let segment = Segment::load(&path).unwrap_or_else(|error| panic!("{error}"));
    let mut network = Network::from_description(segment).unwrap();
    network.advance_by(SETTLE);
    network
}

/// Number of processing units that a frame passes, and the interface at which it returns.
fn processed_by(network: &mut Network, link: HostLink) -> Option<(HostLink, usize)> {
    network.send(link, &shortest());
    network.advance_by(SETTLE);
    HostLink::ALL.into_iter().find_map(|back_on| {
        let received = network.receive(back_on)?;
        let frame = Frame::parse(&received.bytes).unwrap();
        let count = frame.datagrams().next().unwrap().wkc;
        Some((back_on, usize::from(count.0)))
    })
}

#[test]
fn the_demo_is_a_straight_ring_that_tolerates_any_single_cut() {
    let mut network = example("demo.toml");
    let count = network.devices().len();
    assert!(count >= 16);
    assert_eq!(processed_by(&mut network, Main), Some((Redundant, count)));
    assert_eq!(processed_by(&mut network, Redundant), Some((Main, 0)));
    let cables = network.cables().len();
    for cable in (0..cables).map(CableId) {
        network.cut(cable);
        network.advance_by(SETTLE);
        let halves =
            HostLink::ALL.map(|link| processed_by(&mut network, link).map_or(0, |(_, processed_by)| processed_by));
        assert_eq!(halves.iter().sum::<usize>(), count, "{cable:?}");
        network.heal(cable);
        network.advance_by(SETTLE);
    }
    let names: BTreeSet<&str> = network.devices().map(|device| device.name()).collect();
    assert_eq!(names.len(), count);
}

#[test]
fn the_local_ring_of_the_junction_tolerates_any_single_cut() {
    let mut network = example("junction-ring.toml");
    let count = network.devices().len();
    assert_eq!(processed_by(&mut network, Main), Some((Main, count)));
    let ring = ["member-1", "member-2", "member-3"];
    let inside = |network: &Network, endpoint: Endpoint| match endpoint {
        Endpoint::Device(device, _) => ring.contains(&network.device(device).name()),
        Endpoint::Host(_) => false,
    };
    let cables: Vec<CableId> = network
        .cables()
        .enumerate()
        .filter(|(_, cable)| inside(&network, cable.a) || inside(&network, cable.b))
        .map(|(number, _)| CableId(number))
        .collect();
    assert_eq!(cables.len(), 4);
    for cable in cables {
        network.cut(cable);
        network.advance_by(SETTLE);
        assert_eq!(processed_by(&mut network, Main), Some((Main, count)), "{cable:?}");
        network.heal(cable);
        network.advance_by(SETTLE);
    }
}

#[test]
fn the_tree_and_the_long_line_reach_all_their_devices() {
    for (name, count) in [("tree.toml", 7), ("line-1000.toml", 1_000)] {
        let mut network = example(name);
        assert_eq!(network.devices().len(), count);
        assert_eq!(processed_by(&mut network, Main), Some((Main, count)), "{name}");
    }
}
