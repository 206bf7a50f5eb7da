//! Hot connect groups: rows of SubDevices that join and leave at any place while the others exchange process data.
//!
//! `SEED=0..300 cargo test -p scenarios --test virtual_time hot_connect::seeds -- --nocapture` runs many random groups.

use std::ops::Range;
use std::time::Duration;

use ringcat::{
    Declaration, DeclaredGroup, DomainConfig, DomainId, DomainMember, DomainState, Event, Group, GroupId, MainDevice,
    Options, Scan, SubDeviceConfig, SubDeviceId, SubDeviceInfo, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::description::{DeviceDescription, TransitionTimes};
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::sii::{SiiSyncManager, SyncManagerKind};
use scenarios::check::Delivery;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{descriptions, devices, line, ring};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, Mark, World};

pub const LIMIT: Duration = Duration::from_secs(5);
/// Alias of the group's head.
pub const TOOL: u16 = 5;
/// Permanent SubDevices, and those of the group.
const BASE: [&str; 4] = ["coupler", "digital-input-8", "digital-output-8", "digital-input-16"];
const GROUP: [&str; 2] = ["analog-input-4", "digital-output-16"];

/// Scan results of devices of these kinds.
pub fn infos(kinds: &[&str]) -> Vec<SubDeviceInfo> {
    let links = Tap::new(line(descriptions(kinds), NetworkOptions::default()));
    MainDevice::request(links, &Options::default()).scan().expect("a scan").subdevices
}

/// The two SubDevices of the group, the head with an alias.
pub fn tool() -> Vec<DeviceDescription> {
    let mut devices = descriptions(&GROUP);
    devices[0].alias = TOOL;
    devices
}

pub fn group(head: SubDeviceConfig) -> Group {
    let infos = infos(&GROUP);
    let expect = |config: SubDeviceConfig, info: &SubDeviceInfo| {
        config.expect_product(info.identity.vendor_id, info.identity.product_code).pdos_of(info)
    };
    Group::new(expect(head, &infos[0])).then(expect(SubDeviceConfig::default(), &infos[1]))
}

/// The base by position, then the group.
fn declare(_: &Scan) -> Declaration {
    let mut declaration = automatic(&infos(&BASE), CYCLE);
    let DeclaredGroup { id: number, members, .. } = declaration.add_group(group(SubDeviceConfig::at_alias(TOOL, 0)));
    assert_eq!((number, members.as_slice()), (GroupId(0), [4, 5].map(SubDeviceId).as_slice()));
    declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
    declaration
}

fn world(network: Network) -> World {
    let mut world = World::with(1, network, &Options::default(), declare).expect("scan and activation");
    world.until(LIMIT, "all that are there settled", |world| world.application().all_settled());
    world.run_cycles(20);
    world
}

fn has_joined(world: &World) -> bool {
    world.application().groups()[0].has_joined()
}

fn until_joined(world: &mut World) {
    world.until(LIMIT, "the group has joined", has_joined);
    world.recognise();
    world.run_cycles(20);
    for subdevice in [4, 5] {
        let device = world.device_of(subdevice).expect("it is there");
        assert_eq!(world.network().device(device).al_status(), AlStatus::new(AlState::Op));
    }
    let last = world.evaluated(world.beginning()).last().expect("cycles went by");
    assert_eq!((last.status.wkc, last.stale.clone()), (last.status.expected, Vec::new()));
}

fn until_left(world: &mut World) {
    world.until(LIMIT, "the group has left", |world| world.application().groups()[0].present == 0);
    world.run_cycles(20);
}

/// Cycles in which a domain was incomplete: the group is optional.
fn errors(world: &World, since: Mark) -> usize {
    world.evaluated(since).iter().filter(|evaluated| evaluated.status.state != DomainState::Complete).count()
}

fn count(world: &World, since: Mark, wanted: &Event) -> usize {
    world.events(since).iter().filter(|timed| timed.event == *wanted).count()
}

