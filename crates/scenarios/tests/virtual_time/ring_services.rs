//! Services in a broken ring: mailboxes, registers, EEPROMs, state changes, SubDevices that lose their power or appear
//! for the first time, start and stop; LRW if it is allowed.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{
    ActivateError, ConfigAddress, Direction, DomainId, DomainMember, Error, Event, LastOutputs, LrwPolicy, MacCodec,
    MainDevice, Options, PdoEntry, PdoMapping, RingState, Scan, SubDeviceConfig, SubDeviceId, SubDeviceState,
    automatic,
};
use ringcat_engine::mail::aoe::{self, AoeRoute};
use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::soe::{self, SoeAddress};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_engine::mail::voe::{self, Voe};
use ringcat_engine::mail::{Limits, Mailbox};
use ringcat_sim::application::aoe::MEMORY;
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{LogicalAddress, Position, RegisterAddress, StationAddress};
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::mailbox::aoe::{AmsAddress, NetId};
use ringcat_wire::mailbox::soe::Idn;
use ringcat_wire::register::map;
use scenarios::check::{Delivery, ring_events, troubles};
use scenarios::segments::{SIXTEEN, cable_of_ring, descriptions, ring, ring_of_16};
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);
const LIMITS: Limits = Limits::new(Duration::from_millis(500), Duration::from_secs(2));
/// The device with all protocols.
const ALL: usize = 2;
const KINDS: [&str; 5] = ["coupler", "digital-input-8", "all-protocols", "servo", "digital-output-8"];
/// Unused RAM of the controller.
const USER_RAM: RegisterAddress = RegisterAddress(0x0F80);

fn segment() -> Network {
    ring(descriptions(&KINDS), NetworkOptions::default().with_detection_delay(FAST))
}

fn pattern(length: usize) -> Vec<u8> {
    (0..length).map(|at| (at * 7 % 253) as u8).collect()
}

/// Every protocol, one after the other.
async fn all_services(mailbox: Mailbox) {
    let (large, data) = (SdoAddress::new(0x2002, 0), pattern(9_000));
    coe::write(&mailbox, large, &data, LIMITS).await.unwrap();
    assert_eq!(coe::read(&mailbox, large, LIMITS, data.len()).await.unwrap(), data);
    let options = FoeOptions::default().with_limits(LIMITS);
    foe::write(&mailbox, "recipe", options, &mut Bytes::new(&data), |_| ()).await.unwrap();
    let mut sink = Bounded::new(data.len());
    foe::read(&mailbox, "recipe", options, &mut sink, |_| ()).await.unwrap();
    assert_eq!(sink.into_bytes(), data);
    let list = soe::read(&mailbox, SoeAddress::value(0, Idn::product(0, 1)), LIMITS, 30_000).await.unwrap();
    assert!(list.len() >= 5000);
    let address = |port| AmsAddress { net_id: NetId([5, 18, 2, 3, 2, 1]), port };
    let route = AoeRoute::new(address(1000), address(0x8000));
    aoe::write(&mailbox, route, (MEMORY, 16), &data[..500], LIMITS).await.unwrap();
    assert_eq!(aoe::read(&mailbox, route, (MEMORY, 16), 500, LIMITS).await.unwrap(), data[..500]);
    let message = Voe { vendor_id: 0x0C47, vendor_type: 1, data: data[..100].to_vec() };
    assert_eq!(voe::exchange(&mailbox, &message, LIMITS).await.unwrap(), message);
}

// covers: CR-08, CR-20, ring-goes-on
#[test]
fn every_mailbox_protocol_works_on_either_side_of_a_break() {
    for cable in 0..=KINDS.len() {
        let mut world = World::in_op(cable as u64, segment());
        world.cut(CableId(cable));
        world.run_cycles(20);
        let mark = world.mark();
        let mailbox = world.mailbox(ALL);
        world.run(all_services(mailbox));
        assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, vec![]), "cable {cable}");
        assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new());
        assert_eq!(world.application().ring(), RingState::Open);
    }
}

