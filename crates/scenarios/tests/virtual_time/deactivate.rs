//! The end of an application: all SubDevices in PREOP with mailboxes, the scan kept, another declaration at once
//! (protocol 5.3, phases of IgH).

use std::time::Duration;

use ringcat::{
    Application, ClockConfig, Declaration, DomainId, Error, Event, LastOutputs, Link, Links, MainDevice, Options,
    Position, Retries, Scan, Services, StopError, SubDeviceConfig, SubDeviceId, SubDeviceState, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::{Fmmu, map};
use scenarios::calls::faults::write_as_another;
use scenarios::segments::{SIXTEEN, descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::witness::Witness;
use scenarios::world::CYCLE;

const LIMIT: Duration = Duration::from_secs(1);
/// All of an activation after a deactivation but the state changes.
const BESIDE_CHANGES: Duration = Duration::from_millis(10);
/// The set-up of clocks that are known: one latched frame shows that the segment is the same, another gives the times
/// for the offsets, then offsets, delays and filters of all are written. It needs one cycle more than the
/// configuration beside it, two if it begins late in a cycle; the lock of the clocks is not awaited.
const CLOCK_SET_UP: Duration = Duration::from_millis(2);
/// DC_SYSTEM_TIME_OFFSET to DC_SPEED_COUNTER_DIFFERENCE and the filters.
const CLOCK_SET_UP_REGISTERS: std::ops::Range<u16> = 0x0920..0x0936;
/// Two with a mailbox, two with device emulation, two with neither.
const MIXED: [&str; 6] =
    ["servo", "digital-output-8", "emulated-output-8", "servo", "emulated-input-8", "digital-input-8"];
/// SII_CONTROL to SII_DATA: with SII_CONFIGURATION before them the EEPROM only changes its owner.
const SII_INTERFACE: std::ops::Range<u16> = 0x0502..0x0510;
const PREOP: AlStatus = AlStatus::new(AlState::PreOp);

fn networks() -> [Network; 2] {
    let options = NetworkOptions::default;
    [line(descriptions(&MIXED), options()), ring(descriptions(&MIXED), options())]
}

fn scanned(network: Network, options: &Options) -> (MainDevice<Tap>, Scan) {
    let mut main_device = MainDevice::request(Tap::new(network), options);
    let scan = main_device.scan().expect("it can be scanned");
    (main_device, scan)
}

fn activate(main_device: MainDevice<Tap>, declaration: Declaration) -> Application<Tap> {
    main_device.activate(declaration).map_err(Error::from).expect("it fits")
}

fn cycles<L: Links>(application: &mut Application<L>, count: usize) {
    (0..count).for_each(|_| application.cycle(|_| ()));
}

fn settle<L: Links>(application: &mut Application<L>) {
    let end = application.now() + Duration::from_secs(2);
    while !application.all_settled() {
        assert!(application.now() < end, "{:?}", application.states());
        application.cycle(|_| ());
    }
}

/// Declares the SubDevices at these positions, each in a domain of its own.
fn declare(scan: &Scan, positions: &[usize], clocks: bool) -> Declaration {
    let mut declaration = Declaration::default();
    for at in positions {
        let domain = declaration.add_domain(CYCLE);
        declaration.add_to(domain, SubDeviceConfig::from_info(&scan.subdevices[*at]));
    }
    declaration.with_clocks(clocks.then(ClockConfig::default))
}

fn statuses(main_device: &mut MainDevice<Tap>) -> Vec<AlStatus> {
    main_device.links_mut().network().devices().map(|device| device.al_status()).collect()
}

/// Bytes of FMMUs that are not zero, in all devices.
fn mapped(main_device: &mut MainDevice<Tap>) -> usize {
    let network = main_device.links_mut().network();
    let fmmus = |device: &ringcat_sim::device::Device| {
        let count = Fmmu::LEN * usize::from(device.controller.config().fmmu_count);
        device.controller.register(map::FMMU_BASE, count).iter().filter(|byte| **byte != 0).count()
    };
    network.devices().map(fmmus).sum()
}

// covers: stop
#[test]
fn after_deactivation_every_subdevice_is_in_preop_with_its_mailbox() {
    for ran in [0, 3, 8, 20, 500] {
        for declared in [&[0, 1, 2, 3, 4, 5][..], &[1, 4], &[3], &[]] {
            for network in networks() {
                let (main_device, scan) = scanned(network, &Options::default());
                let mut application = activate(main_device, declare(&scan, declared, false));
                cycles(&mut application, ran);
                let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
                assert_eq!(statuses(&mut ended), [PREOP; MIXED.len()], "{declared:?} after {ran}");
                assert_eq!(mapped(&mut ended), 0);
                for servo in [0, 3] {
                    let vendor = ended.subdevice(Position(servo)).sdo_read::<u32>(0x1018, 1).expect("it answers");
                    assert_eq!(vendor, scan.subdevices[usize::from(servo)].identity.vendor_id);
                }
                assert_eq!(statuses(&mut ended), [PREOP; MIXED.len()], "the mailbox was open already");
            }
        }
    }
}

// covers: stop
#[test]
fn another_declaration_is_active_at_once_after_deactivation() {
    for network in networks() {
        let (mut main_device, scan) = scanned(network, &Options::default());
        let network = main_device.links_mut().network_mut();
        // A word that is read again would be wrong.
        (0..MIXED.len()).for_each(|at| network.device_mut(DeviceIndex(at)).controller.sii_image_mut().fill(0));
        let rounds: [(&[usize], bool); 5] =
            [(&[0, 1, 2, 3, 4, 5], false), (&[3, 1], true), (&[5], false), (&[0, 3], true), (&[2, 3, 4], false)];
        for (declared, clocks) in rounds {
            let mut application = activate(main_device, declare(&scan, declared, clocks));
            settle(&mut application);
            cycles(&mut application, 20);
            for domain in 0..declared.len() {
                let status = application.process(DomainId(domain));
                assert!(status.wkc == status.expected, "{status:?}");
            }
            let network = application.links().network();
            let in_op =
                network.devices().enumerate().filter(|(_, device)| device.al_status().state == AlState::Op.code());
            let mut expected = declared.to_vec();
            expected.sort_unstable();
            assert_eq!(in_op.map(|(at, _)| at).collect::<Vec<_>>(), expected);
            main_device = application.deactivate(LastOutputs::Held, LIMIT).expect("all follow");
            assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()], "{declared:?}");
            while let Some(event) = main_device.pop_event() {
                assert!(!matches!(event.event, Event::SiiWarning { .. } | Event::ScanFailed { .. }), "{event:?}");
            }
        }
    }
}

