//! Receive times across a tree: the numeric vector of protocol 7.1.

use core::time::Duration;

use ringcat_sim::cable::HostLink::Main;
use ringcat_sim::cable::{CableSpec, DeviceIndex};
use ringcat_sim::description::{DcDescription, DeviceDescription};
use ringcat_sim::device::Device;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{PortKind, map};
use ringcat_wire::sii::Identity;
use ringcat_wire::time::DcTime32;

use crate::wiring::{SETTLE, command, endpoint};

/// The tree of protocol 7.1: every pass takes 300 ns; each cable has the given delay.
const CABLES: [(&str, &str, u64); 7] = [
    ("main", "1.0", 50),
    ("1.1", "2.0", 100),
    ("2.3", "5.0", 70),
    ("5.1", "6.0", 60),
    ("2.1", "3.0", 120),
    ("3.1", "4.0", 90),
    ("1.2", "7.0", 200),
];

fn tree(clock_start_ns: impl Fn(usize) -> u64) -> Network {
    let devices = (1..=7).map(|number| {
        let mut description = DeviceDescription::plain(&format!("S{number}"), Identity::default());
        description.ports = [PortKind::Mii; 4];
        description.dc = Some(DcDescription { wide: true, modes: Vec::new(), minimum_cycle_ns: 0 });
        description.clock_start_ns = clock_start_ns(number);
        Device::new(description)
    });
    let cables =
        CABLES.map(|(a, b, delay)| CableSpec { a: endpoint(a), b: endpoint(b), delay: Duration::from_nanos(delay) });
    let options = NetworkOptions::default().with_hop_delay(Duration::from_nanos(300));
    let mut network = Network::new(devices.collect(), cables.to_vec(), options).unwrap();
    network.advance_by(SETTLE);
    network
}

/// Makes all devices latch their receive times.
fn latch(network: &mut Network) {
    network.send(Main, &command(Command::Bwr, Target::Broadcast(map::DC_RECEIVE_TIME), &[0; 4]));
    network.advance_by(SETTLE);
    assert!(network.receive(Main).is_some());
}

/// A device's receive time at a port.
fn receive_time(network: &Network, number: usize, port: u16) -> DcTime32 {
    let address = RegisterAddress(map::DC_RECEIVE_TIME.0 + 4 * port);
    let bytes = network.device(DeviceIndex(number - 1)).controller.register(address, 4);
    DcTime32(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}

fn check(network: &mut Network) {
    latch(network);
    for (device, port, expected) in EXPECTED {
        let after_port_0 = receive_time(network, device, port).since(receive_time(network, device, 0));
        assert_eq!(after_port_0, expected, "device {device}, port {port}");
    }
}

/// Device, port, time relative to its own port 0.
const EXPECTED: [(usize, u16, i32); 6] =
    [(1, 1, 3_880), (1, 2, 4_880), (2, 3, 1_460), (2, 1, 3_080), (5, 1, 720), (3, 1, 780)];

// covers: sim-clocks
#[test]
fn receive_times_match_the_model() {
    check(&mut tree(|_| 0));
}

// covers: sim-clocks
#[test]
fn receive_times_are_correct_if_a_clock_wraps_between_two_ports() {
    // Time at which the first bit reaches devices 2 and 3.
    let first_bit_at_2 = SETTLE.as_nanos() as u64 + 50 + 300 + 100;
    let first_bit_at_3 = first_bit_at_2 + 300 + 1_160 + 300 + 120;
    let mut network = tree(|number| match number {
        2 => 0xFFFF_F800 - first_bit_at_2,
        3 => 0xFFFF_FF00 - first_bit_at_3,
        _ => 0,
    });
    check(&mut network);
    let at = |number, port| receive_time(&network, number, port).0;
    assert_eq!((at(2, 0), at(2, 1)), (0xFFFF_F800, 0x0000_0408));
    assert_eq!((at(3, 0), at(3, 1)), (0xFFFF_FF00, 0x0000_020C));
}
