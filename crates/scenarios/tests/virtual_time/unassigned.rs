//! SubDevices that come back without an address: distinguished, identified, and without effect on the others.

use std::time::Duration;

use ringcat::{DomainId, DomainMember, Event, Options, SubDeviceId, automatic};
use ringcat_engine::config::ConfigAddress;
use ringcat_engine::main_device::SubDeviceState;
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::{AlControl, AlState, AlStatus};
use ringcat_wire::register::{Fmmu, map};
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::{CYCLE, World};

const SIX: [&str; 6] =
    ["coupler", "digital-input-8", "digital-output-8", "digital-input-16", "digital-output-8", "digital-input-8"];
const SETTLED: SubDeviceState = SubDeviceState::Settled(AlState::Op);

fn six(closed: bool) -> Network {
    let build = if closed { ring } else { line };
    build(descriptions(&SIX), NetworkOptions::default())
}

/// The first `declared` SubDevices are declared, the others are not.
fn world(network: Network, declared: usize) -> World {
    let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices[..declared], CYCLE);
    let mut world = World::with(1, network, &Options::default(), declare).expect("scan and activation");
    world.settle();
    world.evaluate_latched(false);
    world
}

fn stations(world: &World) -> Vec<u16> {
    let station = |device: &ringcat_sim::device::Device| {
        let bytes = device.controller.register(map::STATION_ADDRESS, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    };
    world.network().devices().map(station).collect()
}

fn states(world: &World) -> Vec<AlState> {
    world.network().devices().filter_map(|device| device.al_status().al_state()).collect()
}

/// All declared SubDevices are in OP, and the process data is complete.
fn until_settled(world: &mut World) {
    world.until(Duration::from_secs(3), "all in OP and complete", |world| {
        let status = world.application().exchange().status(DomainId(0)).expect("it is declared");
        world.application().all_settled() && status.wkc == status.expected
    });
}

#[test]
fn unassigned_subdevices_with_an_old_address_do_not_share_it() {
    let mut world = world(six(false), 4);
    let power_cycle = |world: &mut World, device: usize| {
        world.power_off(DeviceIndex(device));
        world.run_cycles(300);
        world.power_on(DeviceIndex(device));
        world.run_cycles(500);
    };
    power_cycle(&mut world, 5);
    // Unreachable, and no longer part of the segment.
    world.cut(CableId(5));
    world.run_cycles(300);
    power_cycle(&mut world, 4);
    world.heal(CableId(5));
    world.run_cycles(500);
    let all = stations(&world);
    assert_ne!(all[4], all[5]);
    assert_eq!(all[..4], [0x1001, 0x1002, 0x1003, 0x1004]);
    power_cycle(&mut world, 2);
    until_settled(&mut world);
    let before = world.application().acyclic_counters().datagrams;
    world.run_cycles(1000);
    let quiet = world.application().acyclic_counters().datagrams - before;
    assert!(quiet <= 30, "one check a second, not an endless search: {quiet} datagrams");
}

// covers: identity
#[test]
fn a_subdevice_with_the_address_of_a_member_gets_another_one() {
    for (unassigned, member) in [(5, 1), (5, 4), (0, 1)] {
        let kinds = if unassigned == 0 { 1..6 } else { 0..5 };
        let declare = |scan: &ringcat::Scan| {
            let mut declaration = automatic(&scan.subdevices[kinds.clone()], CYCLE);
            for (config, position) in declaration.subdevices.iter_mut().zip(kinds.clone()) {
                config.address = ConfigAddress::Position(position as u16);
            }
            declaration
        };
        let mut world = World::with(2, six(true), &Options::default(), declare).expect("scan and activation");
        world.settle();
        world.evaluate_latched(false);
        let mark = world.mark();
        let before = stations(&world);
        let bus = world.application().engine().bus();
        let taken = before[member].to_le_bytes();
        world.application_mut().engine_mut().spawn(async move {
            let _ = bus.apwr(Position(unassigned), map::STATION_ADDRESS, &taken).await;
        });
        world.run_cycles(1000);
        let after = stations(&world);
        assert_eq!(after[kinds.clone()], before[kinds], "unassigned {unassigned} with the address of {member}");
        assert_eq!(world.left_op(mark), []);
    }
}

#[test]
fn a_subdevice_of_another_main_device_is_set_to_init_and_left_out() {
    let mut world = world(six(true), 5);
    let temporary = StationAddress(stations(&world)[5]);
    let ours =
        *world.network().device(DeviceIndex(1)).controller.register(map::FMMU_BASE, Fmmu::LEN).as_array().unwrap();
    let theirs = Fmmu { physical_start: 0x1000, ..Fmmu::decode(&ours) };
    let bus = world.application().engine().bus();
    world.application_mut().engine_mut().spawn(async move {
        for state in [AlState::PreOp, AlState::SafeOp] {
            let _ = bus.fpwr(temporary, map::AL_CONTROL, &AlControl::new(state).encode()).await;
            bus.sleep(Duration::from_millis(20)).await;
        }
        let _ = bus.fpwr(temporary, map::FMMU_BASE, &theirs.encode()).await;
        let _ = bus.fpwr(temporary, map::STATION_ADDRESS, &0x5555u16.to_le_bytes()).await;
    });
    world.run_cycles(2000);
    let device = world.network().device(DeviceIndex(5));
    assert_eq!(device.al_status(), AlStatus::new(AlState::Init));
    assert_eq!(device.controller.register(map::FMMU_BASE, Fmmu::LEN), [0; Fmmu::LEN]);
    let status = world.application().exchange().status(DomainId(0)).expect("it is declared");
    assert_eq!(status.wkc, status.expected);
}

// covers: identity
#[test]
fn a_subdevice_with_the_address_of_an_absent_member_is_not_mistaken() {
    let mut world = world(six(true), 5);
    world.power_off(DeviceIndex(2));
    world.run_cycles(200);
    let temporary = StationAddress(stations(&world)[5]);
    let bus = world.application().engine().bus();
    let mark = world.mark();
    world.application_mut().engine_mut().spawn(async move {
        let _ = bus.fpwr(temporary, map::STATION_ADDRESS, &0x1003u16.to_le_bytes()).await;
    });
    // Only the check once a second can show it.
    world.run_cycles(1500);
    assert!(
        !world.saw(mark, |event| *event == Event::Returned { subdevice: SubDeviceId(2) }),
        "it is not the missing SubDevice"
    );
    let given = stations(&world)[5];
    assert!(given >= 0xC000 && given != temporary.0, "it has a temporary address again, another one");
    assert_eq!(world.application().states()[2], SubDeviceState::Absent);
    assert_eq!(world.steps(mark), [], "and was not configured");
    world.power_on(DeviceIndex(2));
    until_settled(&mut world);
    assert_eq!(stations(&world)[2], 0x1003);
}

// covers: identity
#[test]
fn identical_neighbours_keep_their_places_from_either_side() {
    let kinds = ["coupler", "digital-input-8", "digital-output-8", "digital-output-8", "digital-input-8"];
    for cut in [None, Some(0), Some(1), Some(3), Some(5)] {
        for order in [[2, 3], [3, 2]] {
            for pause in [0, 1, 30] {
                let mut world = World::in_op(4, ring(descriptions(&kinds), NetworkOptions::default()));
                world.evaluate_latched(false);
                cut.into_iter().for_each(|cable| world.cut(CableId(cable)));
                world.run_cycles(100);
                let before = stations(&world);
                order.into_iter().for_each(|device| world.power_off(DeviceIndex(device)));
                world.run_cycles(100);
                for device in order {
                    world.power_on(DeviceIndex(device));
                    world.run_cycles(pause);
                }
                world.until(Duration::from_secs(2), "all in OP", |world| {
                    world.all_in_op() && world.application().all_settled()
                });
                assert_eq!(stations(&world), before, "cable {cut:?}, {order:?}, {pause} ms between");
            }
        }
    }
}

/// The cables of the first of two identical SubDevices are repaired while the second one, which responded on the
/// redundant side before, is assigned: it must not take the place of the first, which has not been found yet.
// covers: identity
#[test]
fn identical_neighbours_keep_their_places_when_the_ring_closes_meanwhile() {
    let kinds = ["coupler", "digital-input-8", "digital-output-8", "digital-output-8", "digital-input-8"];
    for step in 0..60 {
        let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(1_500));
        let mut world = World::in_op(7, ring(descriptions(&kinds), options));
        world.evaluate_latched(false);
        let before = stations(&world);
        [2, 3].into_iter().for_each(|device| world.power_off(DeviceIndex(device)));
        world.run_cycles(20);
        world.power_on(DeviceIndex(3));
        world.fault_in(Duration::from_micros(250 * step), Fault::PowerOn(DeviceIndex(2)));
        world.run_cycles(20);
        world
            .until(Duration::from_secs(2), "all in OP", |world| world.all_in_op() && world.application().all_settled());
        assert_eq!(stations(&world), before, "{} us between", 250 * step);
    }
}

