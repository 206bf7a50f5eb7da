//! Distributed clocks while the segment changes: rings behind junctions, groups that come and go, trees, clocks that
//! lose their power (protocol 7.1, 7.5, 9.4).

use std::time::Duration;

use ringcat::{
    ClockConfig, DomainMember, Event, Group, JunctionMode, MainDevice, Options, SubDeviceConfig, SubDeviceInfo,
    SyncSignals, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::clocks::{clocked, config, differences, largest_spread, lock, watch, wired, with_clocks};
use scenarios::dice::Dice;
use scenarios::segments::{MAIN, REDUNDANT, RING_BEHIND_JUNCTION, RING_IN_RING, RING_OF_THREE, TWO_RINGS, at, line};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

fn all(network: &Network) -> Vec<usize> {
    (0..network.devices().len()).collect()
}

fn begun(seed: u64, network: Network, config: ClockConfig) -> World {
    let options = Options::default().with_junctions(JunctionMode::Automatic);
    World::with(seed, network, &options, |scan| with_clocks(scan, config))
        .unwrap_or_else(|error| panic!("seed {seed}: {error}"))
}

fn world(seed: u64, network: Network) -> World {
    let mut world = begun(seed, network, config());
    lock(&mut world, Duration::from_secs(5));
    world
}

/// Clocks everywhere in [`RING_BEHIND_JUNCTION`].
fn junction_ring() -> Network {
    wired(clocked(7, 50), &RING_BEHIND_JUNCTION)
}

/// A change of the segment: no clock drifts away meanwhile, and soon all are synchronous as before.
fn change(world: &mut World, what: &str, act: impl FnOnce(&mut World)) -> usize {
    let clocks = all(world.network());
    let mark = world.mark();
    act(world);
    let [over] = watch(world, [&clocks], 400);
    let [after] = watch(world, [&clocks], 100);
    let failed = |event: &Event| matches!(event, Event::ClocksFailed { .. } | Event::SyncWindow { inside: false, .. });
    assert!(!world.saw(mark, failed), "{what}");
    assert!(over <= 1_000 && after <= 100, "{what}: {over} ns, then {after} ns");
    world.events(mark).iter().filter(|timed| matches!(timed.event, Event::DelaysChanged { .. })).count()
}

// covers: 7.5, 9.4, dc-delays
#[test]
fn clocks_of_a_local_ring_stay_synchronous_with_any_break() {
    let mut world = world(1, junction_ring());
    let clocks = all(world.network());
    assert!(largest_spread(&mut world, &clocks, 300) <= 100, "{:?}", differences(world.network(), &clocks));
    for cable in RING_OF_THREE {
        let cut = change(&mut world, &format!("cut of cable {cable}"), |world| world.cut(CableId(cable)));
        let heal = change(&mut world, &format!("repair of cable {cable}"), |world| world.heal(CableId(cable)));
        assert_eq!((cut, heal), (1, 1), "cable {cable}");
    }
}

// covers: 7.2.1, dc-tools
#[test]
fn the_free_running_rate_of_a_clock_is_known_after_lock_and_changes() {
    let free: Vec<i64> = clocked(7, 50).iter().map(|description| description.clock_drift_ppb).collect();
    let mut world = world(1, junction_ring());
    let is_right = |world: &World| {
        let clocks = world.application().engine().clocks();
        let off = |clock: &ringcat::ClockStatus| {
            let expected = free[usize::from(clock.position.0)] - free[0];
            (clock.drift_ppb - expected).abs()
        };
        let largest = clocks.iter().map(off).max();
        assert!(largest.is_some_and(|ppb| ppb <= 2_000), "{clocks:?}, expected {free:?}");
    };
    is_right(&world);
    assert_eq!(change(&mut world, "cut", |world| world.cut(CableId(3))), 1);
    is_right(&world);
}

// covers: dc-delays
#[test]
fn a_local_ring_broken_from_the_start_has_right_delays_before_and_after_repair() {
    for cable in [3, 2] {
        let mut network = junction_ring();
        network.cut(CableId(cable));
        network.advance_by(Duration::from_millis(1));
        let mut world = world(2, network);
        let clocks = all(world.network());
        assert!(largest_spread(&mut world, &clocks, 200) <= 100, "cable {cable}");
        change(&mut world, &format!("first repair of cable {cable}"), |world| world.heal(CableId(cable)));
        change(&mut world, "another break", |world| world.cut(CableId(4)));
    }
}

// covers: dc-delays
#[test]
fn a_local_ring_in_a_ring_of_two_links_keeps_its_clocks_through_breaks_of_either() {
    let mut world = world(3, wired(clocked(5, 50), &RING_IN_RING));
    let clocks = all(world.network());
    for cable in [3, 5, 1, 4] {
        let what = format!("cable {cable}");
        let (front, behind): (Vec<usize>, Vec<usize>) = match cable {
            5 => (vec![0, 1, 2, 3], vec![4]),
            1 => (vec![0], vec![1, 2, 3, 4]),
            _ => (clocks.clone(), Vec::new()),
        };
        world.cut(CableId(cable));
        let [inside, other, across] = watch(&mut world, [&front, &behind, &clocks], 500);
        assert!(inside <= 1_000 && other <= 1_000 && across <= 5_000, "{what}: {inside}, {other}, {across} ns");
        let [inside, other] = watch(&mut world, [&front, &behind], 50);
        assert!(inside <= 100 && other <= 100, "{what} cut: {inside}, {other} ns");
        world.heal(CableId(cable));
        let [over] = watch(&mut world, [&clocks], 1_500);
        let [after] = watch(&mut world, [&clocks], 100);
        assert!(over <= 5_000 && after <= 100, "{what} healed: {over}, then {after} ns");
    }
}

/// No frame comes back meanwhile, and rings are examined one after the other.
// covers: JR-02, 7.5, dc-delays
#[test]
fn clocks_resynchronise_after_two_local_rings_broke_at_once() {
    let mut world = world(10, wired(clocked(7, 50), &TWO_RINGS));
    let clocks = all(world.network());
    for (first, second, gap) in [(2, 6, 100), (5, 1, 800)] {
        let what = format!("cables {first} and {second}");
        let mark = world.mark();
        world.cut(CableId(first));
        world.cut(CableId(second));
        let [blocked] = watch(&mut world, [&clocks], gap);
        world.heal(CableId(first));
        world.until(Duration::from_secs(5), "all in OP", |w| w.all_in_op() && w.application().all_settled());
        lock(&mut world, Duration::from_secs(5));
        let [over] = watch(&mut world, [&clocks], 600);
        let [after] = watch(&mut world, [&clocks], 100);
        println!("{what}: {blocked} ns while blocked, then {over} and {after} ns");
        assert_eq!(world.left_op(mark), [], "{what}");
        assert!(over <= 10_000 && after <= 100, "{what}: {over}, then {after} ns");
        change(&mut world, &what, |world| world.heal(CableId(second)));
    }
}

// covers: dc-ring
#[test]
fn a_ring_broken_from_the_start_has_the_delay_of_its_cable_after_the_repair() {
    let count = 6;
    let mut cables: Vec<(Endpoint, Endpoint)> = (1..count).map(|device| (at(device - 1, B), at(device, A))).collect();
    cables.insert(0, (MAIN, at(0, A)));
    cables.push((at(count - 1, B), REDUNDANT));
    let mut descriptions = clocked(count, 50);
    // Entered from behind, and latching only frames in processing direction unless 0x0936 is set.
    descriptions[4].latches_processing_only = true;
    let mut network = wired(descriptions, &cables);
    network.cut(CableId(3));
    network.advance_by(Duration::from_millis(1));
    let mut world = world(4, network);
    let clocks = all(world.network());
    let mark = world.mark();
    world.heal(CableId(3));
    let [over] = watch(&mut world, [&clocks], 2_000);
    let [after] = watch(&mut world, [&clocks], 200);
    assert!(over <= 5_000 && after <= 100, "{over}, then {after} ns");
    // The ring is opened for a moment to measure the cable: this is not reported, and nothing is lost.
    assert!(!world.saw(mark, |event| matches!(event, Event::RingOpened { .. })));
    assert!(world.incomplete(mark) <= 1 && world.left_op(mark).is_empty());
}

/// A ring behind a junction in mode disabled: delays cannot be measured. This is reported once, and again when the
/// segment has changed; with the ring broken the delays are right.
// covers: 7.1, 9.4, dc-lock
#[test]
fn an_undetected_local_ring_is_reported_per_change_until_it_opens() {
    let mut world = World::with(9, junction_ring(), &Options::default(), |scan| with_clocks(scan, config()))
        .expect("it can be activated");
    let mark = world.beginning();
    let failures = |world: &World, mark| {
        let failed = |timed: &&ringcat::TimedEvent| matches!(timed.event, Event::ClocksFailed { .. });
        world.events(mark).iter().filter(failed).count()
    };
    world.run_cycles(3_000);
    assert!(world.all_in_op());
    assert_eq!(failures(&world, mark), 1);
    // An unrelated branch.
    world.cut(CableId(7));
    world.run_cycles(2_000);
    assert_eq!(failures(&world, mark), 2);
    world.heal(CableId(7));
    world.run_cycles(100);
    let mark = world.mark();
    world.cut(CableId(5));
    lock(&mut world, Duration::from_secs(4));
    assert_eq!(failures(&world, mark), 0);
    let clocks = all(world.network());
    assert!(largest_spread(&mut world, &clocks, 200) <= 100, "{:?}", differences(world.network(), &clocks));
}

/// A trunk of three junctions with branches on ports 3 and 2, six clocks in branches, up to 100 ppm from the reference.
fn tree() -> Network {
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, B), at(2, A)),
        (at(0, D), at(3, A)),
        (at(3, B), at(4, A)),
        (at(1, D), at(5, A)),
        (at(1, C), at(6, A)),
        (at(6, B), at(7, A)),
        (at(2, D), at(8, A)),
    ];
    let mut descriptions = clocked(9, 100);
    descriptions[0].clock_drift_ppb = 0;
    // One SubDevice in between has no clock, one latches only frames in processing direction.
    descriptions[6].dc = None;
    descriptions[4].latches_processing_only = true;
    wired(descriptions, &cables)
}

