//! An application ends while the redundant link is down on purpose, or while broken rings are examined: what is out of
//! reach on purpose comes back. Checked by carriers and loop settings inside the simulated segment (protocol 2.2, 9.5).

use std::time::Duration;

use ringcat::{
    AlState, Application, Error, JunctionMode, LastOutputs, MainDevice, Options, RingState, SubDeviceState, automatic,
};
use ringcat_sim::cable::{CableId, Endpoint, HostLink};
use ringcat_sim::frame::Port::{A, B};
use ringcat_sim::network::Network;
use ringcat_wire::register::{DlControl, LoopControl, map};
use scenarios::segments::{MAIN, REDUNDANT, TWO_RINGS, at, wired};
use scenarios::tap::Tap;

const LIMIT: Duration = Duration::from_millis(500);
/// A ring of two links.
const THREE: [(Endpoint, Endpoint); 4] =
    [(MAIN, at(0, A)), (at(0, B), at(1, A)), (at(1, B), at(2, A)), (at(2, B), REDUNDANT)];
/// Devices of [`TWO_RINGS`].
const KINDS: [&str; 7] =
    ["junction", "digital-output-8", "servo", "junction", "digital-input-8", "servo", "digital-input-8"];

fn active(main_device: MainDevice<Tap>, cycle: Duration) -> Application<Tap> {
    let declaration = automatic(&main_device.subdevices(), cycle);
    main_device.activate(declaration).map_err(Error::from).expect("it fits")
}

fn scanned(network: Network, options: &Options) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), options);
    main_device.scan().expect("it can be scanned");
    main_device
}

fn cycles(application: &mut Application<Tap>, count: usize) {
    (0..count).for_each(|_| application.cycle(|_| ()));
}

fn all_op(application: &Application<Tap>) -> bool {
    application.states().iter().all(|state| *state == SubDeviceState::Settled(AlState::Op))
}

fn network(application: &mut Application<Tap>) -> &mut Network {
    application.links_mut().network_mut()
}

// covers: crossed-enhanced, stop
#[test]
fn a_link_that_is_down_on_purpose_when_the_application_ends_comes_up_again() {
    let options = Options::default().with_enhanced_line_crossed(true);
    let cycle = Duration::from_millis(1);
    let mut were_down = 0;
    for ran in 0..40 {
        let three = wired(&["coupler", "servo", "digital-output-8"], &THREE);
        let mut application = active(scanned(three, &options), cycle);
        cycles(&mut application, 300);
        network(&mut application).cut(CableId(1));
        cycles(&mut application, 40);
        // After the repair the cabling is checked with the redundant link down.
        network(&mut application).heal(CableId(1));
        cycles(&mut application, ran);
        let was_down = !network(&mut application).carrier(HostLink::Redundant);
        were_down += usize::from(was_down);
        let what = format!("after {ran} cycles, down: {was_down}");
        let ended = application.deactivate(LastOutputs::Zero, LIMIT);
        let mut ended = ended.unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(ended.links_mut().network().carrier(HostLink::Redundant), "{what}");
        assert_eq!(ended.subdevices().len(), 3, "{what}");
        let mut application = active(ended, cycle);
        cycles(&mut application, 500);
        assert!(all_op(&application), "{what}");
        assert_eq!(application.ring(), RingState::Closed, "{what}");
    }
    assert!(were_down > 0, "the link was never down");
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

// covers: junctions, JR-02, stop
#[test]
fn rings_that_are_examined_when_the_application_ends_are_left_with_open_ports() {
    let options = Options::default().with_junctions(JunctionMode::Automatic);
    // The examination of two rings takes several such cycles.
    let cycle = Duration::from_micros(50);
    let mut were_closed = 0;
    let mut begun = active(scanned(wired(&KINDS, &TWO_RINGS), &options), cycle);
    cycles(&mut begun, 40_000);
    assert!(all_op(&begun));
    network(&mut begun).cut(CableId(2));
    network(&mut begun).cut(CableId(6));
    let is_any_closed = |begun: &Application<Tap>| !controls(begun.links().network()).iter().all(is_open);
    let first = (0..2_000).find(|_| {
        cycles(&mut begun, 1);
        is_any_closed(&begun)
    });
    let first = first.expect("the rings were examined");
    for ran in first..first + 4 {
        let mut application = active(scanned(wired(&KINDS, &TWO_RINGS), &options), cycle);
        cycles(&mut application, 40_000);
        network(&mut application).cut(CableId(2));
        network(&mut application).cut(CableId(6));
        cycles(&mut application, ran + 1);
        let was_closed = is_any_closed(&application);
        were_closed += usize::from(was_closed);
        let what = format!("after {ran} cycles, closed: {was_closed}");
        // Frames may not return, and the SubDevices not reach PREOP.
        let mut ended = match application.deactivate(LastOutputs::Held, LIMIT) {
            Ok(ended) => ended,
            Err(refused) => refused.main_device,
        };
        let network = ended.links_mut().network_mut();
        let controls = controls(network);
        assert!(controls.iter().all(is_open), "{what}: {controls:?}");
        network.heal(CableId(2));
        network.heal(CableId(6));
        network.advance_by(Duration::from_millis(5));
        assert_eq!(ended.scan().expect("it is whole").subdevices.len(), KINDS.len(), "{what}");
    }
    assert!(were_closed > 0, "no port was closed");
}
