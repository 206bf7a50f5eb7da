//! Two SubDevices at one station address: the declared one is identified by written registers, identity and place,
//! never by the order of responses.

use std::time::Duration;

use ringcat::{
    Application, DomainId, DomainState, Event, Freshness, JunctionMode, LastOutputs, MainDevice, Options, SubDeviceId,
    automatic,
};
use ringcat_sim::application::{Behaviour, InputSource};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::frame::Port;
use ringcat_sim::network::Network;
use ringcat_wire::al::AlState;
use ringcat_wire::register::{PortKind, map};
use scenarios::segments::{MAIN, REDUNDANT, at, descriptions, wired_with};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const DOMAIN: DomainId = DomainId(0);

/// Devices with four MII ports each; the inputs of each are its number plus 0xA0. Identical devices have one identity.
fn described(kinds: &[&str], alike: bool) -> Vec<DeviceDescription> {
    let mut described = descriptions(kinds);
    for (number, it) in described.iter_mut().enumerate() {
        it.ports = [PortKind::Mii; 4];
        if !alike {
            it.identity.product_code += 0x1000 * number as u32;
        }
        if let Behaviour::Terminal(source) = &mut it.behaviour {
            *source = InputSource::Constant(vec![0xA0 + number as u8; 2]);
        }
    }
    described
}

fn station(network: &Network, device: usize) -> u16 {
    let bytes = network.device(DeviceIndex(device)).controller.register(map::STATION_ADDRESS, 2);
    u16::from_le_bytes([bytes[0], bytes[1]])
}

fn activated(mut main_device: MainDevice<Tap>, count: usize) -> Application<Tap> {
    let scan = main_device.scan().expect("they are there");
    assert_eq!(scan.subdevices.len(), count);
    let mut application =
        main_device.activate(automatic(&scan.subdevices, CYCLE)).map_err(|it| it.error).expect("it fits");
    (0..1_000).for_each(|_| application.cycle(|_| ()));
    assert!(application.all_settled());
    application
}

/// A session in which the branch behind `cable` is unreachable, after a session in which it was in OP.
fn second_session(
    described: Vec<DeviceDescription>,
    cables: &[(Endpoint, Endpoint)],
    cable: CableId,
) -> Application<Tap> {
    let count = described.len();
    let main_device = MainDevice::request(Tap::new(wired_with(described, cables)), &Options::default());
    let mut application = activated(main_device, count);
    application.links_mut().network_mut().cut(cable);
    let main_device = application.stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(1)).expect("it stops");
    activated(main_device, count - 1)
}

/// The device with a station address of this session keeps it, in OP and with fresh inputs, whether the device of the
/// earlier session comes before or behind it in processing order, and whether or not they are identical.
// covers: identity
#[test]
fn of_two_subdevices_at_one_address_that_of_this_session_keeps_it() {
    let tree = [(MAIN, at(0, Port::A)), (at(0, Port::B), at(1, Port::A)), (at(0, Port::D), at(2, Port::A))];
    let closed = [tree[0], tree[1], tree[2], (at(1, Port::B), REDUNDANT)];
    for (cables, alike, kind) in [
        (&tree[..], false, "digital-input-16"),
        (&tree[..], true, "digital-input-16"),
        (&tree[..], false, "servo"),
        (&tree[..], true, "servo"),
        (&closed[..], false, "digital-input-16"),
        (&closed[..], true, "digital-input-16"),
        (&closed[..], true, "digital-output-8"),
    ] {
        let what = format!("{} cables, alike: {alike}, {kind}", cables.len());
        let mut application = second_session(described(&[kind; 3], alike), cables, CableId(2));
        let network = application.links_mut().network_mut();
        let ours = station(network, 1);
        assert_eq!(ours, station(network, 2), "{what}: the unreachable SubDevice has this address from before");
        while application.pop_event().is_some() {}
        let image = application.exchange().image(DOMAIN).to_vec();
        application.links_mut().network_mut().heal(CableId(2));
        for cycle in 0..5_000 {
            application.cycle(|_| ());
            let network = application.links().network();
            let status = network.device(DeviceIndex(1)).al_status().al_state();
            assert_eq!(status, Some(AlState::Op), "{what}, cycle {cycle}");
            // Frames under way when the other SubDevice appeared, and frames that it processed instead.
            if cycle > 2 {
                let exchange = application.exchange();
                assert_eq!(
                    exchange.freshness(DOMAIN, SubDeviceId(1)) == Freshness::Fresh,
                    kind != "digital-output-8",
                    "{what}"
                );
                assert_eq!(
                    exchange.status(DOMAIN).expect("it is declared").state,
                    DomainState::Complete,
                    "{what}, cycle {cycle}"
                );
                assert_eq!(exchange.image(DOMAIN), image, "{what}, cycle {cycle}");
            }
        }
        let network = application.links().network();
        assert_eq!(station(network, 1), ours, "{what}");
        assert_ne!(station(network, 2), ours, "{what}");
        let other = network.device(DeviceIndex(2));
        assert_eq!(other.al_status().al_state(), Some(AlState::Init), "{what}: it is unassigned");
        let identity = other.description.identity;
        let events: Vec<Event> = core::iter::from_fn(|| application.pop_event()).map(|timed| timed.event).collect();
        let unexpected = |event: &&Event| match event {
            Event::Unexpected { identity: seen, .. } => seen.product_code == identity.product_code,
            _ => false,
        };
        assert_eq!(events.iter().filter(unexpected).count(), 1, "{what}: {events:?}");
        let troubles =
            |event: &&Event| matches!(event, Event::Lost { .. } | Event::Returned { .. } | Event::StateError { .. });
        assert_eq!(events.iter().find(troubles), None, "{what}");
    }
}