/// On a line and in a ring, with idle operation and without, without and with clocks. No word of an SII is read: its
/// control, address and data registers are not touched.
// covers: stop
#[test]
fn activation_after_deactivation_of_100_takes_the_state_changes_and_10_ms() {
    let kinds: Vec<&str> = SIXTEEN.into_iter().cycle().take(100).collect();
    let described = descriptions(&kinds);
    let times = described.iter().map(|it| it.transitions);
    let changes = times.map(|it| it.to_init + it.to_preop + it.to_safeop + it.to_op).max().expect("there are some");
    for (is_ring, with_idle, clocks) in
        [(true, false, false), (true, true, false), (false, true, false), (true, true, true)]
    {
        let build = if is_ring { ring } else { line };
        let network = build(described.clone(), NetworkOptions::default());
        let (links, frames) = Witness::new(Tap::new(network));
        let mut main_device = MainDevice::request(links, &Options::default().with_idle_operation(with_idle));
        let scan = main_device.scan().expect("it can be scanned");
        let declaration = automatic(&scan.subdevices, CYCLE).with_clocks(clocks.then(ClockConfig::default));
        let mut application = main_device.activate(declaration.clone()).map_err(Error::from).expect("it fits");
        settle(&mut application);
        frames.take();
        let begun = application.now();
        let ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
        let deactivation = ended.now().since(begun);
        let begun = ended.now();
        let mut application = ended.activate(declaration).map_err(Error::from).expect("it fits");
        settle(&mut application);
        let activation = application.now().since(begun);
        let what = format!("100 SubDevices, ring {is_ring}, idle operation {with_idle}, clocks {clocks}");
        println!("{what}: deactivation {deactivation:?}, activation {activation:?}, state changes {changes:?}");
        let sent = frames.sent();
        let touched = sent.iter().filter(|(_, _, register)| SII_INTERFACE.contains(register)).count();
        assert_eq!((touched, sent.len() > 1_000), (0, true), "{what}");
        // One wait more: the clocks are set up before SubDevices that have one may go to OP.
        let in_set_up = |(_, _, register): &&(Link, u8, u16)| CLOCK_SET_UP_REGISTERS.contains(register);
        let written = sent.iter().filter(in_set_up).count();
        assert_eq!(written > 100, clocks, "{what}: {written} datagrams of a clock set-up");
        let limit = changes + BESIDE_CHANGES + if clocks { CLOCK_SET_UP } else { Duration::ZERO };
        assert!(activation <= limit, "{what}: {activation:?}");
        let all = application.links().links().network().devices();
        assert!(all.into_iter().all(|device| device.al_status() == AlStatus::new(AlState::Op)), "{what}");
    }
}