#[test]
fn clocks_lock_with_random_frame_loss_from_the_start() {
    let mut world = begun(8, tree(), config().with_drift_distributions(20_000));
    let mut dice = Dice::new(8);
    for _ in 0..150 {
        world.drop(CableId(dice.below(9) as usize), 1);
        world.run_cycles(1 + dice.below(8));
    }
    lock(&mut world, Duration::from_secs(5));
    let clocks: Vec<usize> = (0..9).filter(|device| *device != 6).collect();
    assert!(largest_spread(&mut world, &clocks, 200) <= 100, "{:?}", differences(world.network(), &clocks));
}

// covers: dc-remeasure
#[test]
fn delays_stay_right_when_any_cable_of_a_tree_is_cut_under_loss() {
    let mut world = begun(5, tree(), config());
    lock(&mut world, Duration::from_secs(5));
    let mut dice = Dice::new(5);
    let clocks: Vec<usize> = (0..9).filter(|device| *device != 6).collect();
    assert!(largest_spread(&mut world, &clocks, 200) <= 100);
    for cable in 1..9 {
        // Behind it.
        let lost: &[usize] = match cable {
            1 => &[1, 2, 5, 7, 8],
            2 => &[2, 8],
            3 => &[3, 4],
            4 => &[4],
            5 => &[5],
            6 | 7 => &[7],
            _ => &[8],
        };
        let left: Vec<usize> = clocks.iter().copied().filter(|device| !lost.contains(device)).collect();
        world.cut(CableId(cable));
        let [apart] = watch(&mut world, [&left], 150);
        world.heal(CableId(cable));
        for _ in 0..8 {
            world.drop(CableId(dice.below(9) as usize), 1);
            world.run_cycles(1 + dice.below(20));
        }
        let [together] = watch(&mut world, [&clocks], 100);
        world.until(Duration::from_secs(4), "all in OP", World::all_in_op);
        let [after] = watch(&mut world, [&clocks], 100);
        assert!(apart <= 200 && together <= 1_000 && after <= 120, "cable {cable}: {apart}, {together}, {after} ns");
    }
}