/// A write-protected SubDevice with a station address of an earlier session responds while the SubDevice with this
/// address has no power: the address cannot be removed. It is not mistaken for the other one, is checked at growing
/// intervals, and this is reported once. The right SubDevice comes back when the other one is gone.
// covers: identity
#[test]
fn a_held_address_is_reported_once_and_checked_at_growing_intervals() {
    let tree = [(MAIN, at(0, Port::A)), (at(0, Port::B), at(1, Port::A)), (at(0, Port::D), at(2, Port::A))];
    let described = described(&["digital-input-16"; 3], false);
    let mut application =
        activated(MainDevice::request(Tap::new(wired_with(described, &tree)), &Options::default()), 3);
    // In processing order the branch at port D is first: the SubDevice there has the second address.
    let mut protect =
        application.engine_mut().start_register_write(SubDeviceId(1), map::REGISTER_WRITE_PROTECTION, vec![1]);
    (0..10).for_each(|_| application.cycle(|_| ()));
    protect.take().expect("it is done").expect("it is there");
    application.links_mut().network_mut().cut(CableId(2));
    let main_device = application.stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(1)).expect("it stops");
    let mut application = activated(main_device, 2);
    let ours = station(application.links().network(), 1);
    assert_eq!(
        ours,
        station(application.links().network(), 2),
        "the unreachable SubDevice has this address from before"
    );
    application.links_mut().network_mut().power_off(DeviceIndex(1));
    (0..1_000).for_each(|_| application.cycle(|_| ()));
    while application.pop_event().is_some() {}
    let sent = |application: &Application<Tap>| {
        application.links().network().statistics().link(ringcat_sim::cable::HostLink::Main).frames_sent
    };
    application.links_mut().network_mut().heal(CableId(2));
    (0..3_000).for_each(|_| application.cycle(|_| ()));
    assert_eq!(station(application.links().network(), 2), ours, "it cannot give it up");
    let before = sent(&application);
    (0..10_000).for_each(|_| application.cycle(|_| ()));
    let acyclic = sent(&application) - before - 10_000;
    assert!(acyclic < 1_000, "{acyclic} frames in 10 s beside those of process data");
    assert_ne!(application.exchange().freshness(DOMAIN, SubDeviceId(1)), Freshness::Fresh);
    let events: Vec<Event> = core::iter::from_fn(|| application.pop_event()).map(|timed| timed.event).collect();
    let reports = |event: &&Event| match event {
        Event::ConfigurationFailed { subdevice: SubDeviceId(1), reason } => {
            reason.contains("does not give up the address")
        }
        _ => false,
    };
    assert_eq!(events.iter().filter(reports).count(), 1, "{events:?}");
    assert_eq!(events.iter().find(|event| matches!(event, Event::Returned { subdevice: SubDeviceId(1) })), None);
    let network = application.links_mut().network_mut();
    network.cut(CableId(2));
    network.power_on(DeviceIndex(1));
    (0..2_000).for_each(|_| application.cycle(|_| ()));
    assert_eq!(application.exchange().status(DOMAIN).expect("it is declared").state, DomainState::Complete);
    assert_eq!(application.exchange().freshness(DOMAIN, SubDeviceId(1)), Freshness::Fresh);
}

/// Branches of a junction with identical devices without serial numbers: the device on the later branch has its power
/// back first. And a ring behind a junction with two identical first members, the second one reached from the far end
/// while the first has no power.
// covers: identity
#[test]
fn identical_subdevices_return_to_their_places_in_any_order() {
    let branches = [
        (MAIN, at(0, Port::A)),
        (at(0, Port::D), at(1, Port::A)),
        (at(0, Port::B), at(2, Port::A)),
        (at(0, Port::C), at(3, Port::A)),
    ];
    let local_ring = [
        (MAIN, at(0, Port::A)),
        (at(0, Port::D), at(1, Port::A)),
        (at(1, Port::B), at(2, Port::A)),
        (at(2, Port::B), at(3, Port::A)),
        (at(3, Port::B), at(0, Port::B)),
    ];
    for (cables, kind) in [
        (&branches[..], "digital-output-8"),
        (&branches[..], "servo"),
        (&local_ring[..], "digital-output-8"),
        (&local_ring[..], "servo"),
    ] {
        for last in 1..4 {
            let network = wired_with(described(&["junction", kind, kind, kind], true), cables);
            let options = Options::default().with_junctions(JunctionMode::Automatic);
            let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
            let mut world = World::with(7, network, &options, declare).expect("it fits");
            world.settle();
            world.evaluate_latched(false);
            let home: Vec<u16> = (0..4).map(|device| world.station_of(device)).collect();
            let what = format!("{} cables, {kind}, {last} comes last", cables.len());
            (1..4).for_each(|device| world.power_off(DeviceIndex(device)));
            world.run_cycles(300);
            for device in (1..4).filter(|device| *device != last) {
                world.power_on(DeviceIndex(device));
                world.run_cycles(1_500);
            }
            for device in (1..4).filter(|device| *device != last) {
                let here = world.station_of(device);
                assert_eq!(here, home[device], "{what}: device {device}");
            }
            world.power_on(DeviceIndex(last));
            world.run_cycles(1_500);
            let now: Vec<u16> = (0..4).map(|device| world.station_of(device)).collect();
            assert_eq!(now, home, "{what}");
            assert!(world.all_in_op(), "{what}");
        }
    }
}