#[test]
fn after_a_loss_of_power_all_subdevices_return_to_their_places() {
    let kinds = ["digital-output-8"; 100];
    let mut world = World::in_op(6, ring(descriptions(&kinds), NetworkOptions::default()));
    world.evaluate_latched(false);
    let before = stations(&world);
    (0..kinds.len()).for_each(|device| world.power_off(DeviceIndex(device)));
    world.run_cycles(100);
    (0..kinds.len()).for_each(|device| world.power_on(DeviceIndex(device)));
    until_settled(&mut world);
    assert_eq!(stations(&world), before);
}

#[test]
fn an_optional_subdevice_does_not_take_the_place_of_an_identical_one() {
    let kinds = ["coupler", "digital-output-8", "digital-input-8"];
    let network = ring(descriptions(&kinds), NetworkOptions::default());
    let mut world = World::with(5, network, &Options::default(), |scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let mut twin = declaration.subdevices[1].clone().optional();
        twin.address = ConfigAddress::Position(1);
        declaration.subdevices[1].address = ConfigAddress::Position(2);
        declaration.subdevices[2].address = ConfigAddress::Position(3);
        declaration.subdevices.insert(1, twin);
        let members = (0..4).map(|subdevice| DomainMember::new(SubDeviceId(subdevice)));
        declaration.domains[0].members = members.collect();
        declaration
    })
    .expect("scan and activation");
    world.evaluate_latched(false);
    world.run_cycles(300);
    let before = stations(&world);
    world.power_off(DeviceIndex(1));
    world.run_cycles(200);
    world.power_on(DeviceIndex(1));
    world.until(Duration::from_secs(2), "back in OP", |world| world.application().states()[2] == SETTLED);
    assert_eq!(stations(&world), before);
    assert_eq!(world.application().states()[1], SubDeviceState::Absent);
}