// covers: stop
#[test]
fn a_subdevice_that_came_while_active_is_known_after_deactivation() {
    for network in networks() {
        let (mut main_device, _) = scanned(network, &Options::default());
        main_device.links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(5)));
        main_device.links_mut().network_mut().advance_by(Duration::from_millis(20));
        let scan = main_device.scan().expect("the others are there");
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices.iter_mut().for_each(|config| config.optional = true);
        let mut application = activate(main_device, declaration);
        settle(&mut application);
        application.links_mut().network_mut().apply(Fault::PowerOn(DeviceIndex(5)));
        application.links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(4)));
        cycles(&mut application, 100);
        application.links_mut().network_mut().apply(Fault::PowerOn(DeviceIndex(4)));
        cycles(&mut application, 500);
        let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
        assert_eq!(statuses(&mut ended), [PREOP; MIXED.len()]);
        // SubDevices of one type share their names, as they share their SII.
        let names: Vec<String> = ended.subdevices().into_iter().map(|info| info.name).collect();
        assert_eq!(names.len(), MIXED.len());
        assert!(names.iter().zip(MIXED).all(|(name, kind)| name.starts_with(kind)), "{names:?}");
        let declaration = automatic(&ended.subdevices(), CYCLE);
        settle(&mut activate(ended, declaration));
    }
}

// covers: stop
#[test]
fn a_subdevice_that_does_not_leave_op_is_named_and_the_main_device_is_returned() {
    for network in networks() {
        let (main_device, scan) = scanned(network, &Options::default());
        let mut application = activate(main_device, automatic(&scan.subdevices, CYCLE));
        settle(&mut application);
        application.links_mut().network_mut().apply(Fault::Hang(DeviceIndex(3), true));
        let limit = Duration::from_millis(60);
        let refused = application.deactivate(LastOutputs::Held, limit).expect_err("device 3 hangs");
        let Error::Stop(StopError::NotReached { subdevice, others, .. }) = &refused.error else {
            panic!("{}", refused.error)
        };
        assert_eq!((*subdevice, *others), (Some(SubDeviceId(3)), 0));
        let mut ended = refused.main_device;
        ended.links_mut().network_mut().apply(Fault::Hang(DeviceIndex(3), false));
        settle(&mut activate(ended, automatic(&scan.subdevices, CYCLE)));
    }
}

/// An application in which device 3 refuses SAFEOP this many times.
fn refusing(network: Network, retries: Retries, times: u32) -> Application<Tap> {
    let (mut main_device, scan) = scanned(network, &Options::default().with_retries(retries));
    let (device, code) = (DeviceIndex(3), AlStatusCode(0x8042));
    let refuse = Fault::RefuseTransition { device, to: AlState::SafeOp, code, times };
    main_device.links_mut().network_mut().apply(refuse);
    activate(main_device, automatic(&scan.subdevices, CYCLE))
}

