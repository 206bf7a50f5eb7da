//! A state for the whole MainDevice: all SubDevices follow, or the result names those that did not, with reasons.

use std::time::Duration;

use ringcat::{
    Address, AlState, AlStatus, AlStatusCode, Error, MainDevice, NotFollowedReason, Options, Position, Services,
    StateScope, StatesError, SubDeviceId, automatic,
};
use ringcat_engine::ConfigureError;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::segments::{descriptions, line, ring, ring_of_16};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 5] = ["coupler", "servo", "digital-output-8", "all-protocols", "digital-input-8"];
/// Drives with a mailbox.
const SERVO: usize = 1;
const ALL: usize = 3;
const LIMIT: Duration = Duration::from_secs(5);
const STATES: [AlState; 6] =
    [AlState::PreOp, AlState::Op, AlState::SafeOp, AlState::Init, AlState::SafeOp, AlState::Op];
const CODE: AlStatusCode = AlStatusCode(0x8042);

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&KINDS), options()), ring(descriptions(&KINDS), options())]
}

fn statuses(network: &Network) -> Vec<AlStatus> {
    network.devices().map(|device| device.al_status()).collect()
}

fn request(world: &mut World, state: AlState, scope: StateScope, limit: Duration) -> Result<(), StatesError> {
    let work = world.application_mut().engine_mut().start_state_of_all(state, scope, limit);
    world.finish(limit + Duration::from_millis(100), work)
}

/// The SubDevices that did not follow.
fn not_followed(result: Result<(), StatesError>) -> Vec<(Address, NotFollowedReason)> {
    match result {
        Err(StatesError::NotFollowed { subdevices, .. }) => {
            subdevices.into_iter().map(|it| (it.subdevice, it.reason)).collect()
        }
        other => panic!("{other:?}"),
    }
}

fn refuse(device: usize, to: AlState) -> Fault {
    Fault::RefuseTransition { device: DeviceIndex(device), to, code: CODE, times: 1 }
}

// covers: states
#[test]
fn all_declared_subdevices_follow_each_state_and_return_to_complete_cycles() {
    let options = NetworkOptions::default();
    let networks = [line(descriptions(&KINDS), options), ring_of_16(Duration::from_micros(10))];
    for (seed, network) in (1..).zip(networks) {
        let mut world = World::in_op(seed, network);
        for scope in [StateScope::All, StateScope::Mandatory] {
            for state in STATES {
                assert_eq!(request(&mut world, state, scope, LIMIT), Ok(()), "{state}");
                let wrong = statuses(world.network()).iter().filter(|is| **is != AlStatus::new(state)).count();
                assert_eq!(wrong, 0, "{state}");
            }
        }
        world.settle();
        assert_eq!(request(&mut world, AlState::Boot, StateScope::All, LIMIT), Err(StatesError::Boot));
        assert!(world.all_in_op());
    }
}

// covers: states
#[test]
fn all_scanned_subdevices_follow_each_state_without_an_application() {
    for idle_operation in [true, false] {
        for network in networks() {
            let options = Options::default().with_idle_operation(idle_operation);
            let mut main_device = MainDevice::request(Tap::new(network), &options);
            let nothing = main_device.request_state_of_all(AlState::PreOp, StateScope::All, LIMIT);
            assert!(matches!(nothing, Err(Error::States(StatesError::NoSubDevices))), "{nothing:?}");
            main_device.scan().expect("it is stable");
            for state in STATES {
                main_device.request_state_of_all(state, StateScope::All, LIMIT).expect("all follow");
                let wrong: Vec<AlStatus> = statuses(main_device.links_mut().network());
                assert_eq!(wrong, [AlStatus::new(state); KINDS.len()], "idle operation: {idle_operation}");
                main_device.attend(Duration::from_millis(300));
                assert_eq!(statuses(main_device.links_mut().network()), wrong, "it is kept");
            }
        }
    }
}

// covers: states
#[test]
fn subdevices_that_do_not_follow_are_named_with_their_reasons() {
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut world = World::in_op(3, network);
    assert_eq!(request(&mut world, AlState::PreOp, StateScope::All, LIMIT), Ok(()));
    // One refuses, one hangs, one is behind a cut.
    world.fault(refuse(SERVO, AlState::SafeOp));
    world.hang(DeviceIndex(ALL), true);
    world.power_off(DeviceIndex(4));
    let begun = world.application().now();
    let limit = Duration::from_millis(1_500);
    let result = request(&mut world, AlState::Op, StateScope::All, limit);
    let passed = world.application().now().since(begun);
    assert!(passed >= limit && passed < limit + Duration::from_millis(50), "{passed:?}");
    let text = result.clone().expect_err("three do not follow").to_string();
    assert!(text.starts_with("3 SubDevices not in OP within 1500 ms; SubDevice 1: refused SAFEOP"), "{text}");
    let reasons = not_followed(result);
    let subdevices: Vec<Address> = reasons.iter().map(|(subdevice, _)| *subdevice).collect();
    assert_eq!(subdevices, [SERVO, ALL, 4].map(|index| SubDeviceId(index).into()));
    assert!(matches!(reasons[0].1, NotFollowedReason::Refused(ConfigureError::State(_))), "{:?}", reasons[0]);
    let late = NotFollowedReason::Late { status: AlStatus::new(AlState::PreOp), code: AlStatusCode(0) };
    assert_eq!(reasons[1].1, late);
    assert_eq!(reasons[2].1, NotFollowedReason::Absent);
    // The others are there, and the late ones follow when they can.
    let op = AlStatus::new(AlState::Op);
    assert_eq!([0, 2].map(|device| world.network().device(DeviceIndex(device)).al_status()), [op; 2]);
    world.hang(DeviceIndex(ALL), false);
    world.power_on(DeviceIndex(4));
    assert_eq!(request(&mut world, AlState::Op, StateScope::All, LIMIT), Ok(()));
    assert!(world.all_in_op());
}