/// Power of a declared SubDevice fails beside undeclared ones of its type. A ring reaches those behind it from the
/// other side, a line those upstream of it. Judged inside the undeclared ones in each cycle.
// covers: identity
#[test]
fn an_undeclared_twin_does_not_take_the_place_of_a_lost_subdevice() {
    let kinds = ["coupler", "digital-output-8", "digital-output-8", "digital-output-8"];
    let cases: [(bool, usize); 5] = [(true, 1), (true, 2), (true, 3), (false, 2), (false, 3)];
    for ((is_ring, off), with_idle) in cases.into_iter().flat_map(|case| [true, false].map(|idle| (case, idle))) {
        for off_ms in [1, 5, 100, 1_500] {
            let text = format!("ring {is_ring}, SubDevice {off} for {off_ms} ms, idle operation {with_idle}");
            let build = if is_ring { ring } else { line };
            let network = build(descriptions(&kinds), NetworkOptions::default());
            let options = Options::default().with_idle_operation(with_idle);
            let declare =
                |scan: &ringcat::Scan| automatic(&[scan.subdevices[0].clone(), scan.subdevices[off].clone()], CYCLE);
            let mut world = World::with(9, network, &options, declare).expect("scan and activation");
            world.settle();
            world.evaluate_latched(false);
            let twins: Vec<usize> = (1..kinds.len()).filter(|at| *at != off).collect();
            let are_left = |world: &mut World, cycles: u64| {
                for cycle in 0..cycles {
                    world.run_cycles(1);
                    for at in &twins {
                        let device = world.network().device(DeviceIndex(*at));
                        let is_left = matches!(device.al_status().al_state(), Some(AlState::Init | AlState::PreOp));
                        assert!(is_left, "{text}: SubDevice {at} is in {} after {cycle}", device.al_status());
                    }
                }
            };
            for round in 0..3 {
                world.power_off(DeviceIndex(off));
                are_left(&mut world, off_ms);
                world.power_on(DeviceIndex(off));
                are_left(&mut world, 1_000);
                until_settled(&mut world);
                assert_eq!(states(&world)[off], AlState::Op, "{text}");
                if round == 0 {
                    // One that is found later is none of the others, either.
                    world.power_off(DeviceIndex(twins[0]));
                    are_left(&mut world, 200);
                    world.power_on(DeviceIndex(twins[0]));
                    are_left(&mut world, 1_000);
                    until_settled(&mut world);
                }
            }
        }
    }
}