/// The group behind the last cable of a line.
fn at_the_end() -> (Network, CableId) {
    let all = descriptions(&BASE).into_iter().chain(tool()).collect();
    let mut network = line(all, NetworkOptions::default());
    let cable = CableId(BASE.len());
    network.apply(Fault::Cut(cable));
    (network, cable)
}

/// Between two cycles, so that no frame is on its way there.
const BETWEEN: Duration = Duration::from_micros(500);

// covers: hot-connect
#[test]
fn a_group_joins_and_leaves_a_line_without_working_counter_errors_elsewhere() {
    let (network, cable) = at_the_end();
    let mut world = world(network);
    assert_eq!(world.application().groups()[0].present, 0);
    for round in 0..5 {
        let mark = world.mark();
        world.fault_in(BETWEEN, Fault::Heal(cable));
        if round > 0 {
            for subdevice in [4, 5] {
                let _ = world.application_mut().engine_mut().start_state_request(SubDeviceId(subdevice), AlState::Op);
            }
        }
        until_joined(&mut world);
        assert_eq!(count(&world, mark, &Event::GroupJoined { group: GroupId(0) }), 1);
        // The group is set to INIT before it is unplugged.
        for subdevice in [5, 4] {
            let work = world.application_mut().engine_mut().start_state_request(SubDeviceId(subdevice), AlState::Init);
            assert_eq!(world.finish(LIMIT, work), Ok(()));
        }
        world.fault_in(BETWEEN, Fault::Cut(cable));
        until_left(&mut world);
        assert_eq!(errors(&world, mark), 0, "round {round}");
        assert_eq!(count(&world, mark, &Event::GroupLeft { group: GroupId(0) }), 1);
    }
    assert!(world.left_op(world.beginning()).iter().all(|device| device.0 >= BASE.len()));
}

// covers: hot-connect
#[test]
fn an_unplugged_group_with_its_own_domain_does_not_affect_others() {
    let (network, cable) = at_the_end();
    let declare = |scan: &Scan| {
        let mut declaration = declare(scan);
        let members = declaration.domains[0].members.split_off(BASE.len());
        declaration.domains.push(DomainConfig::new(CYCLE, members));
        declaration
    };
    let mut world = World::with(4, network, &Options::default(), declare).expect("scan and activation");
    world.until(LIMIT, "all that are there settled", |world| world.application().all_settled());
    let mark = world.mark();
    for round in 0..5 {
        world.fault_in(BETWEEN, Fault::Heal(cable));
        world.until(LIMIT, "the group has joined", has_joined);
        world.run_cycles(20);
        world.fault_in(BETWEEN, Fault::Cut(cable));
        until_left(&mut world);
        let all = world.evaluated(mark).iter().filter(|evaluated| evaluated.status.state != DomainState::Complete);
        let (others, own): (Vec<_>, Vec<_>) = all.partition(|evaluated| evaluated.domain == DomainId(0));
        println!("round {round}: {} cycles of the others, {} of the group's own domain", others.len(), own.len());
        assert_eq!(others.len(), 0);
    }
    assert!(world.left_op(mark).iter().all(|device| device.0 >= BASE.len()));
}