fn refusals(application: &mut Application<Tap>) -> usize {
    std::iter::from_fn(|| application.pop_event()).filter(|it| matches!(it.event, Event::StateError { .. })).count()
}

// covers: stop
#[test]
fn a_failed_configuration_waits_for_a_request_with_that_policy() {
    for network in networks() {
        let mut application = refusing(network, Retries::OnRequest, 2);
        cycles(&mut application, 3_000);
        assert_eq!(refusals(&mut application), 1, "it is not repeated by itself");
        assert_eq!(application.states()[3], SubDeviceState::Configuring);
        assert!(Services::retry(&mut application, None));
        cycles(&mut application, 100);
        assert_eq!(refusals(&mut application), 1, "the second attempt");
        assert!(Services::retry(&mut application, Some(SubDeviceId(3).into())));
        assert!(!Services::retry(&mut application, Some(SubDeviceId(99).into())));
        cycles(&mut application, 100);
        assert!(application.all_settled());
    }
}

/// As when a bus is handed over: a SubDevice that refuses a state because it is not in the preceding one is configured
/// again. Evaluated by the states inside the SubDevices.
// covers: stop, refused-states
#[test]
fn a_late_request_of_another_program_does_not_end_a_configuration() {
    const FAST: Duration = Duration::from_micros(100);
    /// Cycles after which all SubDevices are in OP.
    const IN_OP: usize = 26;
    for state in [AlState::Init, AlState::PreOp, AlState::SafeOp] {
        let mut refused = 0;
        let moments: Vec<usize> = match state {
            AlState::SafeOp => (0..IN_OP).chain((IN_OP..250).step_by(56)).collect(),
            _ => (0..250).collect(),
        };
        for (network, late) in moments.into_iter().flat_map(|late| networks().map(|network| (network, late))) {
            let (main_device, scan) = scanned(network, &Options::default().with_retries(Retries::OnRequest));
            let mut application = activate(main_device, automatic(&scan.subdevices, FAST));
            cycles(&mut application, late);
            let request = AlControl::new(state).encode();
            let network = application.links_mut().network_mut();
            (0..MIXED.len() as u16).for_each(|at| write_as_another(network, at, map::AL_CONTROL, &request));
            // A SAFEOP in OP is seen by the read of all states, once a second: no working counter shows it.
            let is_unseen = state == AlState::SafeOp && late >= IN_OP;
            cycles(&mut application, if is_unseen { 12_000 } else { 500 });
            let since = application.now();
            while !application.all_settled() && application.now() < since + Duration::from_secs(2) {
                application.cycle(|_| ());
            }
            cycles(&mut application, 500);
            let text = format!("{state} after {late} cycles: {:?}", application.states());
            let devices = application.links().network().devices();
            let states: Vec<AlStatus> = devices.map(|device| device.al_status()).collect();
            assert_eq!(states, [AlStatus::new(AlState::Op); MIXED.len()], "{text}");
            refused += refusals(&mut application);
        }
        println!("{state}: {refused} refusals");
    }
}

// covers: stop
#[test]
fn a_requested_retry_does_not_wait_for_the_end_of_a_pause() {
    for network in networks() {
        let mut application = refusing(network, Retries::Always, 7);
        cycles(&mut application, 4_000);
        assert!(!application.all_settled());
        let before = refusals(&mut application);
        assert!((5..7).contains(&before), "pauses grow: {before}");
        for _ in before..7 {
            assert!(Services::retry(&mut application, Some(SubDeviceId(3).into())));
            cycles(&mut application, 50);
            refusals(&mut application);
        }
        assert!(Services::retry(&mut application, None));
        cycles(&mut application, 50);
        assert!(application.all_settled());
    }
}

