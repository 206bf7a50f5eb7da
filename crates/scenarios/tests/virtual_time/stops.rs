//! Orderly stops of segments with different SubDevices: undeclared, in lower states, with device emulation, or refusing
//! (protocol 5.3).

use std::time::Duration;

use ringcat::{
    Application, Declaration, Error, LastOutputs, MainDevice, Options, Scan, StopError, SubDeviceId, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::CYCLE;

const LIMIT: Duration = Duration::from_secs(1);
/// Two with a mailbox, two with device emulation, two with neither.
const MIXED: [&str; 6] =
    ["servo", "digital-output-8", "emulated-output-8", "servo", "emulated-input-8", "digital-input-8"];

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&MIXED), options()), ring(descriptions(&MIXED), options())]
}

/// Runs until the declared SubDevices are in their states, and a little longer.
fn run(network: Network, declare: impl FnOnce(&Scan) -> Declaration) -> Application<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
    let scan = main_device.scan().expect("six SubDevices");
    let mut application = main_device.activate(declare(&scan)).map_err(Error::from).expect("it fits");
    cycles(&mut application, 1_000);
    assert!(application.all_settled());
    application
}

fn cycles(application: &mut Application<Tap>, count: usize) {
    (0..count).for_each(|_| application.cycle(|_| ()));
}

/// All but those at some positions.
fn without(scan: &Scan, left_out: &[usize]) -> Declaration {
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    let mut at = 0..;
    declaration.subdevices.retain(|_| at.next().is_some_and(|at: usize| !left_out.contains(&at)));
    let names = declaration.subdevices.len();
    for domain in &mut declaration.domains {
        domain.members.truncate(names);
        domain.members.iter_mut().enumerate().for_each(|(index, member)| member.subdevice = SubDeviceId(index));
    }
    declaration
}

fn statuses(main_device: &mut MainDevice<Tap>) -> Vec<AlStatus> {
    main_device.links_mut().network().devices().map(|device| device.al_status()).collect()
}

const INIT: AlStatus = AlStatus::new(AlState::Init);

// covers: stop
#[test]
fn a_stop_to_any_state_leaves_undeclared_subdevices_where_they_are() {
    for state in [AlState::Init, AlState::PreOp, AlState::SafeOp] {
        for left_out in [&[0][..], &[2], &[3, 4], &[0, 1, 2, 3, 4, 5]] {
            for network in networks() {
                let application = run(network, |scan| without(scan, left_out));
                let mut stopped =
                    application.stop(LastOutputs::Zero, state, LIMIT).expect("all that were in OP follow");
                let expected: Vec<AlStatus> = (0..MIXED.len())
                    .map(|at| if left_out.contains(&at) { INIT } else { AlStatus::new(state) })
                    .collect();
                assert_eq!(statuses(&mut stopped), expected, "{state}, without {left_out:?}");
                assert_eq!(stopped.scan().expect("it scans again").subdevices.len(), MIXED.len());
                assert_eq!(statuses(&mut stopped), [INIT; MIXED.len()]);
            }
        }
    }
}

// covers: stop
#[test]
fn a_stop_raises_no_subdevice_that_is_in_a_lower_state() {
    let targets = [AlState::PreOp, AlState::Op, AlState::Init, AlState::SafeOp, AlState::PreOp, AlState::Op];
    let ranks = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
    let rank = |state: AlState| ranks.iter().position(|other| *other == state);
    for state in ranks {
        for network in networks() {
            let application = run(network, |scan| {
                let mut declaration = automatic(&scan.subdevices, CYCLE);
                declaration.subdevices.iter_mut().zip(targets).for_each(|(config, target)| config.target = target);
                declaration
            });
            let mut stopped = application.stop(LastOutputs::Held, state, LIMIT).expect("all follow");
            let lower = |target: AlState| if rank(target) < rank(state) { target } else { state };
            assert_eq!(statuses(&mut stopped), targets.map(|target| AlStatus::new(lower(target))), "{state}");
        }
    }
}

// covers: stop
#[test]
fn a_stop_acknowledges_errors_of_subdevices() {
    for state in [AlState::Init, AlState::PreOp, AlState::SafeOp] {
        for network in networks() {
            let mut application = run(network, |scan| automatic(&scan.subdevices, CYCLE));
            // Longer than the watchdog, without a cycle in which the supervisor could recover a SubDevice.
            application.links_mut().network_mut().advance_by(Duration::from_millis(150));
            let fallen = application.links().network().devices().filter(|device| device.al_status().error).count();
            assert!(fallen >= 3, "{fallen} fell");
            let mut stopped = application.stop(LastOutputs::Held, state, LIMIT).expect("all follow");
            assert_eq!(statuses(&mut stopped), [AlStatus::new(state); MIXED.len()], "{state}");
        }
    }
}

