//! Declared connections that do not exist (JR-05, JR-06): they are refused, even if open ports allow them; existing
//! ones are accepted.

use std::time::Duration;

use ringcat::{
    ActivateError, Error, JunctionConnection, JunctionError, JunctionMode, MainDevice, Options, SubDeviceId, automatic,
};
use ringcat_sim::cable::{CableId, Endpoint};
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::Network;
use ringcat_wire::register::DlStatus;
use scenarios::dice::Dice;
use scenarios::segments::{MAIN, REDUNDANT, RING_OF_THREE, TWO_RINGS, at, descriptions, wired, wired_with};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

use super::plans::Plan;
use super::{ONE, STRICT, changed, edge, in_op, one_ring, reports};

fn connection((head, tail, tail_port): (usize, usize, u8)) -> JunctionConnection {
    JunctionConnection::new(SubDeviceId(head), 1, SubDeviceId(tail), tail_port)
}

/// The connection that is refused as missing.
fn refused(seed: u64, network: Network, connections: &[JunctionConnection]) -> Option<JunctionConnection> {
    let options = Options::default().with_junctions(JunctionMode::Strict);
    let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
    not_there(World::with_junctions(seed, network, &options, declare, connections))
}

fn not_there(result: Result<World, Error>) -> Option<JunctionConnection> {
    match result {
        Ok(_) => None,
        Err(Error::Activate(ActivateError::Junction(JunctionError::NotThere { connection, .. }))) => Some(connection),
        Err(error) => panic!("{error}"),
    }
}

// covers: JR-05, JR-06, junctions
#[test]
fn a_wrong_declared_closing_cable_is_refused_closed_and_broken() {
    // Open ports allow all of these but the last.
    for wrong in [(1, 2, 1), (1, 3, 1), (1, 5, 1), (1, 6, 1)].map(connection) {
        for broken in [None, Some(2), Some(3), Some(4), Some(5)] {
            let mut network = one_ring();
            broken.into_iter().for_each(|cable| network.cut(CableId(cable)));
            // With the closing cable cut, another cut cable cannot be located.
            let is_hidden = broken == Some(5) && wrong.tail == SubDeviceId(6);
            let expected = (!is_hidden).then_some(wrong);
            assert_eq!(refused(20, network, &[wrong]), expected, "{wrong}, cable {broken:?}");
        }
    }
    for broken in RING_OF_THREE {
        let mut network = one_ring();
        network.cut(CableId(broken));
        assert_eq!(refused(21, network, &[STRICT]), None, "cable {broken}");
    }
    let mut world = in_op(22, one_ring(), (JunctionMode::Strict, &[STRICT]));
    assert_eq!(reports(&world, world.beginning()), [], "a test is not reported as a break");
    let mark = edge(&mut world, "cut", |world| world.cut(CableId(3)));
    assert_eq!(reports(&world, mark), [changed(3, true)]);
}

// covers: JR-05, JR-06, junctions
#[test]
fn exchanged_connections_and_those_of_a_line_are_refused() {
    const KINDS: [&str; 7] =
        ["junction", "digital-output-8", "servo", "junction", "digital-input-8", "block", "analog-input-4"];
    let two = || wired(&KINDS, &TWO_RINGS);
    let right = [(0, 2, 1), (3, 5, 1)].map(connection);
    assert_eq!(refused(23, two(), &right), None);
    let [first, second] = [(0, 5, 1), (3, 6, 1)].map(connection);
    assert_eq!(refused(23, two(), &[first]), Some(first), "the tail of the other ring");
    assert_eq!(refused(23, two(), &[right[0], second]), Some(second));
    assert!(refused(23, two(), &[(0, 1, 1), (3, 5, 1)].map(connection)).is_some());
    // No ring: a line through port 1, with a branch on port 3, and with a second interface at its end.
    let line = [(MAIN, at(0, A)), (at(0, D), at(1, A)), (at(0, B), at(2, A)), (at(2, B), at(3, A))];
    let kinds = ["junction", "digital-output-8", "servo", "digital-input-8"];
    let wrong = connection((0, 1, 1));
    assert_eq!(refused(24, wired(&kinds, &line), &[wrong]), Some(wrong));
    let ring: Vec<(Endpoint, Endpoint)> = line.into_iter().chain([(at(3, B), REDUNDANT)]).collect();
    assert_eq!(refused(25, wired(&kinds, &ring), &[wrong]), Some(wrong));
    // In a ring of two links, closed and broken before the junction.
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, D), at(2, A)),
        (at(2, B), at(3, A)),
        (at(3, B), at(4, A)),
        (at(4, B), at(1, B)),
        (at(1, C), at(5, A)),
        (at(5, B), at(6, A)),
        (at(6, B), REDUNDANT),
    ];
    for broken in [None, Some(1), Some(6), Some(7)] {
        for (tail, is_right) in [(2, false), (3, false), (4, true), (5, false), (6, false)] {
            let mut network = wired(&ONE, &cables);
            broken.into_iter().for_each(|cable| network.cut(CableId(cable)));
            let declared = connection((1, tail, 1));
            let got = refused(26, network, &[declared]);
            assert_eq!(got, (!is_right).then_some(declared), "cable {broken:?}, tail {tail}");
        }
    }
}