/// Other PDOs, then those of the SII, of a MainDevice that keeps no SubDevice in PREOP by itself.
// covers: stop, plan
#[test]
fn declarations_with_other_pdos_follow_each_other_without_idle_operation() {
    use scenarios::calls::configure::ChosenPdos;
    for network in networks() {
        let (mut main_device, scan) = scanned(network, &Options::default());
        for chosen in [ChosenPdos::Others, ChosenPdos::Named, ChosenPdos::Shortened, ChosenPdos::Named] {
            for is_scanned_again in [false, true] {
                if is_scanned_again {
                    main_device.scan().expect("it can be scanned");
                }
                let mut declaration = declare(&scan, &[0, 1, 2, 3, 4, 5], false);
                for at in [0, 3] {
                    for sync in chosen.of(&scenarios::segments::describe("servo", "servo")) {
                        let config = declaration.subdevices[at].clone();
                        declaration.subdevices[at] = config.assign(sync.index, sync.direction, sync.pdos);
                    }
                }
                let mut application = activate(main_device, declaration);
                settle(&mut application);
                cycles(&mut application, 5);
                let dictionary = application.links().network().device(DeviceIndex(3)).application.dictionary();
                let now = (dictionary.assigned(2).next(), dictionary.assigned_bits(2));
                let expected = match chosen {
                    ChosenPdos::Others => (Some(0x1601), 16),
                    ChosenPdos::Named => (Some(0x1600), 96),
                    ChosenPdos::Shortened => (Some(0x1600), 16),
                };
                assert_eq!(now, expected, "{chosen:?}");
                main_device = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
                assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()], "{chosen:?}");
            }
        }
    }
}

/// One of them does not leave OP, so the others are waited for when the frames are lost.
// covers: stop
#[test]
fn a_deactivation_keeps_its_limit_when_the_host_cable_is_cut_during_it() {
    const SHORT: Duration = Duration::from_millis(100);
    for after in (0..100).step_by(3).map(Duration::from_millis) {
        for network in networks() {
            let (main_device, scan) = scanned(network, &Options::default());
            let mut application = activate(main_device, declare(&scan, &[0, 1, 2, 3, 4, 5], false));
            settle(&mut application);
            let network = application.links_mut().network_mut();
            network.apply(Fault::Hang(DeviceIndex(0), true));
            let (at, last) = (network.now() + after, network.cables().len() - 1);
            [0, last].into_iter().for_each(|cable| network.schedule(at, Fault::Cut(CableId(cable))));
            let begun = application.now();
            let mut ended = match application.deactivate(LastOutputs::Held, SHORT) {
                Ok(_) => panic!("it has not left OP"),
                Err(refused) => refused.main_device,
            };
            let took = ended.now().since(begun);
            assert!(took <= SHORT + 4 * CYCLE, "cut after {after:?}: {took:?}");
            assert!(ended.links_mut().network().device(DeviceIndex(0)).al_status().state != PREOP.state);
        }
    }
}

/// The SubDevice has refused PREOP before, and with this policy waits for a request.
// covers: stop
#[test]
fn a_subdevice_that_refuses_preop_does_not_make_a_deactivation_last_its_limit() {
    let code = AlStatusCode(0x8042);
    for with_idle in [false, true] {
        for network in networks() {
            let options = Options::default().with_retries(Retries::OnRequest).with_idle_operation(with_idle);
            let (mut main_device, scan) = scanned(network, &options);
            let refuse = Fault::RefuseTransition { device: DeviceIndex(3), to: AlState::PreOp, code, times: u32::MAX };
            main_device.links_mut().network_mut().apply(refuse);
            let mut application = activate(main_device, automatic(&scan.subdevices, CYCLE));
            cycles(&mut application, 500);
            let begun = application.now();
            let refused = application.deactivate(LastOutputs::Zero, LIMIT).expect_err("device 3 refuses PREOP");
            let took = refused.main_device.now().since(begun);
            assert!(took <= Duration::from_millis(100), "{took:?}");
            let Error::Stop(StopError::NotReached { subdevice, code: said, limit, others, .. }) = refused.error else {
                panic!("{}", refused.error)
            };
            assert_eq!((subdevice, said, others), (Some(SubDeviceId(3)), code, 0));
            assert!(limit <= took, "the time that it had: {limit:?} of {took:?}");
            let mut ended = refused.main_device;
            let statuses = statuses(&mut ended);
            assert!(statuses.iter().enumerate().all(|(at, status)| at == 3 || *status == PREOP), "{statuses:?}");
        }
    }
}

