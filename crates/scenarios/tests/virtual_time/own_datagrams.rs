//! Datagrams of the application's own on two links: positions are those of the scan in any state of the ring, and LRW
//! over several SubDevices is refused, declared or sent by the application.

use std::time::Duration;

use ringcat::{
    ActivateError, Declaration, DomainId, DomainMember, Error, Group, JunctionConnection, JunctionMode, LrwPolicy,
    Options, RawDatagram, Scan, SubDeviceConfig, SubDeviceId, automatic,
};
use ringcat_engine::ServiceError;
use ringcat_engine::{BusError, Reply};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{LogicalAddress, Position, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{Fmmu, map};
use scenarios::segments::{MAIN, REDUNDANT, RING_IN_RING, at, descriptions, line, ring, wired};
use scenarios::world::{CYCLE, World};

const LIMIT: Duration = Duration::from_secs(1);
const KINDS: [&str; 5] = ["coupler", "digital-input-8", "servo", "digital-output-8", "digital-input-16"];
/// Unused RAM of the controller.
const USER_RAM: RegisterAddress = RegisterAddress(0x0F80);

fn segment() -> Network {
    ring(descriptions(&KINDS), NetworkOptions::default())
}

fn send(world: &mut World, command: Command, target: Target, data: Vec<u8>) -> Result<Reply, BusError> {
    let datagram = RawDatagram::new(command, target, data).with_resend(true);
    let work = world.application_mut().engine_mut().start_datagrams(vec![datagram]);
    world.finish(LIMIT, work).expect("it is taken").pop().expect("one reply")
}

/// Station address of the SubDevice that responds at a position.
fn station_at(world: &mut World, position: u16) -> Option<u16> {
    let target = Target::Position(Position(position), map::STATION_ADDRESS);
    let reply = send(world, Command::Aprd, target, vec![0; 2]).expect("it comes back");
    assert!(reply.wkc().0 <= 1);
    (reply.wkc() == Wkc(1)).then(|| u16::from_le_bytes([reply.data[0], reply.data[1]]))
}

// covers: CR-09, CR-10, ring-equals-line, sim-frames
#[test]
fn application_positions_are_those_of_the_scan_in_any_ring_state() {
    let mut world = World::in_op(1, segment());
    let stations: Vec<u16> = (0..KINDS.len()).map(|device| world.station_of(device)).collect();
    let all = |world: &mut World, missing: Option<usize>, what: &str| {
        for (position, station) in stations.iter().enumerate() {
            let expected = Some(*station).filter(|_| missing != Some(position));
            assert_eq!(station_at(world, position as u16), expected, "{what}, position {position}");
        }
    };
    all(&mut world, None, "closed");
    // No cycle passes between a cut and the datagram: it must not reach another SubDevice, and is repeated until it
    // arrives.
    for (cut, heal) in [(2, 2), (4, 1), (1, 4), (5, 0), (0, 5)] {
        world.cut(CableId(cut));
        all(&mut world, None, "cut");
        world.heal(CableId(cut));
        world.cut(CableId(heal));
        all(&mut world, None, "healed and cut elsewhere");
        world.heal(CableId(heal));
        world.run_cycles(40);
    }
    world.power_off(DeviceIndex(2));
    world.run_cycles(50);
    all(&mut world, Some(2), "one without power");
    world.power_on(DeviceIndex(2));
    world.until(Duration::from_secs(5), "all in OP", |world| world.all_in_op() && world.application().all_settled());
    all(&mut world, None, "back again");
    assert_eq!(station_at(&mut world, 5), None, "no SubDevice was found there");
}

/// A ring of three junctions and an output. A SubDevice is connected to the first junction, or with its other port to
/// the third one; another one, without power, to the second one.
fn movable() -> Network {
    use ringcat_sim::frame::Port::{A, B, D};
    let kinds = ["junction", "junction", "junction", "digital-output-8", "digital-input-16", "digital-output-16"];
    let cables = [
        (MAIN, at(0, A)),
        (at(0, B), at(1, A)),
        (at(1, B), at(2, A)),
        (at(2, B), at(3, A)),
        (at(3, B), REDUNDANT),
        (at(0, D), at(4, A)),
        (at(2, D), at(4, B)),
        (at(1, D), at(5, A)),
    ];
    let mut network = wired(&kinds, &cables);
    network.cut(CableId(6));
    network.power_off(DeviceIndex(5));
    network
}

/// A SubDevice that was unplugged, moved or is new has the position of the rescan, and no other SubDevice changes its
/// position.
// covers: CR-09, CR-10, CR-17, ring-equals-line, sim-frames
#[test]
fn application_positions_are_those_of_a_rescan_that_updated_the_cabling() {
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[1].optional = true;
        declaration
    };
    let mut world = World::with(6, movable(), &Options::default(), declare).expect("scan and activation");
    world.settle();
    world.evaluate_latched(false);
    let are = |world: &mut World, devices: &[usize], what: &str| {
        // Not before the second junction: a crossed SubDevice is the one unconnected port 0 that a frame may pass.
        for broken in [None, Some(CableId(3)), Some(CableId(4))] {
            broken.iter().for_each(|cable| world.cut(*cable));
            for (position, device) in devices.iter().enumerate() {
                let expected = Some(world.station_of(*device));
                assert_eq!(station_at(world, position as u16), expected, "{what}, {broken:?}, position {position}");
            }
            assert_eq!(station_at(world, devices.len() as u16), None, "{what}, {broken:?}");
            broken.iter().for_each(|cable| world.heal(*cable));
            world.run_cycles(60);
        }
    };
    let rescan = |world: &mut World| {
        let work = world.application_mut().engine_mut().start_rescan(LIMIT);
        let rescan = world.finish(2 * LIMIT, work).expect("it holds still");
        assert!(rescan.is_complete());
        world.run_cycles(20);
    };
    are(&mut world, &[0, 4, 1, 2, 3], "as scanned");
    world.cut(CableId(5));
    world.run_cycles(100);
    rescan(&mut world);
    are(&mut world, &[0, 1, 2, 3], "unplugged");
    world.heal(CableId(6));
    world.until(Duration::from_secs(5), "back", |world| world.application().all_settled());
    world.run_cycles(50);
    rescan(&mut world);
    are(&mut world, &[0, 1, 2, 4, 3], "plugged in elsewhere");
    world.power_on(DeviceIndex(5));
    world.run_cycles(200);
    rescan(&mut world);
    are(&mut world, &[0, 1, 5, 2, 4, 3], "a new SubDevice");
}

