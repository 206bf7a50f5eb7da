//! A terminal brought to OP by frames only, and its watchdog, which needs no frame.

use core::time::Duration;

use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::cable::HostLink::{Main, Redundant};
use ringcat_sim::catalogue;
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_wire::address::{LogicalAddress, Position, RegisterAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::Frame;
use ringcat_wire::register::map;

use crate::wiring::{SETTLE, command};

const TERMINAL: DeviceIndex = DeviceIndex(1);
const OUTPUTS: LogicalAddress = LogicalAddress(0x0001_0000);
const MILLISECOND: Duration = Duration::from_millis(1);

/// Writes to the terminal and waits for the returned frame.
fn write(network: &mut Network, register: RegisterAddress, data: &[u8]) {
    let target = Target::Position(Position(TERMINAL.0 as u16), register);
    network.send(Main, &command(Command::Apwr, target, data));
    network.advance_by(SETTLE);
    assert_eq!(wkc(network), Some(1), "{register}");
}

/// Working counter of the next returned frame.
fn wkc(network: &mut Network) -> Option<u16> {
    let received = network.receive(Redundant)?;
    Some(Frame::parse(&received.bytes).unwrap().datagrams().next().unwrap().wkc.0)
}

fn al_status(network: &Network) -> (u16, u16) {
    let device = network.device(TERMINAL);
    (device.al_status().bits(), device.al_status_code().0)
}

/// One cycle of process data; returns the working counter.
fn cycle(network: &mut Network, outputs: u8) -> Option<u16> {
    network.send(Main, &command(Command::Lwr, Target::Logical(OUTPUTS), &[outputs]));
    network.advance_by(MILLISECOND);
    wkc(network)
}

/// A ring of a coupler, a terminal with eight outputs, and a coupler; the terminal in OP.
fn operational() -> Network {
    let devices = ["coupler", "digital-output-8", "coupler"];
    let devices = devices.map(|name| Device::new(catalogue::by_name(name).unwrap()));
    let mut network = SegmentBuilder::ring(devices.to_vec()).build().unwrap();
    network.advance_by(SETTLE);
    write(&mut network, map::AL_CONTROL, &[0x02, 0]);
    assert_eq!(al_status(&network), (0x02, 0));
    // SyncManager 0: 0x1000, one byte, buffered, ECAT writes, PDI event, watchdog, enabled.
    write(&mut network, map::sync_manager(0), &[0x00, 0x10, 0x01, 0x00, 0x64, 0x00, 0x01, 0x00]);
    // FMMU 0: logical 0x10000, one byte, to 0x1000, write, enabled.
    write(&mut network, map::fmmu(0), &[0, 0, 1, 0, 1, 0, 0, 7, 0x00, 0x10, 0, 2, 1, 0, 0, 0]);
    write(&mut network, map::AL_CONTROL, &[0x04, 0]);
    assert_eq!(al_status(&network), (0x04, 0));
    let control = Target::Position(Position(1), map::AL_CONTROL);
    network.send(Main, &command(Command::Apwr, control, &[0x08, 0]));
    network.advance_by(MILLISECOND);
    assert_eq!(wkc(&mut network), Some(1));
    for _ in 0..20 {
        assert_eq!(cycle(&mut network, 0), Some(1));
    }
    assert_eq!(al_status(&network), (0x08, 0));
    network
}

#[test]
fn outputs_written_by_frames_reach_the_terminal() {
    let mut network = operational();
    for outputs in [0x01, 0xA5, 0xFF, 0x00, 0x5A] {
        assert_eq!(cycle(&mut network, outputs), Some(1));
        assert_eq!(network.device(TERMINAL).outputs(), [outputs]);
    }
}

// covers: sim-controller
#[test]
fn without_frames_the_watchdog_takes_the_terminal_to_safeop_after_100_ms() {
    let mut network = operational();
    assert_eq!(cycle(&mut network, 0xFF), Some(1));
    // The last write was slightly less than a cycle ago.
    network.advance_by(98 * MILLISECOND);
    assert_eq!(al_status(&network), (0x08, 0));
    network.advance_by(3 * MILLISECOND);
    assert_eq!(al_status(&network), (0x14, 0x001B));
    assert!(network.device(TERMINAL).outputs().iter().all(|byte| *byte == 0), "the outputs are safe");
}

#[test]
fn next_event_is_the_expiry_of_the_watchdog() {
    let mut network = operational();
    assert_eq!(cycle(&mut network, 0xFF), Some(1));
    let start = network.now();
    while al_status(&network).0 == 0x08 {
        let next = network.next_event().expect("a watchdog runs");
        assert!(next - start < 101 * MILLISECOND);
        network.advance(next);
    }
    assert_eq!(al_status(&network), (0x14, 0x001B));
}

#[test]
fn a_shortened_watchdog_time_that_has_passed_expires_now_and_not_in_the_past() {
    let mut network = operational();
    assert_eq!(cycle(&mut network, 0xFF), Some(1));
    network.advance_by(50 * MILLISECOND);
    // 5 units of 100 us: this time has already passed when the frame arrives.
    let time = Target::Position(Position(1), map::WATCHDOG_TIME_PROCESS_DATA);
    network.send(Main, &command(Command::Apwr, time, &[5, 0]));
    // Time that goes backwards is a failed assertion of the network.
    network.advance_by(MILLISECOND);
    assert_eq!(al_status(&network), (0x14, 0x001B));
}

#[test]
fn a_cut_ring_keeps_the_terminal_in_op() {
    let mut network = operational();
    let cable = network.cable_between(DeviceIndex(0), TERMINAL).unwrap();
    network.cut(cable);
    let mut missed = 0;
    for outputs in 0..200u8 {
        for link in [Main, Redundant] {
            network.send(link, &command(Command::Lwr, Target::Logical(OUTPUTS), &[outputs]));
        }
        network.advance_by(MILLISECOND);
        let counters = [Main, Redundant].map(|link| {
            let received = network.receive(link)?;
            Some(Frame::parse(&received.bytes).unwrap().datagrams().next().unwrap().wkc.0)
        });
        missed += u32::from(counters.iter().flatten().sum::<u16>() != 1);
    }
    assert!(missed <= 1, "{missed} cycles missed");
    assert_eq!(al_status(&network), (0x08, 0));
    assert_eq!(network.device(TERMINAL).outputs(), [199]);
}

// covers: sim-faults
#[test]
fn an_interface_pads_short_frames_so_that_their_writes_take_effect() {
    // APWR 0x1234 to the station address of position 1; some MainDevices leave the padding to the interface, and
    // a veth pair does not pad.
    let short = [
        [0xFF; 6].as_slice(),
        &[0x01; 6],
        &[0x88, 0xA4, 0x0E, 0x10],
        &[0x02, 0x00, 0xFF, 0xFF, 0x10, 0x00, 0x02, 0x00, 0x00, 0x00, 0x34, 0x12, 0x00, 0x00],
    ]
    .concat();
    let mut network = operational();
    network.send(Main, &short);
    network.advance_by(SETTLE);
    let back = network.receive(Redundant).unwrap().bytes;
    assert_eq!((back.len(), &back[28..30]), (60, [1, 0].as_slice()));
    assert_eq!(network.device(TERMINAL).controller.register(map::STATION_ADDRESS, 2), [0x34, 0x12]);
}