// covers: stop
#[test]
fn a_subdevice_that_does_not_stop_is_named_and_delays_no_other() {
    for network in networks() {
        let mut application = run(network, |scan| without(scan, &[0]));
        application.links_mut().network_mut().apply(Fault::Hang(DeviceIndex(3), true));
        let limit = Duration::from_millis(50);
        let Err(error) = application.stop(LastOutputs::Held, AlState::PreOp, limit) else { panic!("device 3 hangs") };
        let Error::Stop(StopError::NotReached { subdevice, others, status, .. }) = &error else { panic!("{error}") };
        assert_eq!((*subdevice, *others, status.state), (Some(SubDeviceId(2)), 0, AlState::Op.code()));
        let text = error.to_string();
        assert!(text.contains("SubDevice 2 (station 0x1004) did not reach PREOP within 50 ms"), "{text}");
    }
}

// covers: stop
#[test]
fn a_subdevice_that_refuses_is_named_with_its_code() {
    for network in networks() {
        let mut application = run(network, |scan| automatic(&scan.subdevices, CYCLE));
        let (code, to) = (AlStatusCode(0x8042), AlState::PreOp);
        let refuse = Fault::RefuseTransition { device: DeviceIndex(3), to, code, times: 1_000_000 };
        application.links_mut().network_mut().apply(refuse);
        let Err(error) = application.stop(LastOutputs::Held, to, Duration::from_millis(50)) else { panic!("refused") };
        let Error::Stop(StopError::NotReached { subdevice, code: said, .. }) = &error else { panic!("{error}") };
        assert_eq!((*subdevice, *said), (Some(SubDeviceId(3)), code), "{error}");
        assert!(error.to_string().contains("0x8042"), "{error}");
    }
}

// covers: stop
#[test]
fn absent_subdevices_do_not_delay_a_stop() {
    for state in [AlState::Init, AlState::PreOp] {
        let mut application = run(line(descriptions(&MIXED), NetworkOptions::default()), |scan| without(scan, &[1]));
        application.links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(4)));
        cycles(&mut application, 30);
        let mut stopped = application.stop(LastOutputs::Held, state, LIMIT).expect("those that are there follow");
        let now = statuses(&mut stopped);
        let led = |at: usize| AlStatus::new(if at == 1 { AlState::Init } else { state });
        assert_eq!(now[..4], [led(0), led(1), led(2), led(3)]);
    }
    let mut application =
        run(line(descriptions(&MIXED), NetworkOptions::default()), |scan| automatic(&scan.subdevices, CYCLE));
    application.links_mut().network_mut().cut(CableId(0));
    cycles(&mut application, 30);
    let Err(error) = application.stop(LastOutputs::Held, AlState::PreOp, LIMIT) else { panic!("no frame comes back") };
    assert!(matches!(error, Error::Stop(_)), "{error}");
}

// covers: stop
#[test]
fn a_scan_clears_all_errors_even_if_one_does_not_reach_init() {
    for network in networks() {
        let application = run(network, |scan| automatic(&scan.subdevices, CYCLE));
        let mut stopped = application.stop(LastOutputs::Held, AlState::PreOp, LIMIT).expect("all follow");
        stopped.links_mut().network_mut().apply(Fault::Hang(DeviceIndex(3), true));
        assert_eq!(stopped.scan().expect("six SubDevices").subdevices.len(), MIXED.len());
        let mut expected = [INIT; MIXED.len()];
        expected[3] = AlStatus::new(AlState::PreOp);
        assert_eq!(statuses(&mut stopped), expected);
    }
}

// covers: stop
#[test]
fn an_application_follows_another_one_without_a_scan_and_without_the_eeproms() {
    for network in networks() {
        let mut declaration = None;
        let mut application = run(network, |scan| declaration.insert(automatic(&scan.subdevices, CYCLE)).clone());
        let declaration = declaration.expect("it was declared");
        let network = application.links_mut().network_mut();
        (0..MIXED.len()).for_each(|at| network.device_mut(DeviceIndex(at)).controller.sii_image_mut().fill(0));
        let busy = application.engine().under_way();
        for round in 0..20 {
            let state = [AlState::PreOp, AlState::Init, AlState::SafeOp][round % 3];
            // Every second stop comes in the middle of the configuration.
            let stopped = application.stop(LastOutputs::Zero, state, LIMIT).expect("all follow");
            application = stopped.activate(declaration.clone()).map_err(Error::from).expect("it fits");
            cycles(&mut application, if round % 2 == 0 { 3 } else { 1_000 });
            if round % 2 == 1 {
                assert!(application.all_settled(), "round {round}: {:?}", application.states());
                assert_eq!(application.engine().under_way().datagrams, busy.datagrams, "round {round}");
                assert_eq!(application.engine().under_way().procedures, busy.procedures, "round {round}");
            }
        }
    }
}
