//! Places of breaks with more than one missing cable: absent branches, a second break, a SubDevice without power.
//! CR-12, CR-18.

use std::time::Duration;

use ringcat::{Cable, Event, PortOf, Position};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port;
use scenarios::check::ring_events;
use scenarios::segments::{MAIN, REDUNDANT, at, cable_of_ring, ring_of_16, wired};
use scenarios::world::{Mark, World};

use crate::topologies::ring_with_branch;

/// A cable of its ring, by positions: the branch is processed after the second SubDevice.
fn cable(number: usize) -> Cable {
    const POSITIONS: [usize; 5] = [0, 1, 4, 5, 6];
    let port = |device: usize, port: u8| PortOf::new(Position(POSITIONS[device] as u16), port);
    Cable { near: number.checked_sub(1).map(|device| port(device, 1)), far: (number < 5).then(|| port(number, 0)) }
}

fn places(world: &World, mark: Mark) -> Vec<Cable> {
    let place = |event: &Event| match event {
        Event::BreakLocated { cable } => Some(*cable),
        _ => None,
    };
    ring_events(world.events(mark)).into_iter().filter_map(place).collect()
}

// covers: CR-12, ring-places
#[test]
fn an_absent_branch_is_never_reported_as_the_break_of_the_ring() {
    for number in 0..=5 {
        let mut world = World::in_op(number as u64, ring_with_branch(Port::D));
        world.cut(CableId(6));
        world.run_cycles(200);
        let mark = world.mark();
        world.cut(CableId(number));
        world.run_cycles(200);
        assert_eq!(places(&world, mark), [cable(number)], "cable {number}");
        assert_eq!(world.application().ring_status().place, Some(cable(number)));
        // The same with a branch that is unplugged while the ring is open.
        world.heal(CableId(6));
        world
            .until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
        world.cut(CableId(6));
        world.run_cycles(200);
        assert_eq!(places(&world, mark), [cable(number)], "cable {number}");
        assert_eq!(world.application().ring_status().place, Some(cable(number)));
        world.heal(CableId(number));
        world.run_cycles(100);
        let reports = ring_events(world.events(mark));
        assert!(
            matches!(reports.last(), Some(Event::RingClosed { place: Some(it), .. }) if *it == cable(number)),
            "{reports:?}"
        );
    }
}

/// A ring of couplers that continues from their port 2, as on real ones, with two terminals on port 1 of each.
fn ring_of_couplers(couplers: usize) -> (Vec<&'static str>, Vec<(Endpoint, Endpoint)>) {
    use Port::{A, B, C};
    let mut kinds = vec!["coupler"; couplers];
    let mut cables: Vec<(Endpoint, Endpoint)> = vec![(MAIN, at(0, A))];
    cables.extend((1..couplers).map(|number| (at(number - 1, C), at(number, A))));
    cables.push((at(couplers - 1, C), REDUNDANT));
    for coupler in 0..couplers {
        cables.extend([(at(coupler, B), at(kinds.len(), A)), (at(kinds.len(), B), at(kinds.len() + 1, A))]);
        kinds.extend(["digital-output-8", "digital-input-8"]);
    }
    (kinds, cables)
}

// covers: CR-12, ring-branches
#[test]
fn a_broken_ring_of_couplers_with_terminals_is_located_at_the_scan() {
    for (couplers, number) in (1..4).flat_map(|couplers| (0..=couplers).map(move |number| (couplers, number))) {
        let (kinds, cables) = ring_of_couplers(couplers);
        let mut network = wired(&kinds, &cables);
        network.advance_by(Duration::from_millis(10));
        network.cut(CableId(number));
        let mut world = World::in_op(number as u64, network);
        world.run_cycles(60);
        let end = |end: Endpoint| match end {
            Endpoint::Device(device, port) => {
                let node = (0..kinds.len()).find(|it| world.device_of(*it) == Some(device)).expect("scanned");
                Some(PortOf::new(Position(node as u16), port.index() as u8))
            }
            Endpoint::Host(_) => None,
        };
        let truth = Cable { near: end(cables[number].0), far: end(cables[number].1) };
        assert_eq!(places(&world, world.beginning()), [truth], "{couplers} couplers, cable {number}");
    }
}

// covers: CR-12, CR-18, ring-places
#[test]
fn each_of_two_breaks_is_reported_once_with_its_place() {
    for [first, second] in [[4, 11], [11, 4], [0, 9], [9, 0], [16, 5], [5, 16], [7, 8], [8, 7]] {
        let mut world = World::in_op(3, ring_of_16(Duration::from_micros(10)));
        let [one, other] = [first, second].map(|number| cable_of_ring(number, 16));
        let mark = world.mark();
        world.cut(CableId(first));
        world.run_cycles(50);
        assert_eq!(places(&world, mark), [one], "{first} and {second}");
        world.cut(CableId(second));
        world.run_cycles(200);
        // The cable of an interface cannot be located if no SubDevice behind it responds.
        let reports: &[Cable] = if [0, 16].contains(&second) { &[one] } else { &[one, other] };
        assert_eq!(places(&world, mark), reports, "{first} and {second}");
        world.heal(CableId(first));
        world
            .until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
        world.run_cycles(50);
        assert_eq!(places(&world, mark), [one, other], "{first} and {second}");
        assert_eq!(world.application().ring_status().place, Some(other));
        world.heal(CableId(second));
        world.run_cycles(50);
        let reports = ring_events(world.events(mark));
        assert!(
            matches!(reports.last(), Some(Event::RingClosed { place: Some(it), .. }) if *it == other),
            "{reports:?}"
        );
        assert_eq!(reports.len(), 4, "{reports:?}");
    }
}

// covers: CR-18, ring-places
#[test]
fn a_subdevice_without_power_is_two_breaks() {
    let mut world = World::in_op(4, ring_of_16(Duration::from_micros(10)));
    let mark = world.mark();
    world.power_off(DeviceIndex(6));
    world.run_cycles(200);
    assert_eq!(places(&world, mark), [6, 7].map(|number| cable_of_ring(number, 16)));
    world.power_on(DeviceIndex(6));
    world.until(Duration::from_secs(3), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    world.run_cycles(50);
    let reports = ring_events(world.events(mark));
    assert!(matches!(reports[..], [Event::RingOpened { .. }, _, _, Event::RingClosed { .. }]), "{reports:?}");
}