// covers: 7.5, dc-lock
#[test]
fn a_reference_that_loses_its_power_is_replaced_and_comes_back_without_a_jump() {
    let count = 6;
    let mut cables: Vec<(Endpoint, Endpoint)> = (1..count).map(|device| (at(device - 1, B), at(device, A))).collect();
    cables.insert(0, (MAIN, at(0, A)));
    cables.push((at(count - 1, B), REDUNDANT));
    let options = Options::default();
    let mut world = World::with(6, wired(clocked(count, 50), &cables), &options, |scan| {
        let mut declaration = with_clocks(scan, config());
        for subdevice in &mut declaration.subdevices {
            subdevice.sync = Some(SyncSignals::sync0(1_000_000, 0));
        }
        declaration
    })
    .expect("it can be activated");
    world.until(Duration::from_secs(4), "all in OP", World::all_in_op);
    let others: Vec<usize> = (1..count).collect();
    let mark = world.mark();
    let time = |world: &World| {
        let network = world.network();
        let time = network.device(DeviceIndex(3)).controller.system_time(network.now());
        time.wrapping_sub(network.now().0) as u32
    };
    world.run_cycles(300);
    let before = time(&world);
    world.power_off(DeviceIndex(0));
    let [without] = watch(&mut world, [&others], 400);
    world.power_on(DeviceIndex(0));
    let [back] = watch(&mut world, [&others], 400);
    world.until(Duration::from_secs(8), "all in OP again", World::all_in_op);
    let clocks = all(world.network());
    let [together] = watch(&mut world, [&clocks], 200);
    assert!(without <= 1_000 && back <= 1_000 && together <= 200, "{without}, {back}, {together} ns");
    let elected =
        |event: &Event| matches!(event, Event::ReferenceClock { position: Some(position) } if position.0 == 1);
    assert!(world.saw(mark, elected));
    let took_over =
        |event: &Event| matches!(event, Event::ReferenceClock { position: Some(position) } if position.0 == 0);
    assert!(!world.saw(mark, took_over), "the returned clock follows");
    let drifted = i64::from(time(&world).wrapping_sub(before) as i32);
    // Seconds with clocks that differ by less than 100 ppm: no jump.
    let passed = 8_000_000_000_i64;
    assert!(drifted.abs() < passed / 10_000, "{drifted} ns");
    assert!(world.left_op(mark).iter().all(|device| device.0 == 0));
}