// covers: hot-connect
#[test]
fn a_group_joins_at_another_place_than_it_left() {
    // One place behind a branch of the junction, another at the end of the line: one of two identical groups has power.
    let line = descriptions(&["coupler", "digital-input-8", "junction", "digital-output-8", "digital-input-16"]);
    let ends = [tool(), tool()].map(devices);
    let [branch, end] = ends;
    let all = devices(line).into_iter().chain(end).collect();
    let network = SegmentBuilder::line(all).branch(DeviceIndex(2), Port::C, branch).build();
    let mut network = network.expect("a segment can be built");
    let places = [[5, 6], [7, 8]].map(|place| place.map(DeviceIndex));
    places.iter().flatten().for_each(|device| network.power_off(*device));
    let declare = |_: &Scan| {
        let base = ["coupler", "digital-input-8", "junction", "digital-output-8", "digital-input-16"];
        let mut declaration = automatic(&infos(&base), CYCLE);
        let members = declaration.add_group(group(SubDeviceConfig::at_alias(TOOL, 0))).members;
        declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
        declaration
    };
    let mut world = World::with(2, network, &Options::default(), declare).expect("scan and activation");
    world.until(LIMIT, "all that are there settled", |world| world.application().all_settled());
    for round in 0..4 {
        let place = places[round % 2];
        let mark = world.mark();
        // Between two frames, because a frame that passes a port while it opens is lost.
        place.iter().for_each(|device| world.fault_in(CYCLE / 2, Fault::PowerOn(*device)));
        world.until(LIMIT, "the group has joined", has_joined);
        world.run_cycles(20);
        let is_in_op = |device: &DeviceIndex| world.network().device(*device).al_status() == AlStatus::new(AlState::Op);
        assert!(place.iter().all(is_in_op), "round {round}");
        assert_eq!(errors(&world, mark), 0, "joining, round {round}");
        place.iter().rev().for_each(|device| world.power_off(*device));
        until_left(&mut world);
        assert!(world.left_op(mark).iter().all(|device| device.0 >= 5), "{:?}", world.left_op(mark));
    }
}

// covers: hot-connect
#[test]
fn a_group_in_the_middle_of_a_ring_joins_while_the_others_stay_in_op() {
    let mut all = descriptions(&BASE);
    let tail = all.split_off(2);
    let all: Vec<_> = all.into_iter().chain(tool()).chain(tail).collect();
    let mut network = ring(all, NetworkOptions::default());
    let place = [2, 3].map(DeviceIndex);
    place.iter().for_each(|device| network.power_off(*device));
    let mut world = world(network);
    let mark = world.mark();
    for device in place {
        world.power_on(device);
        world.run_cycles(3);
    }
    // The ring closes: incomplete cycles belong to this edge.
    let edges = errors(&world, mark);
    let mark = world.mark();
    until_joined(&mut world);
    println!("{edges} cycles at the edges of the ring, {} while the group was configured", errors(&world, mark));
    assert!(edges <= 4 && errors(&world, mark) == 0);
    assert!(world.left_op(world.beginning()).is_empty());
}

// covers: 5.3, hot-connect
#[test]
fn a_group_present_at_the_start_is_found_by_its_identification() {
    let mut head = tool();
    head[0].alias = 0;
    head[0].identification = Some(4711);
    // Before those with positions.
    let mut all = descriptions(&BASE);
    let tail = all.split_off(1);
    let all = all.into_iter().chain(head).chain(tail).collect();
    let declare = |_: &Scan| {
        let mut declaration = automatic(&infos(&BASE), CYCLE);
        let members = declaration.add_group(group(SubDeviceConfig::at_identification(4711))).members;
        declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
        declaration
    };
    let network = line(all, NetworkOptions::default());
    let mut world = World::with(3, network, &Options::default(), declare).expect("scan and activation");
    world.settle();
    assert!(has_joined(&world));
    let found: Vec<Option<usize>> = (0..6).map(|index| world.device_of(index).map(|device| device.0)).collect();
    assert_eq!(found, [0, 3, 4, 5, 1, 2].map(Some));
    // It is power-cycled: the SubDevices behind it come back too, by their places.
    world.power_off(DeviceIndex(1));
    world.run_cycles(50);
    world.power_on(DeviceIndex(1));
    world.until(LIMIT, "the group has joined", has_joined);
    world.settle();
    assert!(world.all_in_op());
}

// covers: hot-connect
#[test]
fn a_broken_group_is_reported_and_its_remaining_part_is_used() {
    let mut all: Vec<_> = descriptions(&BASE).into_iter().chain(tool()).collect();
    all.pop();
    all.extend(descriptions(&["digital-input-4"]));
    let mut world = world(line(all, NetworkOptions::default()));
    let state = world.application().groups()[0];
    assert_eq!((state.present, state.settled, state.members), (1, 1, 2));
    let reports =
        |event: &Event| matches!(event, Event::Mismatch { subdevice: SubDeviceId(5), position, .. } if position.0 == 5);
    assert!(world.saw(world.beginning(), reports));
    world.run_cycles(200);
    assert_eq!(world.network().device(DeviceIndex(5)).al_status(), AlStatus::new(AlState::Init), "it is left alone");
}