fn with_lrw(scan: &Scan) -> Declaration {
    automatic(&scan.subdevices, CYCLE).with_lrw(LrwPolicy::Explicit)
}

fn refused(result: Result<World, Error>) -> (Vec<usize>, String) {
    let Err(Error::Activate(error)) = result else { panic!("it was taken: {result:?}") };
    let text = error.to_string();
    let ActivateError::LrwOnTwoLinks { domain: DomainId(0), subdevices, .. } = error else { panic!("{text}") };
    assert!(text.starts_with("domain 0: an LRW at logical address 0x00000000"), "{text}");
    (subdevices.into_iter().map(|subdevice| subdevice.0).collect(), text)
}

/// Any declaration has to be applied, and is refused there.
// covers: CR-16, 9.2.2, ring-lrw
#[test]
fn declared_lrw_is_refused_with_rings_behind_junctions_and_hot_connect_groups_too() {
    let kinds = ["digital-output-8", "junction", "servo", "digital-input-8", "analog-input-4"];
    let connection = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(3), 1);
    for (junctions, connections) in [(JunctionMode::Strict, &[connection][..]), (JunctionMode::Automatic, &[])] {
        let options = Options::default().with_junctions(junctions);
        let network = wired(&kinds, &RING_IN_RING);
        let result = World::with_junctions(2, network, &options, with_lrw, connections);
        assert_eq!(refused(result).0, [0, 2, 3, 4], "{junctions:?}");
    }
    // An absent group with a place in the process image.
    let scan = World::new(3, line(descriptions(&["digital-output-8"]), NetworkOptions::default()));
    let info = scan.application().engine().subdevices().remove(0);
    let with_group = |scan: &Scan| {
        let mut declaration = with_lrw(scan);
        let head = SubDeviceConfig::at_alias(7, 0);
        let head = head.expect_product(info.identity.vendor_id, info.identity.product_code).pdos_of(&info);
        let members = declaration.add_group(Group::new(head)).members;
        declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
        declaration
    };
    let (subdevices, text) = refused(World::with(4, segment(), &Options::default(), with_group));
    assert!(subdevices == [1, 2, 3, 4, 5] && text.contains("[1, 2, 3, 4, 5]"), "{text}");
}

// covers: CR-16, 9.2.2, ring-lrw
#[test]
fn an_application_lrw_addresses_one_subdevice_on_two_links() {
    let mut world = World::in_op(5, segment());
    let lrw = |logical: u32, length: usize| {
        RawDatagram::new(Command::Lrw, Target::Logical(LogicalAddress(logical)), vec![0; length])
    };
    let work = world.application_mut().engine_mut().start_datagrams(vec![lrw(0, 32)]);
    let error = world.finish(LIMIT, work).expect_err("it covers process data of several");
    let ServiceError::LrwOnTwoLinks { logical: LogicalAddress(0), length: 32, subdevices } = error else {
        panic!("{error}")
    };
    assert!(subdevices[0] != subdevices[1], "{error}");
    // FMMUs written by the application: one on either side of the break.
    let bus = world.application().engine().bus();
    let stations = [1, 4].map(|device| world.station_of(device));
    world.run(async move {
        for (number, station) in (0..).zip(stations) {
            let fmmu = Fmmu {
                logical_start: LogicalAddress(0x7000_0000 + 4 * number),
                length: 4,
                logical_stop_bit: 7,
                physical_start: USER_RAM.0,
                read: true,
                write: true,
                active: true,
                ..Fmmu::default()
            };
            bus.fpwr(StationAddress(station), map::fmmu(7), &fmmu.encode()).await.expect("it has eight FMMUs");
        }
    });
    world.cut(CableId(3));
    world.run_cycles(20);
    let target = |logical: u32| Target::Logical(LogicalAddress(logical));
    let both = send(&mut world, Command::Lrw, target(0x7000_0000), vec![0; 8]);
    assert_eq!(both, Err(BusError::Split { target: target(0x7000_0000) }));
    for logical in [0x7000_0000, 0x7000_0004] {
        let one = send(&mut world, Command::Lrw, target(logical), vec![0; 4]).expect("it comes back");
        assert_eq!(one.wkc(), Wkc(3));
    }
}
