//! Rings and branches that the MainDevice opens at a port: the application closes another port meanwhile, or ends.
//! Evaluated by the loop settings inside the SubDevices (protocol 2.2, 7.1).

use std::time::Duration;

use ringcat::{
    Application, ClockConfig, Error, JunctionMode, LastOutputs, MainDevice, Options, Pending, SubDeviceId, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port::{A, B, C, D};
use ringcat_sim::network::Network;
use ringcat_wire::register::{DlControl, LoopControl, map};
use scenarios::clocks::{clocked, wired};
use scenarios::segments::{MAIN, REDUNDANT, at};
use scenarios::tap::Tap;

/// Several cycles pass while a ring is open.
const CYCLE: Duration = Duration::from_micros(250);
/// Less than the time after which temporary loop settings end.
const LIMIT: Duration = Duration::from_millis(300);
/// A ring of two links. Ports 2 and 3 of its SubDevices are free.
const THREE: [(Endpoint, Endpoint); 4] =
    [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(1, B), at(2, A)), (at(2, B), REDUNDANT)];
/// A fork with two branches behind it.
const FORK: [(Endpoint, Endpoint); 5] =
    [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(1, D), at(2, A)), (at(1, B), at(3, A)), (at(3, B), at(4, A))];

fn active(network: Network) -> Application<Tap> {
    active_in(JunctionMode::Automatic, network)
}

fn active_in(junctions: JunctionMode, network: Network) -> Application<Tap> {
    let options = Options::default().with_junctions(junctions);
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    let scan = main_device.scan().expect("it can be scanned");
    let declaration = automatic(&scan.subdevices, CYCLE).with_clocks(Some(ClockConfig::default()));
    main_device.activate(declaration).map_err(Error::from).expect("it fits")
}

/// The fork itself has no clock.
fn fork() -> Network {
    let mut described = clocked(5, 50);
    described[1].dc = None;
    wired(described, &FORK)
}

fn cycles(application: &mut Application<Tap>, count: usize) {
    (0..count).for_each(|_| application.cycle(|_| ()));
}

/// The loop settings of all SubDevices.
fn controls(network: &Network) -> Vec<DlControl> {
    let read = |device: &ringcat_sim::device::Device| {
        let bytes = device.controller.register(map::DL_CONTROL, DlControl::LEN);
        DlControl::decode(bytes.first_chunk().expect("four bytes"))
    };
    network.devices().map(read).collect()
}

fn is_open(control: &DlControl) -> bool {
    control.loops == [LoopControl::Auto; 4]
}

/// Whether a port is closed for a moment now.
fn is_any_temporary(network: &Network) -> bool {
    controls(network).iter().any(|control| control.temporary && !is_open(control))
}

/// The port is closed and all others are as before.
fn assert_only_port_2_is_closed(application: &Application<Tap>, device: DeviceIndex, text: &str) {
    let control = controls(application.links().network())[device.0];
    let expected = [LoopControl::Auto, LoopControl::Auto, LoopControl::Closed, LoopControl::Auto];
    assert_eq!((control.temporary, control.loops), (false, expected), "{text}");
}

// covers: dc-delays, 2.2
#[test]
fn a_port_that_the_application_closes_while_a_ring_is_opened_stays_closed() {
    let last = DeviceIndex(2);
    let mut were_open = 0;
    for begun in 0..60 {
        let mut application = active(wired(clocked(3, 50), &THREE));
        cycles(&mut application, begun);
        were_open += usize::from(is_any_temporary(application.links().network()));
        let mut set = application.engine_mut().start_port_set(SubDeviceId(last.0), 2, LoopControl::Closed);
        cycles(&mut application, 12_000);
        assert!(matches!(set.take(), Some(Ok(()))), "after {begun} cycles");
        assert_only_port_2_is_closed(&application, last, &format!("after {begun} cycles"));
    }
    assert!(were_open > 0, "no ring was open");
}