// covers: states
#[test]
fn a_subdevice_that_loses_power_meanwhile_follows_within_the_limit() {
    for network in networks() {
        let mut world = World::in_op(4, network);
        assert_eq!(request(&mut world, AlState::PreOp, StateScope::All, LIMIT), Ok(()));
        for delay in [0, 1, 3, 10, 40] {
            for state in [AlState::Op, AlState::PreOp] {
                let engine = world.application_mut().engine_mut();
                let work = engine.start_state_of_all(state, StateScope::All, LIMIT);
                world.run_cycles(delay);
                world.power_off(DeviceIndex(4));
                world.run_cycles(50);
                world.power_on(DeviceIndex(4));
                let result = world.finish(LIMIT + CYCLE, work);
                // A SubDevice that has followed before its power was lost is not waited for again.
                if result.is_err() {
                    panic!("after {delay} ms to {state}: {result:?}");
                }
                world.until(LIMIT, "all follow", |world| {
                    statuses(world.network()).iter().all(|is| *is == AlStatus::new(state))
                });
            }
        }
    }
}

// covers: states
#[test]
fn optional_subdevices_count_as_long_as_they_are_there() {
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let declare = |scan: &ringcat::Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[4] = declaration.subdevices[4].clone().optional();
        declaration.subdevices[2] = declaration.subdevices[2].clone().target(AlState::SafeOp);
        declaration
    };
    let mut world = World::with(5, network, &Options::default(), declare).expect("it can be activated");
    world.run_cycles(500);
    assert!(world.application().all_settled());
    assert_eq!(request(&mut world, AlState::PreOp, StateScope::All, LIMIT), Ok(()));
    // None goes above its declared state.
    assert_eq!(request(&mut world, AlState::Op, StateScope::All, LIMIT), Ok(()));
    let op = AlStatus::new(AlState::Op);
    assert_eq!(statuses(world.network()), [op, op, AlStatus::new(AlState::SafeOp), op, op]);
    // An optional one that refuses counts for all, not for the mandatory ones.
    for (scope, followed) in [(StateScope::Mandatory, true), (StateScope::All, false)] {
        assert_eq!(request(&mut world, AlState::PreOp, StateScope::All, LIMIT), Ok(()));
        world.fault(refuse(4, AlState::SafeOp));
        assert_eq!(request(&mut world, AlState::Op, scope, LIMIT).is_ok(), followed, "{scope:?}");
        world.run_cycles(100);
    }
    // One that is absent does not.
    world.power_off(DeviceIndex(4));
    world.run_cycles(200);
    for state in [AlState::PreOp, AlState::Op] {
        let begun = world.application().now();
        assert_eq!(request(&mut world, state, StateScope::All, LIMIT), Ok(()));
        assert!(world.application().now().since(begun) < Duration::from_secs(1));
    }
}

// covers: states
#[test]
fn a_subdevice_in_boot_is_left_there_and_named() {
    let mut world = World::in_op(6, line(descriptions(&KINDS), NetworkOptions::default()));
    let boot = world.application_mut().engine_mut().start_state_request(SubDeviceId(ALL), AlState::Boot);
    assert_eq!(world.finish(LIMIT, boot), Ok(()));
    let reasons = not_followed(request(&mut world, AlState::PreOp, StateScope::All, LIMIT));
    assert_eq!(reasons, [(SubDeviceId(ALL).into(), NotFollowedReason::InBoot)]);
    assert_eq!(world.network().device(DeviceIndex(ALL)).al_status(), AlStatus::new(AlState::Boot));
    let options = Options::default().with_idle_operation(true);
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    main_device.attend(Duration::from_millis(400));
    main_device.subdevice(Position(ALL as u16)).request_state(AlState::Boot).expect("it has a boot loader");
    let result = main_device.request_state_of_all(AlState::Op, StateScope::All, LIMIT);
    let Err(Error::States(error)) = result else { panic!("{result:?}") };
    assert_eq!(not_followed(Err(error)), [(Position(ALL as u16).into(), NotFollowedReason::InBoot)]);
}

// covers: states
#[test]
fn a_later_request_overtakes_an_earlier_one() {
    let mut world = World::in_op(7, line(descriptions(&KINDS), NetworkOptions::default()));
    let engine = world.application_mut().engine_mut();
    let first = engine.start_state_of_all(AlState::PreOp, StateScope::All, LIMIT);
    let second = engine.start_state_of_all(AlState::SafeOp, StateScope::All, LIMIT);
    assert_eq!(world.finish(LIMIT, second), Ok(()));
    let reasons = not_followed(world.finish(LIMIT, first));
    assert!(reasons.iter().all(|(_, reason)| *reason == NotFollowedReason::Overtaken), "{reasons:?}");
    assert_eq!(reasons.len(), KINDS.len());
    assert_eq!(statuses(world.network()), [AlStatus::new(AlState::SafeOp); KINDS.len()]);
}