// covers: JR-05, JR-06, junctions
#[test]
fn only_right_connections_of_random_segments_are_accepted() {
    let (mut taken, mut wrong) = (0, 0);
    for seed in 0..16 {
        let dice = &mut Dice::new(900 + seed);
        let plan = Plan::random(dice);
        if plan.connections.iter().any(|it| it.head_port != 1) {
            continue;
        }
        let what = |of: &Plan| format!("seed {seed}: {:?}", of.connections);
        let broken = dice.one_in(2).then(|| *dice.pick(&plan.local));
        let cut = |network: &mut Network| broken.into_iter().for_each(|cable| network.cut(CableId(cable)));
        assert_eq!(not_there(plan.try_world(seed, true, true, cut)), None, "{}, cable {broken:?}", what(&plan));
        taken += 1;
        // One connection has another member as its tail.
        let number = dice.below(plan.connections.len() as u64) as usize;
        let tails =
            (0..plan.kinds.len()).filter(|node| plan.connections.iter().all(|it| it.tail != SubDeviceId(*node)));
        let tails: Vec<usize> = tails.filter(|node| *node > plan.connections[number].head.0).collect();
        let Some(tail) = (!tails.is_empty()).then(|| *dice.pick(&tails)) else { continue };
        let mut other = Plan { connections: plan.connections.clone(), ..plan };
        other.connections[number] = connection((other.connections[number].head.0, tail, 1));
        assert!(not_there(other.try_world(seed, true, true, |_| ())).is_some(), "{}", what(&other));
        wrong += 1;
    }
    assert!(taken > 8 && wrong > 5, "{taken}, {wrong}");
}

/// A SubDevice upstream of the ring comes back with another address: addresses no longer follow the positions.
// covers: JR-05, JR-06, junctions
#[test]
fn connections_are_checked_at_the_addresses_that_subdevices_have() {
    const BRANCH: CableId = CableId(1);
    let kinds = ["junction", "digital-input-8", "junction", "digital-output-8", "servo", "digital-input-8", "block"];
    let cables = [
        (MAIN, at(0, A)),
        (at(0, D), at(1, A)),
        (at(0, B), at(2, A)),
        (at(2, D), at(3, A)),
        (at(3, B), at(4, A)),
        (at(4, B), at(5, A)),
        (at(5, B), at(2, B)),
        (at(2, C), at(6, A)),
    ];
    for broken in [None, Some(CableId(4))] {
        for (tail, is_right) in [(5, true), (4, false), (6, false)] {
            let mut network = wired(&kinds, &cables);
            network.cut(BRANCH);
            broken.into_iter().for_each(|cable| network.cut(cable));
            let options = Options::default().with_idle_operation(true).with_junctions(JunctionMode::Strict);
            let mut main_device = MainDevice::request(Tap::new(network), &options);
            main_device.attend(Duration::from_secs(1));
            assert_eq!(main_device.subdevices().len(), kinds.len() - 1);
            main_device.links_mut().network_mut().heal(BRANCH);
            main_device.attend(Duration::from_secs(1));
            assert_eq!(main_device.subdevices().len(), kinds.len());
            main_device.load(automatic(&main_device.subdevices(), CYCLE)).expect("it fits");
            let declared = JunctionConnection::new(SubDeviceId(2), 1, SubDeviceId(tail), 1);
            main_device.add_junction_connection(declared).expect("ports that exist");
            let got = main_device.apply().map(drop).map_err(|refused| refused.error);
            let is_refused =
                matches!(got, Err(Error::Activate(ActivateError::Junction(JunctionError::NotThere { .. }))));
            assert_eq!((got.is_ok(), is_refused), (is_right, !is_right), "{broken:?}, tail {tail}: {got:?}");
        }
    }
}