/// Four in a line; a group of two has a place behind port 3 of device 1 (devices 4 and 5) and one at the end (6 and 7).
fn two_places() -> Network {
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, B), at(2, A)),
        (at(2, B), at(3, A)),
        (at(1, D), at(4, A)),
        (at(4, B), at(5, A)),
        (at(3, B), at(6, A)),
        (at(6, B), at(7, A)),
    ];
    let mut descriptions = clocked(8, 50);
    [4, 6].into_iter().for_each(|head: usize| descriptions[head].alias = TOOL);
    let mut network = wired(descriptions, &cables);
    (4..8).for_each(|device| network.power_off(DeviceIndex(device)));
    network
}

const TOOL: u16 = 5;

// covers: dc-remeasure
#[test]
fn a_group_that_joins_late_or_elsewhere_has_the_clocks_of_its_place() {
    let links = Tap::new(line(clocked(4, 50), NetworkOptions::default()));
    let infos = MainDevice::request(links, &Options::default()).scan().expect("a scan").subdevices;
    let expect = |config: SubDeviceConfig, info: &SubDeviceInfo| {
        config.expect_product(info.identity.vendor_id, info.identity.product_code).pdos_of(info)
    };
    let group = Group::new(expect(SubDeviceConfig::at_alias(TOOL, 0), &infos[0]));
    let group = group.then(expect(SubDeviceConfig::default(), &infos[0]));
    let mut world = World::with(7, two_places(), &Options::default(), |_| {
        let mut declaration = automatic(&infos, CYCLE);
        let members = declaration.add_group(group).members;
        declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
        declaration.clocks = Some(config());
        declaration.subdevices.iter_mut().for_each(|config| config.sync = Some(SyncSignals::sync0(1_000_000, 0)));
        declaration
    })
    .expect("it can be activated");
    world.until(Duration::from_secs(4), "the others settled", |world| world.application().all_settled());
    for place in [[6, 7], [4, 5], [6, 7]] {
        let base = [0, 1, 2, 3];
        let mark = world.mark();
        place.iter().for_each(|device| world.power_on(DeviceIndex(*device)));
        world.until(Duration::from_secs(8), "the group has joined", |world| {
            world.application().groups()[0].has_joined()
        });
        let together: Vec<usize> = base.into_iter().chain(place).collect();
        let [others, spread] = watch(&mut world, [&base, &together], 200);
        assert!(others <= 100 && spread <= 150, "{place:?}: {others}, {spread} ns");
        assert!(world.saw(mark, |event| matches!(event, Event::DelaysChanged { .. })), "{place:?}");
        assert_eq!(world.application().engine().clocks().len(), 6);
        place.iter().rev().for_each(|device| world.power_off(DeviceIndex(*device)));
        world.until(Duration::from_secs(2), "the group has left", |world| world.application().groups()[0].present == 0);
        let [others] = watch(&mut world, [&base], 100);
        assert!(others <= 200 && world.left_op(mark).iter().all(|device| device.0 > 3), "{others} ns");
    }
}

