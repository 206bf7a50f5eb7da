//! The fast path gives the same results as hop by hop: two segments, one of each kind, with the same actions.

use core::time::Duration;

use proptest::prelude::*;
use ringcat_sim::cable::{CableId, DeviceIndex, Direction, HostLink};
use ringcat_sim::catalogue;
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{LogicalAddress, Position, RegisterAddress, StationAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::register::map;

use crate::wiring::{SETTLE, command};

const KINDS: [&str; 7] = [
    "digital-output-8",
    "digital-input-8",
    "emulated-output-8",
    "analog-input-4",
    "analog-output-4",
    "servo",
    "coupler",
];
const ADDRESS_SPACE: usize = 0x1_0000;
/// End of the addresses that devices use.
const USED: usize = 0x2000;

/// An action on a segment.
#[derive(Clone, Debug)]
enum Action {
    /// Sends a frame of these datagrams on a link, or on both.
    Send(Option<HostLink>, Vec<(Kind, u16, u16)>),
    /// Writes a register of a device.
    Write(u16, u16, Vec<u8>),
    Advance(u64),
    UntilReceived(u64),
    Leap(u64),
    Settle,
    Fault(Fault),
    FaultIn(u64, Fault),
}

/// A datagram; the numbers that follow it are address and length.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Lrd,
    Lwr,
    Lrw,
    Brd,
    Aprd,
    Fprd,
    Frmw,
    Bwr,
}

fn frame(datagrams: &[(Kind, u16, u16)], seed: u8) -> Vec<u8> {
    let mut buffer = vec![0; MAX_FRAME];
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, MacAddress::default()).unwrap();
    for (number, &(kind, address, length)) in datagrams.iter().enumerate() {
        let logical = Target::Logical(LogicalAddress(u32::from(address % 48)));
        let register = RegisterAddress(if address % 3 == 0 { 0x0130 } else { address % 0x1100 });
        let (command, target) = match kind {
            Kind::Lrd => (Command::Lrd, logical),
            Kind::Lwr => (Command::Lwr, logical),
            Kind::Lrw => (Command::Lrw, logical),
            Kind::Brd => (Command::Brd, Target::Broadcast(register)),
            Kind::Aprd => (Command::Aprd, Target::Position(Position(address % 8), register)),
            Kind::Fprd => (Command::Fprd, Target::Station(StationAddress(address % 8), register)),
            Kind::Frmw => (Command::Frmw, Target::Station(StationAddress(1), map::DC_SYSTEM_TIME)),
            Kind::Bwr => (Command::Bwr, Target::Broadcast(RegisterAddress(0x1100 + address % 64))),
        };
        let length = usize::from(length % 70);
        let Some(at) = builder.datagram(command, 0, target, length) else { break };
        for (place, byte) in builder.data_mut(at, length).unwrap().iter_mut().enumerate() {
            *byte = seed.wrapping_mul(37).wrapping_add((number * 11 + place) as u8);
        }
    }
    let length = builder.finish();
    buffer.truncate(length);
    buffer
}

fn faults(devices: usize) -> impl Strategy<Value = Fault> {
    let cable = (0..devices).prop_map(CableId);
    let device = (0..devices).prop_map(DeviceIndex);
    let direction = prop_oneof![Just(None), Just(Some(Direction::AToB)), Just(Some(Direction::BToA))];
    let by = Duration::from_nanos(9_137);
    prop_oneof![
        3 => cable.clone().prop_map(Fault::Cut),
        4 => cable.clone().prop_map(Fault::Heal),
        1 => (cable.clone(), direction.clone())
            .prop_map(|(cable, direction)| Fault::Drop { cable, direction, count: 1 }),
        1 => (cable.clone(), direction.clone())
            .prop_map(|(cable, direction)| Fault::Duplicate { cable, direction, count: 1 }),
        1 => (cable.clone(), direction.clone())
            .prop_map(|(cable, direction)| Fault::Corrupt { cable, direction, count: 1 }),
        1 => (cable, direction).prop_map(move |(cable, direction)| Fault::Delay { cable, direction, count: 1, by }),
        1 => device.clone().prop_map(Fault::PowerOff),
        1 => device.clone().prop_map(Fault::PowerOn),
        1 => (device, any::<bool>()).prop_map(|(device, hanging)| Fault::Hang(device, hanging)),
    ]
}

