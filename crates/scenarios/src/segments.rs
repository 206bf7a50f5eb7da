//! Segments of the scenarios, from the simulator's catalogue.

use std::time::Duration;

use ringcat::{Cable, PortOf, Position};
use ringcat_sim::cable::{DeviceIndex, Endpoint, HostLink};
use ringcat_sim::catalogue;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::device::Device;
use ringcat_sim::frame::Port;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};

/// End of the cable at the main interface.
pub const MAIN: Endpoint = Endpoint::Host(HostLink::Main);
/// End of the cable at the redundant interface.
pub const REDUNDANT: Endpoint = Endpoint::Host(HostLink::Redundant);

/// Sixteen SubDevices of all kinds, as in the demonstration.
pub const SIXTEEN: [&str; 16] = [
    "coupler",
    "digital-input-8",
    "digital-output-8",
    "analog-input-4",
    "servo",
    "digital-input-16",
    "digital-output-16",
    "analog-output-4",
    "emulated-input-8",
    "emulated-output-8",
    "junction",
    "digital-input-4",
    "digital-output-4",
    "block",
    "analog-input-4",
    "servo",
];

/// A device of the catalogue.
///
/// # Panics
/// When the catalogue has no such device.
pub fn describe(kind: &str, name: &str) -> DeviceDescription {
    let mut description = catalogue::by_name(kind).unwrap_or_else(|| panic!("no device \"{kind}\" in the catalogue"));
    description.name = name.into();
    description
}

/// Descriptions of these kinds, numbered. Clocks start at different times, as those of real devices do.
pub fn descriptions(kinds: &[&str]) -> Vec<DeviceDescription> {
    let numbered = kinds.iter().enumerate();
    numbered
        .map(|(number, kind)| {
            let mut description = describe(kind, &format!("{kind}-{number}"));
            description.clock_start_ns = 0x1234_5678_9ABC * (number as u64 + 1);
            description
        })
        .collect()
}

/// Devices from descriptions.
pub fn devices(descriptions: Vec<DeviceDescription>) -> Vec<Device> {
    descriptions.into_iter().map(Device::new).collect()
}

/// A port of a device.
pub const fn at(device: usize, port: Port) -> Endpoint {
    Endpoint::Device(DeviceIndex(device), port)
}

/// Devices of these kinds with these cables, in the order of their numbers.
///
/// # Panics
/// When the cables do not fit.
pub fn wired(kinds: &[&str], cables: &[(Endpoint, Endpoint)]) -> Network {
    wired_with(descriptions(kinds), cables)
}

/// As [`wired`], from descriptions.
///
/// # Panics
/// When the cables do not fit.
pub fn wired_with(descriptions: Vec<DeviceDescription>, cables: &[(Endpoint, Endpoint)]) -> Network {
    let builder = devices(descriptions).into_iter().fold(SegmentBuilder::new(), SegmentBuilder::device);
    let builder = cables.iter().fold(builder, |builder, (a, b)| builder.cable(*a, *b));
    builder.options(NetworkOptions::default()).build().expect("the cables fit")
}

/// One device, a junction with a ring of three from port 3 to port 1, and two more devices on its port 2. The ring's
/// cables are [`RING_OF_THREE`], the last one is the closing cable.
pub const RING_BEHIND_JUNCTION: [(Endpoint, Endpoint); 8] = [
    (MAIN, at(0, Port::A)),
    (at(0, Port::B), at(1, Port::A)),
    (at(1, Port::D), at(2, Port::A)),
    (at(2, Port::B), at(3, Port::A)),
    (at(3, Port::B), at(4, Port::A)),
    (at(4, Port::B), at(1, Port::B)),
    (at(1, Port::C), at(5, Port::A)),
    (at(5, Port::B), at(6, Port::A)),
];
/// Cables of the ring in [`RING_BEHIND_JUNCTION`].
pub const RING_OF_THREE: [usize; 4] = [2, 3, 4, 5];

/// Two junctions in a row, 0 and 3, each with a ring of two behind it, and one more device behind both. Cables 1 to 3
/// belong to the first ring, 5 to 7 to the second one.
pub const TWO_RINGS: [(Endpoint, Endpoint); 9] = [
    (MAIN, at(0, Port::A)),
    (at(0, Port::D), at(1, Port::A)),
    (at(1, Port::B), at(2, Port::A)),
    (at(2, Port::B), at(0, Port::B)),
    (at(0, Port::C), at(3, Port::A)),
    (at(3, Port::D), at(4, Port::A)),
    (at(4, Port::B), at(5, Port::A)),
    (at(5, Port::B), at(3, Port::B)),
    (at(3, Port::C), at(6, Port::A)),
];

/// A ring of two links, with a local ring behind the junction in its middle, device 1. Members of the local ring are 2
/// and 3, its cables are 2 to 4.
pub const RING_IN_RING: [(Endpoint, Endpoint); 7] = [
    (MAIN, at(0, Port::A)),
    (at(0, Port::B), at(1, Port::A)),
    (at(1, Port::D), at(2, Port::A)),
    (at(2, Port::B), at(3, Port::A)),
    (at(3, Port::B), at(1, Port::B)),
    (at(1, Port::C), at(4, Port::A)),
    (at(4, Port::B), REDUNDANT),
];

/// A closed ring: cable 0 from the main link, cable `n` between devices `n - 1` and `n`, the last to the redundant
/// link.
///
/// # Panics
/// When the segment cannot be built.
pub fn ring(descriptions: Vec<DeviceDescription>, options: NetworkOptions) -> Network {
    SegmentBuilder::ring(devices(descriptions)).options(options).build().expect("a ring can be built")
}

/// A line on the main link.
///
/// # Panics
/// When the segment cannot be built.
pub fn line(descriptions: Vec<DeviceDescription>, options: NetworkOptions) -> Network {
    SegmentBuilder::line(devices(descriptions)).options(options).build().expect("a line can be built")
}

/// A cable of a straight [`ring`] of `count` SubDevices, as the engine names it.
pub fn cable_of_ring(cable: usize, count: usize) -> Cable {
    Cable {
        near: cable.checked_sub(1).map(|node| PortOf::new(Position(node as u16), 1)),
        far: (cable < count).then_some(PortOf::new(Position(cable as u16), 0)),
    }
}

/// The ring of [`SIXTEEN`] with a detection delay.
pub fn ring_of_16(detection: Duration) -> Network {
    ring(descriptions(&SIXTEEN), NetworkOptions::default().with_detection_delay(detection))
}

/// The line of 1, 10 or 50 SubDevices for measurements of start-ups: outputs, inputs and servos behind a coupler.
///
/// # Panics
/// For other numbers.
pub fn plant(count: usize) -> Network {
    let (couplers, outputs, inputs, servos) = match count {
        1 => (0, 1, 0, 0),
        10 => (0, 5, 5, 0),
        50 => (1, 20, 20, 9),
        other => panic!("no plant of {other} SubDevices"),
    };
    let parts = [("coupler", couplers), ("digital-output-8", outputs), ("digital-input-8", inputs), ("servo", servos)];
    let kinds: Vec<&str> = parts.iter().flat_map(|(kind, count)| std::iter::repeat_n(*kind, *count)).collect();
    line(descriptions(&kinds), NetworkOptions::default())
}

/// A line of servo drives, as on a machine with many axes: their SIIs are long, and all but the names are equal.
pub fn drives(count: usize) -> Network {
    line(descriptions(&vec!["servo"; count]), NetworkOptions::default())
}