// covers: CR-09, CR-10, ring-goes-on
#[test]
fn registers_are_reached_by_station_and_by_position_behind_any_break() {
    let mut world = World::in_op(1, ring_of_16(FAST));
    let count = SIXTEEN.len() as u16;
    for cable in (0..=usize::from(count)).map(Some).chain([None]) {
        if let Some(cable) = cable {
            world.cut(CableId(cable));
            world.run_cycles(10);
        }
        let bus = world.application().engine().bus();
        let stations: Vec<u16> = (0..usize::from(count)).map(|device| world.station_of(device)).collect();
        let marks: Vec<u8> = (0..count as u8).map(|position| position ^ 0xA5).collect();
        let (own, values) = (stations.clone(), marks.clone());
        let seen = world.run(async move {
            // The broadcast shows the number of SubDevices on the main side.
            let counted = bus.brd(map::TYPE, 1).await.unwrap();
            assert_eq!(counted.wkc().0, count);
            let mut seen = Vec::new();
            for position in (0..count).map(Position) {
                let at = usize::from(position.0);
                bus.apwr(position, USER_RAM, &values[at..=at]).await.unwrap();
                let by_position = bus.aprd(position, map::STATION_ADDRESS, 2).await.unwrap();
                let by_station = bus.fprd(StationAddress(own[at]), USER_RAM, 1).await.unwrap();
                seen.push((u16::from_le_bytes([by_position[0], by_position[1]]), by_station[0]));
            }
            seen
        });
        let expected: Vec<(u16, u8)> = stations.iter().copied().zip(marks).collect();
        assert_eq!(seen, expected, "cable {cable:?}");
        if let Some(cable) = cable {
            world.heal(CableId(cable));
            world.run_cycles(60);
        }
    }
}

// covers: CR-17, ring-goes-on
#[test]
fn a_subdevice_power_cycled_on_either_side_is_configured_again() {
    // 7 and 8 are next to the break; the SubDevices behind 3 and 12 return with them.
    for (device, gone) in [(7, 7..8), (8, 8..9), (3, 3..8), (12, 8..13)] {
        let mut world = World::in_op(device as u64, ring_of_16(FAST));
        world.cut(CableId(8));
        world.run_cycles(50);
        let mark = world.mark();
        world.power_off(DeviceIndex(device));
        world.run_cycles(300);
        for subdevice in gone.clone() {
            assert!(
                world.saw(mark, |event| *event == Event::Lost { subdevice: SubDeviceId(subdevice) }),
                "{subdevice} with {device}"
            );
        }
        world.power_on(DeviceIndex(device));
        world
            .until(Duration::from_secs(5), "all in OP", |world| world.all_in_op() && world.application().all_settled());
        world.run_cycles(60);
        assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
        let left: Vec<usize> = world.left_op(mark).iter().map(|device| device.0).collect();
        assert!(left.iter().all(|device| gone.contains(device)), "{left:?} left OP with {device}");
        assert_eq!(world.application().ring_status().place, Some(cable_of_ring(8, 16)));
    }
}

/// An absent analogue input of four channels with known process data.
fn optional_analog_input(position: u16) -> SubDeviceConfig {
    let channel = |channel: u16| {
        let index = 0x6000 + 0x10 * channel;
        PdoMapping::of(0x1A00 + 2 * channel, [PdoEntry::new(index, 1, 16), PdoEntry::new(index, 0x11, 16)])
    };
    let pdos = (0..4).map(channel).collect();
    SubDeviceConfig::at_position(position).optional().assign(3, Direction::Inputs, pdos)
}

