//! Hot connect groups in a ring of two MainDevices: a group leaves and joins before, during and after a takeover
//! (protocol MR-23, REQ044).

use std::time::Duration;

use ringcat::standby::RoleRequest;
use ringcat::{Declaration, DomainMember, Group, MainDevice, Options, Scan, SubDeviceConfig, SubDeviceInfo, automatic};
use ringcat_sim::cable::{DeviceIndex, Host};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::segments::{descriptions, devices, line};
use scenarios::tap::Tap;
use scenarios::two::{CYCLE, Two};

use super::standby;

const BASE: [&str; 4] = ["coupler", "digital-input-8", "digital-output-8", "digital-input-16"];
const GROUP: [&str; 2] = ["analog-input-4", "digital-output-16"];
const ALIAS: u16 = 5;
/// Places of the group in the ring.
const PLACES: [usize; 2] = [2, 3];
const LIMIT: Duration = Duration::from_secs(5);

fn infos(kinds: &[&str]) -> Vec<SubDeviceInfo> {
    let links = Tap::new(line(descriptions(kinds), NetworkOptions::default()));
    MainDevice::request(links, &Options::default()).scan().expect("a scan").subdevices
}

/// The base by position, and the group with an alias.
fn declare(_: &Scan) -> Declaration {
    let mut declaration = automatic(&infos(&BASE), CYCLE);
    let infos = infos(&GROUP);
    let expect = |config: SubDeviceConfig, info: &SubDeviceInfo| {
        config.expect_product(info.identity.vendor_id, info.identity.product_code).pdos_of(info)
    };
    let head = expect(SubDeviceConfig::at_alias(ALIAS, 0), &infos[0]);
    let members = declaration.add_group(Group::new(head).then(expect(SubDeviceConfig::default(), &infos[1]))).members;
    declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
    declaration
}

/// The group in the middle of the ring, with or without power.
fn network(has_group: bool) -> Network {
    let mut all = descriptions(&BASE);
    let tail = all.split_off(PLACES[0]);
    let mut group = descriptions(&GROUP);
    group[0].alias = ALIAS;
    let all: Vec<DeviceDescription> = all.into_iter().chain(group).chain(tail).collect();
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    let ring = SegmentBuilder::ring_of_two(devices(all), Host::First).options(options);
    let mut network = ring.build().expect("the cables fit");
    if !has_group {
        PLACES.iter().for_each(|place| network.power_off(DeviceIndex(*place)));
    }
    network
}

/// The first one is ACTIVE and runs, the second one is ready.
fn followed(has_group: bool) -> Two {
    let mut two = Two::new(network(has_group), declare, standby());
    two.controllers[0].begin_active();
    two.until(LIMIT, "the partner is ready", |two| {
        let base = (0..6).filter(|place| has_group || !PLACES.contains(place));
        base.into_iter().all(|place| is_in_op(two, place)) && two.controllers[0].partner().is_ready()
    });
    two.run(Duration::from_millis(300));
    two.mark();
    two
}

fn is_in_op(two: &Two, place: usize) -> bool {
    two.network.device(DeviceIndex(place)).al_status() == AlStatus::new(AlState::Op)
}

fn power(two: &mut Two, is_on: bool) {
    for place in PLACES.map(DeviceIndex) {
        two.fault(if is_on { Fault::PowerOn(place) } else { Fault::PowerOff(place) });
    }
}

/// The ACTIVE fails, the other one takes over.
fn take_over(two: &mut Two) {
    two.kill(0);
    two.run(3 * CYCLE);
    two.controllers[1].request(RoleRequest::Active);
    two.run(2 * CYCLE);
    assert_eq!(two.active(), Some(1), "{}", two.log());
}

fn until_joined(two: &mut Two, controller: usize) {
    two.until(LIMIT, "the group has joined", |two| {
        two.all_in_op() && two.controllers[controller].engine.groups()[0].has_joined()
    });
}

/// No SubDevice of the base has left OP, and none of its outputs went back.
fn assert_base_undisturbed(two: &Two) {
    let base: Vec<_> = two.left_op.iter().filter(|(_, place)| !PLACES.contains(place)).collect();
    let back: Vec<_> = two.went_back.iter().filter(|(_, place, ..)| !PLACES.contains(place)).collect();
    assert!(base.is_empty() && back.is_empty(), "{base:?}, {back:?}\n{}", two.log());
}

// covers: MR-23, REQ044, hot-connect, standby
#[test]
fn a_group_that_has_joined_stays_in_op_through_a_takeover() {
    let mut two = followed(true);
    take_over(&mut two);
    two.run(Duration::from_secs(2));
    assert!(two.left_op.is_empty() && two.all_in_op(), "{}", two.log());
    assert!(two.controllers[1].engine.groups()[0].has_joined(), "{}", two.log());
}

// covers: MR-23, REQ044, hot-connect, standby
#[test]
fn a_group_joins_after_a_takeover_whether_it_was_ever_there_or_not() {
    for was_there in [true, false] {
        let mut two = followed(was_there);
        if was_there {
            power(&mut two, false);
            two.run(Duration::from_millis(500));
        }
        take_over(&mut two);
        two.run(Duration::from_millis(500));
        assert!(!two.controllers[1].engine.groups()[0].has_joined(), "{was_there}: {}", two.log());
        power(&mut two, true);
        until_joined(&mut two, 1);
        assert_base_undisturbed(&two);
    }
}

// covers: MR-23, REQ044, hot-connect, standby
#[test]
fn a_group_joins_while_a_takeover_happens_and_leaves_with_the_active() {
    for delay in [0, 1, 5, 20, 60, 150] {
        let delay = Duration::from_millis(delay);
        // It comes while the ACTIVE fails.
        let mut two = followed(false);
        power(&mut two, true);
        two.run(delay);
        take_over(&mut two);
        until_joined(&mut two, 1);
        assert_base_undisturbed(&two);
        // It goes while the ACTIVE fails, and comes back.
        let mut two = followed(true);
        power(&mut two, false);
        two.run(delay);
        take_over(&mut two);
        two.run(Duration::from_millis(500));
        assert!(!two.controllers[1].engine.groups()[0].has_joined(), "{delay:?}: {}", two.log());
        power(&mut two, true);
        until_joined(&mut two, 1);
        assert_base_undisturbed(&two);
    }
}

// covers: MR-23, REQ044, hot-connect, standby
#[test]
fn both_have_a_group_that_joins_under_the_active_and_the_other_one_goes_on_with_it() {
    let mut two = followed(false);
    power(&mut two, true);
    until_joined(&mut two, 0);
    two.run(Duration::from_secs(1));
    two.mark();
    two.controllers[0].request(RoleRequest::HandOver);
    two.run(10 * CYCLE);
    assert_eq!(two.active(), Some(1), "{}", two.log());
    two.run(Duration::from_secs(2));
    assert!(two.left_op.is_empty() && two.all_in_op(), "{}", two.log());
    assert!(two.controllers[1].engine.groups()[0].has_joined(), "{}", two.log());
}
