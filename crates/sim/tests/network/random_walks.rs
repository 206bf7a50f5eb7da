//! Random trees, rings and junction rings with random cuts against an independent walk of ports (protocol 11.3).

use std::collections::BTreeMap;

use proptest::prelude::*;
use ringcat_sim::cable::{CableSpec, DeviceIndex, Endpoint, HostLink};
use ringcat_sim::frame::Port;
use ringcat_sim::network::NetworkOptions;

use crate::wiring::{CABLE, Journey, SETTLE, build, travel};

/// A plug position: device from 1 and port, or device 0 with port 0 for MAIN and 1 for RED.
type Plug = (usize, usize);

/// The model: the connections between plugs.
#[derive(Clone, Debug, Default)]
struct Walk {
    joined: BTreeMap<Plug, Plug>,
}

impl Walk {
    fn new(cables: &[(Plug, Plug)]) -> Walk {
        Walk { joined: cables.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect() }
    }

    /// The path of a frame sent on a link.
    fn journey(&self, link: HostLink) -> Option<Journey> {
        const ORDER: [usize; 4] = [0, 3, 1, 2];
        let mut journey = Journey { back_on: link, processed_by: Vec::new(), flags: 0, circulating: false };
        if link == HostLink::Redundant {
            journey.flags = 0x08;
        }
        let (mut node, mut port) = *self.joined.get(&(0, link as usize))?;
        for _ in 0..1_000 {
            if node == 0 {
                journey.back_on = HostLink::ALL[port];
                return Some(journey);
            }
            if port == 0 {
                if !self.joined.contains_key(&(node, 0)) {
                    if journey.circulating {
                        return None;
                    }
                    journey.circulating = true;
                }
                journey.flags |= 0x02;
                journey.processed_by.push(node as u16);
            }
            let place = ORDER.iter().position(|other| *other == port).unwrap();
            port = ORDER[(place + 1) % 4];
            if let Some(next) = self.joined.get(&(node, port)) {
                (node, port) = *next;
            }
        }
        panic!("an endless path: {journey:?}");
    }
}

/// Cables of a random segment: a tree with random entry ports, sometimes closed to the redundant link and by cables
/// between any two free ports.
fn cables() -> impl Strategy<Value = Vec<(Plug, Plug)>> {
    let device = (any::<prop::sample::Index>(), prop_oneof![3 => Just(0usize), 1 => 0usize..4]);
    let closing = prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>()), 0..3);
    let red = prop::option::weighted(0.7, any::<prop::sample::Index>());
    (prop::collection::vec(device, 1..14), red, closing).prop_map(|(devices, red, closing)| {
        let mut free: Vec<Plug> = vec![(0, 0)];
        let mut cables = Vec::new();
        for (number, (parent, entry)) in (1..).zip(devices) {
            let from = free.remove(parent.index(free.len()));
            cables.push((from, (number, entry)));
            free.extend((0..4).filter(|port| *port != entry).map(|port| (number, port)));
        }
        if let Some(red) = red {
            cables.push((free.remove(red.index(free.len())), (0, 1)));
        }
        for (one, other) in closing {
            if free.len() >= 2 {
                let one = free.remove(one.index(free.len()));
                let other = free.remove(other.index(free.len()));
                cables.push((one, other));
            }
        }
        cables
    })
}

fn endpoint((node, port): Plug) -> Endpoint {
    match node {
        0 => Endpoint::Host(HostLink::ALL[port]),
        _ => Endpoint::Device(DeviceIndex(node - 1), Port::from_index(port).unwrap()),
    }
}

/// Checks both copies of a frame against the model after each of the cuts and repairs.
fn compare(cables: &[(Plug, Plug)], changes: &[Vec<usize>]) -> Result<(), TestCaseError> {
    let specs = cables.iter().map(|&(a, b)| CableSpec { a: endpoint(a), b: endpoint(b), delay: CABLE });
    let mut network = build(specs.collect(), NetworkOptions::default());
    for cuts in changes {
        for number in 0..cables.len() {
            let cable = ringcat_sim::cable::CableId(number);
            if cuts.contains(&number) { network.cut(cable) } else { network.heal(cable) }
        }
        network.advance_by(SETTLE);
        let left: Vec<_> =
            (0..cables.len()).filter(|number| !cuts.contains(number)).map(|number| cables[number]).collect();
        let model = Walk::new(&left);
        for link in HostLink::ALL {
            let expected = model.journey(link);
            if let Some(journey) = &expected {
                let mut once = journey.processed_by.clone();
                once.sort_unstable();
                once.dedup();
                prop_assert_eq!(once.len(), journey.processed_by.len(), "a SubDevice processed the frame twice");
            }
            prop_assert_eq!(travel(&mut network, link), expected, "{:?} sent on {}", left, link);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    // covers: sim-frames
    #[test]
    fn frames_take_the_path_of_the_model(
        cables in cables(),
        picks in prop::collection::vec(prop::collection::vec(any::<prop::sample::Index>(), 0..4), 1..4),
    ) {
        let changes: Vec<Vec<usize>> = picks
            .iter()
            .map(|cuts| cuts.iter().map(|cut| cut.index(cables.len())).collect())
            .collect();
        compare(&cables, &changes)?;
    }

    // covers: sim-frames
    #[test]
    fn in_a_straight_ring_a_single_break_isolates_no_subdevice(
        count in 1usize..40,
        cut in any::<prop::sample::Index>(),
    ) {
        let mut cables: Vec<(Plug, Plug)> = vec![((0, 0), (1, 0))];
        cables.extend((1..count).map(|number| ((number, 1), (number + 1, 0))));
        cables.push(((count, 1), (0, 1)));
        cables.remove(cut.index(cables.len()));
        let model = Walk::new(&cables);
        let journeys = HostLink::ALL.iter().filter_map(|link| model.journey(*link));
        let total: usize = journeys.map(|back| back.processed_by.len()).sum();
        prop_assert_eq!(total, count);
        compare(&cables, &[Vec::new()])?;
    }
}