fn actions(devices: usize) -> impl Strategy<Value = Vec<Action>> {
    use Kind::{Aprd, Brd, Bwr, Fprd, Frmw, Lrd, Lrw, Lwr};
    let link = prop_oneof![Just(None), Just(Some(HostLink::Main)), Just(Some(HostLink::Redundant))];
    let kind = prop::sample::select(&[Lrd, Lwr, Lrw, Lrw, Lrw, Brd, Aprd, Fprd, Frmw, Bwr][..]);
    // Usual frames are equal, so that precomputed results are reused.
    let usual = Just(vec![(Lrw, 0, 48), (Brd, 0, 2)]);
    let datagrams = prop_oneof![3 => usual, 2 => prop::collection::vec((kind, any::<u16>(), any::<u16>()), 1..4)];
    let register = prop::sample::select(
        &[0x0100u16, 0x0101, 0x0120, 0x0400, 0x0420, 0x0600, 0x0610, 0x0800, 0x0806, 0x0900, 0x0040][..],
    );
    let value = prop_oneof![prop::collection::vec(any::<u8>(), 1..3), Just(vec![2]), Just(vec![8]), Just(vec![1, 4])];
    let time = prop_oneof![0u64..3_000, 0u64..60_000, Just(1_000_000), Just(120_000_000)];
    let action = prop_oneof![
        10 => (link, datagrams).prop_map(|(link, datagrams)| Action::Send(link, datagrams)),
        1 => (0..devices as u16, register, value)
            .prop_map(|(device, register, data)| Action::Write(device, register, data)),
        4 => time.clone().prop_map(Action::Advance),
        4 => time.clone().prop_map(Action::UntilReceived),
        2 => time.clone().prop_map(Action::Leap),
        1 => Just(Action::Settle),
        1 => faults(devices).prop_map(Action::Fault),
        1 => (time, faults(devices)).prop_map(|(time, fault)| Action::FaultIn(time, fault)),
    ];
    prop::collection::vec(action, 10..60)
}

/// A segment of devices with process data in the logical bytes 0 to 47, if they accept it.
fn segment(kinds: &[usize], ring: bool, compiled: bool) -> Network {
    let devices = kinds.iter().map(|kind| Device::new(catalogue::by_name(KINDS[*kind]).unwrap())).collect();
    let builder = if ring { SegmentBuilder::ring(devices) } else { SegmentBuilder::line(devices) };
    let mut network = builder.options(NetworkOptions::default().with_compiled(compiled).with_seed(5)).build().unwrap();
    network.advance_by(SETTLE);
    for position in 0..kinds.len() {
        let place = Position(position as u16);
        let entries = network.device(DeviceIndex(position)).description.sync_managers.clone();
        let mut write = |register: RegisterAddress, data: &[u8]| {
            network.send(HostLink::Main, &command(Command::Apwr, Target::Position(place, register), data));
            network.advance_by(Duration::from_micros(200));
        };
        write(map::STATION_ADDRESS, &[position as u8, 0]);
        for (number, entry) in (0..).zip(&entries) {
            let (start, length) = (entry.start.to_le_bytes(), entry.length.to_le_bytes());
            write(map::sync_manager(number), &[start[0], start[1], length[0], length[1], entry.control, 0, 1, 0]);
            // Consecutive addresses for process data: outputs 4 bytes apart, inputs the same, in halves.
            let logical = position as u8 * 4 % 24 + if entry.control & 4 == 0 { 24 } else { 0 };
            let kind = if entry.control & 4 == 0 { 1 } else { 2 };
            if number == 0 || number > 1 {
                let fmmu = [logical, 0, 0, 0, length[0].clamp(1, 4), 0, 0, 7, start[0], start[1], 0, kind, 1, 0, 0, 0];
                write(map::fmmu(number), &fmmu);
            }
        }
    }
    for state in [2, 4, 8] {
        network.send(HostLink::Main, &command(Command::Bwr, Target::Broadcast(map::AL_CONTROL), &[state, 0]));
        for cycle in 0..30 {
            network.advance_by(Duration::from_millis(1));
            network.send(HostLink::Main, &frame(&[(Kind::Lrw, 0, 48)], cycle));
        }
    }
    network.advance_by(Duration::from_millis(1));
    network
}