/// Ports of neighbours were closed by order of the application: they can be opened without it, and by the next one.
// covers: stop, registers
#[test]
fn ports_that_were_closed_by_order_can_be_opened_after_the_application() {
    for is_next in [false, true] {
        for network in networks() {
            let (main_device, scan) = scanned(network, &Options::default());
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.subdevices.iter_mut().for_each(|config| config.optional = true);
            let mut application = activate(main_device, declaration.clone());
            settle(&mut application);
            let mut block = application.engine_mut().start_block(SubDeviceId(4));
            cycles(&mut application, 300);
            let blocked = block.take().expect("it has ended").expect("it has neighbours").len();
            let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all others follow");
            assert!(closed(ended.links_mut().network()) == blocked);
            let mut application = if is_next {
                let mut application = activate(ended, declaration);
                let mut open = application.engine_mut().start_open_blocked();
                cycles(&mut application, 300);
                assert_eq!(open.take(), Some(Ok(blocked)));
                application
            } else {
                let mut open = ended.engine_mut().start_open_blocked();
                ended.attend(Duration::from_millis(100));
                assert_eq!(open.take(), Some(Ok(blocked)));
                activate(ended, declaration)
            };
            assert_eq!(closed(application.links_mut().network()), 0);
            settle(&mut application);
            cycles(&mut application, 300);
            assert_eq!(application.states()[4], SubDeviceState::Settled(AlState::Op));
        }
    }
}

/// Number of ports that are set to be closed.
fn closed(network: &Network) -> usize {
    let loops = network.devices().map(|device| device.controller.register(map::DL_CONTROL.offset(1), 1)[0]);
    loops.map(|loops| (0..4).filter(|port| loops >> (2 * port) & 3 == 3).count()).sum()
}

/// A SubDevice hangs while it is brought to PREOP, and then no frame returns.
// covers: stop
#[test]
fn a_deactivation_succeeds_only_if_frames_confirm_it() {
    const SHORT: Duration = Duration::from_millis(100);
    for after in (0..60).map(|half| Duration::from_micros(500 * half)) {
        for network in networks() {
            let (main_device, scan) = scanned(network, &Options::default());
            let mut application = activate(main_device, declare(&scan, &[0, 1, 2, 3, 4, 5], false));
            settle(&mut application);
            let network = application.links_mut().network_mut();
            let (begun, last) = (network.now(), network.cables().len() - 1);
            network.schedule(begun + after, Fault::Hang(DeviceIndex(3), true));
            let cut = begun + Duration::from_millis(60);
            [0, last].into_iter().for_each(|cable| network.schedule(cut, Fault::Cut(CableId(cable))));
            match application.deactivate(LastOutputs::Held, SHORT) {
                Ok(mut ended) => assert_eq!(statuses(&mut ended), [PREOP; MIXED.len()], "it hangs after {after:?}"),
                Err(refused) => assert!(!refused.error.to_string().contains("no SubDevice answers"), "{after:?}"),
            }
        }
    }
}

// covers: stop
#[test]
fn a_deactivation_without_a_cable_says_that_no_frame_returns() {
    for network in networks() {
        let (main_device, scan) = scanned(network, &Options::default());
        let mut application = activate(main_device, automatic(&scan.subdevices, CYCLE));
        settle(&mut application);
        let network = application.links_mut().network_mut();
        let last = network.cables().len() - 1;
        [0, last].into_iter().for_each(|cable| network.apply(Fault::Cut(CableId(cable))));
        let refused = application.deactivate(LastOutputs::Zero, LIMIT).expect_err("no frame returns");
        let text = refused.error.to_string();
        assert!(text.contains("frame"), "{text}");
    }
}