/// An endless chain of categories: reading it takes seconds, and its contents are invalid.
fn corrupt_sii(world: &mut World, device: DeviceIndex) {
    world.fault(Fault::CorruptSii { device, offset: 0x0E, mask: 0xFF });
    for offset in [124, 125, 130, 131] {
        world.fault(Fault::CorruptSii { device, offset, mask: 0x7F });
    }
}

#[test]
fn other_changes_are_detected_while_a_new_subdevice_is_read() {
    let mut world = world(six(true), 6);
    world.power_off(DeviceIndex(2));
    world.run_cycles(100);
    corrupt_sii(&mut world, DeviceIndex(2));
    world.power_on(DeviceIndex(2));
    world.run_cycles(100);
    let mark = world.mark();
    world.power_off(DeviceIndex(4));
    world.until(Duration::from_millis(50), "noticed", |world| {
        world.saw(mark, |event| *event == Event::Lost { subdevice: SubDeviceId(4) })
    });
    world.run_cycles(200);
    world.power_on(DeviceIndex(4));
    world.until(Duration::from_millis(500), "back", |world| world.application().states()[4] == SETTLED);
}

// covers: identity
#[test]
fn an_unreadable_subdevice_does_not_hide_those_behind_it() {
    let mut world = world(six(true), 6);
    world.power_off(DeviceIndex(2));
    world.power_off(DeviceIndex(4));
    world.run_cycles(100);
    corrupt_sii(&mut world, DeviceIndex(2));
    world.power_on(DeviceIndex(2));
    world.power_on(DeviceIndex(4));
    world.until(Duration::from_millis(500), "back", |world| world.application().states()[4] == SETTLED);
}

/// Cuts, losses, one-way cables and power cycles in sequence, then all faults are ended.
fn torture(seed: u64) {
    let kinds = [
        "coupler",
        "digital-output-8",
        "digital-output-8",
        "analog-input-4",
        "digital-output-8",
        "digital-output-8",
        "digital-input-8",
        "servo",
    ];
    let mut dice = Dice::new(seed);
    let detection = Duration::from_micros(*dice.pick(&[10, 200, 1000, 5000]));
    let options = NetworkOptions::default().with_detection_delay(detection);
    let mut world = World::in_op(seed, ring(descriptions(&kinds), options));
    world.evaluate_latched(false);
    let before = stations(&world);
    let cables = kinds.len() + 1;
    for _ in 0..30 {
        let cable = CableId(dice.below(cables as u64) as usize);
        let device = DeviceIndex(dice.below(kinds.len() as u64) as usize);
        match dice.below(8) {
            0 => world.cut(cable),
            1 => world.heal(cable),
            2 => world.fault(Fault::Drop { cable, direction: None, count: dice.below(20) as u32 }),
            3 => {
                let (direction, blocked) = (*dice.pick(&Direction::ALL), dice.one_in(2));
                world.fault(Fault::OneWay { cable, direction, blocked });
            }
            4 | 5 => world.power_off(device),
            6 => world.power_on(device),
            _ => world.corrupt(cable, dice.below(20) as u32),
        }
        world.run_cycles(dice.below(60));
    }
    for cable in (0..cables).map(CableId) {
        for direction in Direction::ALL {
            world.fault(Fault::OneWay { cable, direction, blocked: false });
        }
        world.heal(cable);
    }
    (0..kinds.len()).for_each(|device| world.power_on(DeviceIndex(device)));
    world.until(Duration::from_secs(20), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    until_settled(&mut world);
    assert_eq!(stations(&world), before, "each SubDevice has its former identity");
    assert_eq!(states(&world), [AlState::Op; 8]);
}

// covers: identity
#[test]
fn after_cuts_and_power_cycles_all_identities_are_right_seeds_0_to_149() {
    let failed: Vec<u64> = (0..150).filter(|seed| std::panic::catch_unwind(|| torture(*seed)).is_err()).collect();
    println!("seeds 0 to 149: {} fail", failed.len());
    assert_eq!(failed, [], "seeds that fail");
}