fn act(network: &mut Network, action: &Action, number: u8) {
    match action {
        Action::Send(link, datagrams) => {
            let bytes = frame(datagrams, number);
            HostLink::ALL.into_iter().filter(|one| link.is_none_or(|link| link == *one)).for_each(|link| {
                network.send(link, &bytes);
            });
        }
        Action::Write(device, register, data) => {
            let target = Target::Position(Position(*device), RegisterAddress(*register));
            network.send(HostLink::Main, &command(Command::Apwr, target, data));
        }
        Action::Advance(ns) => network.advance_by(Duration::from_nanos(*ns)),
        Action::UntilReceived(ns) => network.advance_until_received(network.now() + Duration::from_nanos(*ns)),
        Action::Leap(ns) => network.advance_until_quiet(network.now() + Duration::from_nanos(*ns)),
        Action::Settle => network.settle_all(),
        Action::Fault(fault) => network.apply(fault.clone()),
        Action::FaultIn(ns, fault) => network.schedule(network.now() + Duration::from_nanos(*ns), fault.clone()),
    }
}

/// Compares all observable properties of two segments.
fn compare(one: &mut Network, other: &mut Network, memory: usize) -> Result<(), TestCaseError> {
    prop_assert_eq!(one.now(), other.now());
    prop_assert_eq!(one.statistics(), other.statistics());
    for link in HostLink::ALL {
        prop_assert_eq!(one.carrier(link), other.carrier(link));
        prop_assert_eq!(one.receive(link), other.receive(link));
    }
    for (number, (one, other)) in one.devices().zip(other.devices()).enumerate() {
        let bytes = [one, other].map(|device| device.controller.register(RegisterAddress(0), memory));
        if bytes[0] != bytes[1] {
            let differs = bytes[0].iter().zip(bytes[1]).position(|(one, other)| one != other);
            prop_assert_eq!(differs, None, "memory of device {}", number);
        }
        prop_assert_eq!(one.outputs(), other.outputs());
        prop_assert_eq!(one.inputs(), other.inputs());
        prop_assert_eq!(one.outputs_latched(), other.outputs_latched());
        prop_assert_eq!(one.next_deadline(), other.next_deadline());
    }
    Ok(())
}

fn runs() -> impl Strategy<Value = (Vec<usize>, bool, Vec<Action>)> {
    (prop::collection::vec(0..KINDS.len(), 2..7), any::<bool>())
        .prop_flat_map(|(kinds, ring)| (Just(kinds.clone()), Just(ring), actions(kinds.len())))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    // covers: sim-interfaces
    #[test]
    fn fast_path_and_hops_give_the_same_results((kinds, ring, actions) in runs()) {
        let mut fast = segment(&kinds, ring, true);
        let mut hops = segment(&kinds, ring, false);
        compare(&mut fast, &mut hops, ADDRESS_SPACE)?;
        for (number, action) in actions.iter().enumerate() {
            act(&mut fast, action, number as u8);
            act(&mut hops, action, number as u8);
            compare(&mut fast, &mut hops, USED)?;
        }
        for network in [&mut fast, &mut hops] {
            network.advance_by(Duration::from_millis(1));
        }
        compare(&mut fast, &mut hops, ADDRESS_SPACE)?;
    }
}