// covers: dc-delays, 2.2
#[test]
fn a_port_that_is_closed_while_a_measurement_waits_for_its_turn_stays_closed() {
    let last = DeviceIndex(2);
    let mut were_open = 0;
    for begun in 0..160 {
        let mut network = wired(clocked(3, 50), &THREE);
        network.cut(CableId(1));
        network.advance_by(Duration::from_millis(1));
        let mut application = active(network);
        cycles(&mut application, 2_000);
        application.links_mut().network_mut().heal(CableId(1));
        // Rescans have their turns, one after the other, while the clocks are to be measured.
        let mut rescan = None;
        let (mut set, mut was_open) = (None, false);
        for cycle in 0..800 {
            let engine = application.engine_mut();
            if cycle < 400 && rescan.as_ref().is_none_or(|rescan: &Pending<_>| !rescan.is_running()) {
                rescan = Some(engine.start_rescan(LIMIT));
            }
            if cycle == begun {
                set = Some(engine.start_port_set(SubDeviceId(last.0), 2, LoopControl::Closed));
            }
            cycles(&mut application, 1);
            was_open |= is_any_temporary(application.links().network());
        }
        cycles(&mut application, 8_000);
        assert!(matches!(set.and_then(|mut set| set.take()), Some(Ok(()))), "after {begun} cycles");
        assert_only_port_2_is_closed(&application, last, &format!("after {begun} cycles"));
        were_open += usize::from(was_open);
    }
    assert!(were_open > 0, "no ring was open");
}

/// Ends an application after each number of cycles; returns how often ports were closed for a moment then.
fn end_after_each(network: impl Fn() -> Network) -> usize {
    let mut were_open = 0;
    for ran in 0..80 {
        let mut application = active(network());
        cycles(&mut application, ran);
        let was_open = is_any_temporary(application.links().network());
        were_open += usize::from(was_open);
        let count = application.links().network().devices().len();
        let ended = application.deactivate(LastOutputs::Zero, LIMIT);
        let mut ended = ended.unwrap_or_else(|error| panic!("after {ran} cycles: {error}"));
        let found = ended.subdevices().len();
        assert_eq!(found, count, "after {ran} cycles, {was_open}");
        let controls = controls(ended.links_mut().network());
        assert!(controls.iter().all(is_open), "after {ran} cycles: {controls:?}");
    }
    were_open
}

// covers: dc-delays, stop
#[test]
fn a_ring_that_is_open_when_the_application_ends_is_closed_again_first() {
    assert!(end_after_each(|| wired(clocked(3, 50), &THREE)) > 0, "no ring was open");
}

// covers: dc-delays, stop
#[test]
fn branches_that_are_closed_when_the_application_ends_are_opened_first() {
    assert!(end_after_each(fork) > 0, "no branch was closed");
}

/// The open port of an undeclared broken ring looks like the end of the ring of two links. Closing it would cut off the
/// members behind the break.
// covers: dc-delays, 2.2
#[test]
fn no_ring_is_opened_at_a_port_that_may_belong_to_an_unknown_ring() {
    const CABLES: [(Endpoint, Endpoint); 6] = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, D), at(2, A)),
        (at(2, B), at(3, A)),
        (at(3, B), at(1, B)),
        (at(1, C), REDUNDANT),
    ];
    for (junctions, cut, is_opened) in [
        (JunctionMode::Disabled, Some(CableId(3)), false),
        (JunctionMode::Disabled, Some(CableId(2)), false),
        (JunctionMode::Automatic, None, true),
    ] {
        let mut network = wired(clocked(4, 50), &CABLES);
        cut.into_iter().for_each(|cable| network.cut(cable));
        network.advance_by(Duration::from_millis(1));
        let mut application = active_in(junctions, network);
        let (mut was_open, mut were_cut_off) = (false, false);
        for _ in 0..8_000 {
            cycles(&mut application, 1);
            let controls = controls(application.links().network());
            were_cut_off |= cut.is_some() && !controls[1..].iter().all(is_open);
            was_open |= controls.iter().any(|control| control.temporary && !is_open(control));
        }
        assert_eq!((was_open, were_cut_off), (is_opened, false), "{junctions}, {cut:?}");
    }
}
