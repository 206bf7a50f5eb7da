//! Segments from one line of text, and a frame that records the SubDevices that process it.

use core::time::Duration;

use ringcat_sim::cable::{CableId, CableSpec, DeviceIndex, Endpoint, HostLink};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::device::Device;
use ringcat_sim::frame::Port;
use ringcat_sim::host::Received;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{Frame, FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::register::{PortKind, map};
use ringcat_wire::sii::Identity;

/// Longer than the loading of any EEPROM and the path of any frame here.
pub const SETTLE: Duration = Duration::from_millis(50);
/// Delay of all cables here.
pub const CABLE: Duration = Duration::from_nanos(100);

/// Device `number` (from 1) of a test: four ports, no process data, its number as alias.
pub fn device(number: usize) -> Device {
    let mut description = DeviceDescription::plain(&format!("S{number}"), Identity::default());
    description.ports = [PortKind::Mii; 4];
    description.alias = number as u16;
    Device::new(description)
}

/// "main", "red" or "device.port" with devices from 1.
pub fn endpoint(text: &str) -> Endpoint {
    match text {
        "main" => Endpoint::Host(HostLink::Main),
        "red" => Endpoint::Host(HostLink::Redundant),
        _ => {
            let (device, port) = text.split_once('.').unwrap();
            let port = Port::from_index(port.parse().unwrap()).unwrap();
            Endpoint::Device(DeviceIndex(device.parse::<usize>().unwrap() - 1), port)
        }
    }
}

/// A segment from cables such as "main-1.0 1.1-2.0 2.1-red", with EEPROMs loaded.
pub fn segment(cables: &str) -> Network {
    segment_with(cables, NetworkOptions::default())
}

/// As [`segment`], with options.
pub fn segment_with(cables: &str, options: NetworkOptions) -> Network {
    let specs: Vec<CableSpec> = cables
        .split_whitespace()
        .map(|cable| {
            let (a, b) = cable.split_once('-').unwrap();
            CableSpec { a: endpoint(a), b: endpoint(b), delay: CABLE }
        })
        .collect();
    build(specs, options)
}

/// A segment with as many devices as the cables name, with EEPROMs loaded.
pub fn build(cables: Vec<CableSpec>, options: NetworkOptions) -> Network {
    let devices = cables.iter().flat_map(|cable| [cable.a, cable.b]).map(|endpoint| match endpoint {
        Endpoint::Device(device, _) => device.0 + 1,
        Endpoint::Host(_) => 0,
    });
    let count = devices.max().unwrap_or(0);
    let mut network = Network::new((1..=count).map(device).collect(), cables, options).unwrap();
    network.advance_by(SETTLE);
    network
}

/// A straight ring of `count` devices as text.
pub fn ring(count: usize) -> String {
    let inner: Vec<String> = (1..count).map(|number| format!("{number}.1-{}.0", number + 1)).collect();
    format!("main-1.0 {} {count}.1-red", inner.join(" "))
}

/// Cuts the cable at `place` and waits for its detection.
pub fn cut(network: &mut Network, place: &str) -> CableId {
    let cable = network.cable_at(endpoint(place)).unwrap();
    network.cut(cable);
    network.advance_by(SETTLE);
    cable
}

/// Result of a probe frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Journey {
    /// Interface at which it returned.
    pub back_on: HostLink,
    /// Aliases of the devices in the order in which they processed the frame.
    pub processed_by: Vec<u16>,
    /// First byte of the source address: 0x08 sent on the redundant link, 0x02 processed (protocol 9.7.1).
    pub flags: u8,
    /// C bit.
    pub circulating: bool,
}

/// A journey from numbers.
pub fn journey(back_on: HostLink, processed_by: &[u16], flags: u8, circulating: bool) -> Option<Journey> {
    Some(Journey { back_on, processed_by: processed_by.to_vec(), flags, circulating })
}

/// A frame that counts processing units and reads the alias of the first `places` of them.
pub fn probe(link: HostLink, places: u16) -> Vec<u8> {
    let flags = if link == HostLink::Redundant { 0x08 } else { 0 };
    let mut buffer = vec![0; MAX_FRAME];
    let source = MacAddress([flags, 0, 0, 0, 0, 1]);
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, source).unwrap();
    builder.datagram(Command::Brd, 0, Target::Broadcast(map::TYPE), 1).unwrap();
    for place in 0..places {
        builder.datagram(Command::Aprd, 1, Target::Position(Position(place), map::STATION_ALIAS), 2).unwrap();
    }
    let length = builder.finish();
    buffer.truncate(length);
    buffer
}

/// Decodes a returned probe.
pub fn read(back_on: HostLink, received: &Received) -> Journey {
    let frame = Frame::parse(&received.bytes).unwrap();
    let mut datagrams = frame.datagrams();
    let count = datagrams.next().unwrap();
    let processed_by: Vec<u16> = datagrams
        .take_while(|datagram| datagram.wkc.0 == 1)
        .map(|datagram| u16::from_le_bytes([datagram.data[0], datagram.data[1]]))
        .collect();
    assert_eq!(
        (count.header.adp(), count.wkc.0),
        (processed_by.len() as u16, processed_by.len() as u16),
        "ADP and working counter are equal"
    );
    Journey { back_on, processed_by, flags: received.bytes[6], circulating: count.header.circulating }
}

/// Sends a probe and waits for its return; `None` if it is lost.
pub fn travel(network: &mut Network, link: HostLink) -> Option<Journey> {
    let places = network.devices().len() as u16 + 1;
    network.send(link, &probe(link, places));
    network.advance_by(SETTLE);
    let mut journeys = HostLink::ALL.iter().filter_map(|link| Some(read(*link, &network.receive(*link)?)));
    let journey = journeys.next();
    assert_eq!(journeys.next(), None, "one frame does not return twice");
    journey
}

/// A frame with a single datagram.
pub fn command(command: Command, target: Target, data: &[u8]) -> Vec<u8> {
    let mut buffer = vec![0; MAX_FRAME];
    let source = MacAddress([0, 0, 0, 0, 0, 1]);
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, source).unwrap();
    let at = builder.datagram(command, 0, target, data.len()).unwrap();
    builder.data_mut(at, data.len()).unwrap().copy_from_slice(data);
    let length = builder.finish();
    buffer.truncate(length);
    buffer
}

/// A broadcast read of one register in the shortest frame.
pub fn shortest() -> Vec<u8> {
    command(Command::Brd, Target::Broadcast(RegisterAddress(0)), &[0])
}