/// Five in a row on the first port of a junction: no ring.
const NO_RING: [(Endpoint, Endpoint); 5] =
    [(MAIN, at(0, A)), (at(0, D), at(1, A)), (at(1, B), at(2, A)), (at(0, B), at(3, A)), (at(3, B), at(4, A))];

/// A wrong connection in [`NO_RING`], loaded while the last SubDevice, which was added and has a slow EEPROM, is read.
fn loaded_while_reading(busy: Duration) -> MainDevice<Tap> {
    let mut described = descriptions(&["junction", "digital-output-8", "servo", "digital-input-8", "digital-input-8"]);
    described[4].sii_busy = busy;
    let mut network = wired_with(described, &NO_RING);
    network.cut(CableId(4));
    network.advance_by(Duration::from_millis(1));
    let options = Options::default().with_idle_operation(true).with_junctions(JunctionMode::Strict);
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    main_device.attend(Duration::from_secs(1));
    main_device.load(automatic(&main_device.subdevices(), CYCLE)).expect("it fits");
    main_device.add_junction_connection(connection((0, 2, 1))).expect("ports that exist");
    main_device.links_mut().network_mut().heal(CableId(4));
    main_device.attend(Duration::from_millis(100));
    main_device
}

// covers: JR-05, JR-06, junctions
#[test]
fn a_wrong_connection_is_not_accepted_while_a_change_is_read() {
    for busy in [0, 1, 10, 40, 99].map(Duration::from_millis) {
        let checked = loaded_while_reading(busy).check_connections();
        let is_refused = matches!(checked, Err(JunctionError::NotThere { .. } | JunctionError::NotTested));
        assert!(is_refused, "{busy:?}: {checked:?}");
    }
}

/// A scan opens all ports: then the wrong connection would look right.
// covers: JR-05, JR-06, junctions
#[test]
fn a_wrong_connection_is_not_accepted_while_a_scan_begins() {
    let mut not_tested = 0;
    for after in 0..60 {
        let mut main_device = loaded_while_reading(Duration::ZERO);
        main_device.attend(Duration::from_secs(1));
        let mut check = main_device.engine_mut().start_connection_check();
        main_device.attend(Duration::from_micros(50 * after));
        main_device.engine_mut().restart_scan().expect("it is permitted");
        main_device.attend(Duration::from_secs(12));
        let checked = check.take();
        assert!(
            matches!(checked, Some(Err(JunctionError::NotThere { .. } | JunctionError::NotTested))),
            "{after}: {checked:?}"
        );
        not_tested += usize::from(matches!(checked, Some(Err(JunctionError::NotTested))));
    }
    assert!(not_tested > 0, "no scan began in a test");
}

/// The test reads the ports, which clears the events by which idle operation detects a change.
// covers: JR-05, JR-06, junctions, ring-goes-on
#[test]
fn a_change_that_only_the_test_of_a_connection_sees_is_followed() {
    const CLOSING: CableId = CableId(RING_OF_THREE[3]);
    let status = |main_device: &MainDevice<Tap>| -> Vec<DlStatus> {
        main_device.subdevices().iter().map(|info| info.dl_status).collect()
    };
    for (after, declared) in (0..25).flat_map(|after| [(after, STRICT), (after, connection((1, 3, 1)))]) {
        let options = Options::default().with_idle_operation(true).with_junctions(JunctionMode::Strict);
        let mut main_device = MainDevice::request(Tap::new(one_ring()), &options);
        main_device.attend(Duration::from_secs(1));
        let whole = status(&main_device);
        main_device.load(automatic(&main_device.subdevices(), CYCLE)).expect("it fits");
        main_device.add_junction_connection(declared).expect("ports that exist");
        main_device.links_mut().network_mut().cut(CLOSING);
        main_device.attend(Duration::from_secs(1));
        assert_ne!(status(&main_device), whole, "the cut is followed");
        main_device.links_mut().network_mut().heal(CLOSING);
        main_device.attend(Duration::from_millis(after));
        assert_eq!(main_device.check_connections().is_ok(), declared == STRICT, "{after}, {declared}");
        main_device.attend(Duration::from_secs(1));
        assert_eq!(status(&main_device), whole, "{after} ms after it was repaired, {declared}");
    }
}