/// Two adjacent groups with a break between them: each continues in its half, and a new group joins from its remaining
/// side.
// covers: CR-21, hot-connect
#[test]
fn adjacent_groups_separated_by_a_break_continue_and_join_again() {
    let mut second = tool();
    second[0].alias = TOOL + 1;
    let mut all = descriptions(&BASE);
    let tail = all.split_off(2);
    let all: Vec<_> = all.into_iter().chain(tool()).chain(second).chain(tail).collect();
    let declare = |_: &Scan| {
        let mut declaration = automatic(&infos(&BASE), CYCLE);
        for alias in [TOOL, TOOL + 1] {
            let members = declaration.add_group(group(SubDeviceConfig::at_alias(alias, 0))).members;
            let joined = members.into_iter().map(DomainMember::new);
            declaration.domains[0].members.extend(joined);
        }
        declaration
    };
    let network = ring(all, NetworkOptions::default());
    let mut world = World::with(6, network, &Options::default(), declare).expect("scan and activation");
    let both = |world: &World| world.application().groups().iter().all(|group| group.has_joined());
    world.until(LIMIT, "both groups have joined", both);
    world.settle();
    let mark = world.mark();
    // Between the last SubDevice of the first group and the head of the second.
    world.fault_in(BETWEEN, Fault::Cut(CableId(4)));
    world.run_cycles(100);
    assert!(both(&world) && world.left_op(mark).is_empty() && world.incomplete(mark) <= 1);
    for group in [[2, 3], [4, 5]].map(|group| group.map(DeviceIndex)) {
        let mark = world.mark();
        group.iter().for_each(|device| world.power_off(*device));
        world.until(LIMIT, "it has left", |world| world.application().groups().iter().any(|group| group.present == 0));
        group.iter().for_each(|device| world.power_on(*device));
        world.until(LIMIT, "both groups have joined", both);
        world.run_cycles(50);
        assert!(world.all_in_op() && world.left_op(mark).iter().all(|device| group.contains(device)), "{group:?}");
    }
    let mark = world.mark();
    world.fault_in(BETWEEN, Fault::Heal(CableId(4)));
    world.run_cycles(100);
    assert_eq!(world.application().ring(), ringcat::RingState::Closed);
    assert!(both(&world) && world.left_op(mark).is_empty() && world.incomplete(mark) <= 1);
}

/// Devices of a line or a ring with the group at its end: some read their FMMUs only during the transition to SAFEOP,
/// some have inputs or outputs in OP only, some are slow or have no free FMMU.
fn random_network(dice: &mut Dice) -> (Network, usize) {
    let mut all: Vec<DeviceDescription> = descriptions(&BASE).into_iter().chain(tool()).collect();
    let limited = [SyncManagerKind::Inputs, SyncManagerKind::Outputs];
    for it in &mut all {
        it.latches_fmmus = dice.one_in(2);
        let areas = it.sync_managers.iter().filter(|manager| limited.contains(&manager.kind) && manager.length > 0);
        let needed = areas.count() as u8;
        it.controller_fmmus = dice.pick(&[None, Some(needed.max(1)), Some(needed + 1)]).to_owned();
        it.transitions = TransitionTimes::all(Duration::from_millis(*dice.pick(&[0, 0, 5, 30])));
        let is_op_only = [dice.one_in(3), dice.one_in(3)];
        for manager in it.sync_managers.iter_mut().filter(|manager| manager.length > 0) {
            let place = limited.iter().position(|kind| *kind == manager.kind);
            if place.is_some_and(|place| is_op_only[place]) {
                manager.enable |= SiiSyncManager::ENABLE | SiiSyncManager::OP_ONLY;
            }
        }
    }
    let count = all.len();
    let is_ring = dice.one_in(2);
    let network = if is_ring { ring(all, NetworkOptions::default()) } else { line(all, NetworkOptions::default()) };
    (network, count + usize::from(is_ring))
}