// covers: CR-17, CR-21, ring-goes-on
#[test]
fn an_optional_subdevice_joins_on_either_side_of_a_break() {
    // It is the first SubDevice of the redundant side, or the last of the main side: its neighbour across the break is
    // configured at the same time.
    for cable in [2, 3] {
        let kinds = ["coupler", "digital-output-8", "analog-input-4", "servo", "digital-output-16"];
        let mut network = ring(descriptions(&kinds), NetworkOptions::default().with_detection_delay(FAST));
        network.cut(CableId(cable));
        network.power_off(DeviceIndex(2));
        let declare = |scan: &Scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.subdevices[2].address = ConfigAddress::Position(3);
            declaration.subdevices[3].address = ConfigAddress::Position(4);
            declaration.subdevices.insert(2, optional_analog_input(2));
            declaration.domains[0].members.push(DomainMember::new(SubDeviceId(4)));
            declaration
        };
        let mut world = World::with(9, network, &Options::default(), declare).expect("activation");
        world.until(Duration::from_secs(1), "the others settled", |world| world.application().all_settled());
        world.run_cycles(50);
        let mark = world.mark();
        world.power_on(DeviceIndex(2));
        world.until(Duration::from_secs(2), "all in OP", |world| {
            world.all_in_op() && world.application().states()[2] == SubDeviceState::Settled(AlState::Op)
        });
        world.recognise();
        world.run_cycles(50);
        assert_eq!(
            world.evaluated(mark).last().map(|evaluated| evaluated.delivery),
            Some(Delivery::Complete),
            "cable {cable}"
        );
        assert_eq!(world.left_op(mark), [], "cable {cable}");
        world.heal(CableId(cable));
        world.run_cycles(60);
        assert_eq!(world.application().ring(), RingState::Closed);
        assert_eq!(world.left_op(mark), [], "cable {cable}");
    }
}

// covers: CR-19, ring-goes-on
#[test]
fn a_ring_that_is_broken_from_start_to_end_is_started_stopped_and_started_again() {
    for cable in 0..=KINDS.len() {
        let mut network = segment();
        network.cut(CableId(cable));
        let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
        for _ in 0..2 {
            let scan = main_device.scan().expect("a scan");
            assert_eq!((scan.main_count, scan.redundant_count), (cable, KINDS.len() - cable));
            let mut application =
                main_device.activate(automatic(&scan.subdevices, CYCLE)).map_err(Error::from).expect("it fits");
            let until = application.now() + Duration::from_secs(5);
            while !application.all_settled() {
                assert!(application.now() < until, "{:?}", application.states());
                application.cycle(|_| ());
            }
            main_device = application.stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(1)).expect("all stop");
            let network = main_device.links_mut().network();
            assert!(
                network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Init)),
                "cable {cable}"
            );
        }
    }
}

fn with_lrw(scan: &Scan, lrw: LrwPolicy) -> ringcat::Declaration {
    automatic(&scan.subdevices, CYCLE).with_lrw(lrw)
}

// covers: CR-16, 9.2.2, ring-lrw
#[test]
fn an_explicit_lrw_is_refused_on_two_links_and_names_datagram_and_subdevices() {
    let refused = World::with(0, segment(), &Options::default(), |scan| with_lrw(scan, LrwPolicy::Explicit));
    let Err(Error::Activate(error)) = refused else { panic!("it was taken: {refused:?}") };
    let ActivateError::LrwOnTwoLinks { domain, subdevices, length, .. } = &error else { panic!("{error}") };
    assert_eq!((*domain, subdevices.as_slice()), (DomainId(0), &[1, 2, 3, 4].map(SubDeviceId)[..]));
    assert!(*length > 2);
    let text = error.to_string();
    assert!(
        text.starts_with("domain 0: an LRW at logical address 0x00000000 of") && text.contains("[1, 2, 3, 4]"),
        "{text}"
    );
    // On one link LRW is used.
    let line = scenarios::segments::line(descriptions(&KINDS), NetworkOptions::default());
    let mut world =
        World::with(0, line, &Options::default(), |scan| with_lrw(scan, LrwPolicy::Explicit)).expect("one link");
    world.settle();
}