/// Three without a clock; a group of three behind port 3 of the second one brings the first clocks of the segment, and
/// one SubDevice without a clock between them.
// covers: 7.2, dc-remeasure
#[test]
fn the_first_clocks_of_a_segment_may_join_with_a_group() {
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, B), at(2, A)),
        (at(1, D), at(3, A)),
        (at(3, B), at(4, A)),
        (at(4, B), at(5, A)),
    ];
    let mut descriptions = clocked(6, 50);
    [0, 1, 2, 4].into_iter().for_each(|device: usize| descriptions[device].dc = None);
    descriptions[3].alias = TOOL;
    let infos = MainDevice::request(Tap::new(wired(descriptions.clone(), &cables)), &Options::default());
    let infos = { infos }.scan().expect("a scan").subdevices;
    let mut network = wired(descriptions, &cables);
    (3..6).for_each(|device| network.power_off(DeviceIndex(device)));
    let signals = SyncSignals::sync0(1_000_000, 0);
    let mut world = World::with(10, network, &Options::default(), |scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let head = SubDeviceConfig::at_alias(TOOL, 0).sync(signals);
        let member = |config: SubDeviceConfig, info: &SubDeviceInfo| {
            config.expect_product(info.identity.vendor_id, info.identity.product_code).pdos_of(info)
        };
        let group = Group::new(member(head, &infos[0])).then(member(SubDeviceConfig::default(), &infos[0]));
        let last = SubDeviceConfig::default().sync(signals);
        let members = declaration.add_group(group.then(member(last, &infos[0]))).members;
        declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
        declaration.clocks = Some(config());
        declaration
    })
    .expect("it can be activated");
    world.until(Duration::from_secs(4), "the others settled", |world| world.application().all_settled());
    let mark = world.beginning();
    for _ in 0..2 {
        (3..6).for_each(|device| world.power_on(DeviceIndex(device)));
        world.until(Duration::from_secs(8), "the group has joined", |world| {
            world.application().groups()[0].has_joined() && world.application().engine().clocks_locked()
        });
        let [apart] = watch(&mut world, [&[3, 5]], 200);
        assert!(apart <= 100, "{apart} ns");
        let now = world.network().now();
        [3, 5].into_iter().for_each(|device| {
            assert!(
                world.network().device(DeviceIndex(device)).controller.next_sync0(now).is_some(),
                "device {device}"
            );
        });
        (3..6).rev().for_each(|device| world.power_off(DeviceIndex(device)));
        world.until(Duration::from_secs(2), "the group has left", |world| world.application().groups()[0].present == 0);
    }
    // The missing clocks were reported once.
    let failed = |timed: &&ringcat::TimedEvent| matches!(timed.event, Event::ClocksFailed { .. });
    assert_eq!(world.events(mark).iter().filter(failed).count(), 1);
    assert!(world.left_op(mark).iter().all(|device| device.0 > 2));
}