/// Cuts and repairs cables of the group and others, switches devices off and on; each cycle is checked with the logs of
/// the devices. Returns the areas of process data found there.
fn run(seed: u64) -> u64 {
    let mut dice = Dice::new(seed ^ 0x4C07);
    let (network, cables) = random_network(&mut dice);
    let declare = |scan: &Scan| declare(scan).with_sends_again(seeds::sends_again(seed));
    let mut world = World::with(seed, network, &Options::default(), declare).expect("scan and activation");
    world.evaluate_latched(false);
    world.compare_tries();
    world.until(LIMIT, "all settled", |world| world.application().all_settled());
    let lost = *dice.pick(&[0, 0, 10, 50]);
    world.application_mut().links_mut().lose_per_mille(lost, seed);
    let (mut cut, mut off) = (None, None);
    for _ in 0..8 + dice.below(12) {
        let delay = Duration::from_nanos(dice.below(1_000_000));
        let fault = match (dice.below(4), cut.take(), off.take()) {
            (0, _, Some(device)) => Fault::PowerOn(device),
            (0 | 1, None, was) => {
                off = was;
                // In every second case the cable of the group.
                let cable = if dice.one_in(2) { BASE.len() } else { dice.below(cables as u64) as usize };
                Fault::Cut(*cut.insert(CableId(cable)))
            }
            (2, was, None) => {
                cut = was;
                let device = dice.below((BASE.len() + GROUP.len()) as u64) as usize;
                Fault::PowerOff(*off.insert(DeviceIndex(device)))
            }
            (_, Some(cable), was) => {
                off = was;
                Fault::Heal(cable)
            }
            (_, None, Some(device)) => Fault::PowerOn(device),
            (_, None, None) => Fault::Cut(*cut.insert(CableId(BASE.len()))),
        };
        world.fault_in(delay, fault);
        let cycles = if dice.one_in(2) { 100 + dice.below(400) } else { 1 + dice.below(20) };
        world.run_cycles(cycles);
    }
    world.application_mut().links_mut().lose_per_mille(0, seed);
    (0..cables).for_each(|cable| world.heal(CableId(cable)));
    (0..BASE.len() + GROUP.len()).for_each(|device| world.power_on(DeviceIndex(device)));
    world.until(Duration::from_secs(20), "all back", |world| {
        let last = world.evaluated(world.beginning()).last().map(|evaluated| evaluated.delivery);
        world.all_in_op() && has_joined(world) && last == Some(Delivery::Complete)
    });
    world.run_cycles(20);
    let mark = world.mark();
    world.run_cycles(40);
    assert!(
        world.evaluated(mark).iter().all(|evaluated| evaluated.stale.is_empty()),
        "{:?}",
        world.evaluated(mark).last()
    );
    world.proven()
}

fn runs(seeds: Range<u64>) {
    let count = seeds.end - seeds.start;
    let (mut proven, mut failed) = (0, Vec::new());
    for seed in seeds {
        match std::panic::catch_unwind(|| run(seed)) {
            Ok(areas) => proven += areas,
            Err(_) => failed.push(seed),
        }
    }
    println!("hot connect: {count} seeds, {proven} areas proven, {} seeds failed", failed.len());
    assert_eq!(failed, [], "seeds that fail");
    assert!(proven > 1_000 * count, "{proven}");
}

// covers: hot-connect, freshness
#[test]
fn inputs_stay_proven_while_random_groups_join_and_leave_seeds_0_to_39() {
    runs(0..40);
}

#[test]
fn seeds_from_the_environment() {
    crate::explorer::from_environment(|seed| println!("{} areas of process data proven", run(seed)), runs);
}