// covers: CR-16, 9.2.2, ring-lrw
#[test]
fn one_lrw_per_subdevice_survives_any_break_and_counts_three_each() {
    let mut world = World::with(1, segment(), &Options::default(), |scan| with_lrw(scan, LrwPolicy::PerSubDevice))
        .expect("allowed");
    world.settle();
    for cable in 0..=KINDS.len() {
        for fault in [ringcat_sim::fault::Fault::Cut(CableId(cable)), ringcat_sim::fault::Fault::Heal(CableId(cable))] {
            world.run_cycles(60);
            let mark = world.mark();
            world.fault_in(CYCLE / 20, fault);
            world.run_cycles(30);
            assert!(world.incomplete(mark) <= 1 && world.left_op(mark).is_empty(), "cable {cable}");
            assert_eq!(world.evaluated(mark).last().map(|evaluated| evaluated.delivery), Some(Delivery::Complete));
        }
    }
    let status = world.evaluated(world.beginning()).last().expect("cycles went by").status;
    // Input 1, all-protocols and servo 3 each with LRW, output 1.
    assert_eq!((status.wkc, status.expected), (8, 8));
    assert!(world.compared() > 0);
}

/// With names from a configuration file.
// covers: CR-16, 9.2.2, ring-lrw
#[test]
fn an_lrw_of_a_file_is_refused_on_two_links_and_one_per_subdevice_is_allowed() {
    let named = |subdevices: &[usize]| {
        ringcat::ExplicitLrw::new(
            format!("frame 1, command {} \"cyclic cmd\"", subdevices[0]),
            LogicalAddress(0x0100_0000),
            12,
            subdevices.iter().copied().map(SubDeviceId).collect(),
        )
    };
    let declare = |explicit_lrw: Vec<ringcat::ExplicitLrw>| {
        move |scan: &Scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.explicit_lrw = explicit_lrw.clone();
            declaration
        }
    };
    let several = || declare(vec![named(&[1]), named(&[2, 3])]);
    let error = World::with(0, segment(), &Options::default(), several()).expect_err("it was taken").to_string();
    let expected = "frame 1, command 2 \"cyclic cmd\": an LRW at logical address 0x01000000 of 12 bytes for \
                    SubDevices [2, 3] cannot be used with two links";
    assert!(error.contains(expected), "{error}");
    // On one link it is allowed.
    let line = scenarios::segments::line(descriptions(&KINDS), NetworkOptions::default());
    World::with(0, line, &Options::default(), several()).expect("one link").settle();
    let mut world =
        World::with(1, segment(), &Options::default(), declare(vec![named(&[1]), named(&[2])])).expect("allowed");
    world.settle();
    let status = world.evaluated(world.beginning()).last().expect("cycles went by").status;
    // As in the test above: LRW counts three each.
    assert_eq!((status.wkc, status.expected), (8, 8));
}

// covers: 9.7.1, ring-merge
#[test]
fn rings_work_with_both_encodings_of_the_source_address() {
    for source_address in [MacCodec::FlagsFirst, MacCodec::IdLast] {
        let options = Options::default().with_source_address(source_address);
        let mut world = World::with(2, ring_of_16(FAST), &options, |scan| automatic(&scan.subdevices, CYCLE)).unwrap();
        world.settle();
        let mark = world.mark();
        // More frames than the range of frame ids, with a break among them.
        world.run_cycles(300);
        world.cut(CableId(5));
        world.run_cycles(300);
        world.heal(CableId(5));
        world.run_cycles(300);
        assert_eq!(ring_events(world.events(mark)).len(), 3, "{source_address:?}");
        assert!(world.incomplete(mark) <= 2 && world.left_op(mark).is_empty());
        let (counters, lost) = (world.application().cyclic_counters(), world.incomplete(mark) as u64);
        assert!(counters.foreign == 0 && counters.lost + counters.half <= lost, "{counters:?}");
    }
}
