//! Measures the simulator's time for one hop of a frame over a device of a long line, and for a frame of process data
//! through 50 terminals in OP. The result is the best of several blocks, because other load of the machine only adds
//! time.
//!
//! `cargo run --release -p ringcat-sim --example hops [devices] [frames] [--general]`; `--general` disables the fast
//! path.

use std::time::{Duration, Instant};

use ringcat_sim::cable::HostLink;
use ringcat_sim::catalogue;
use ringcat_sim::device::Device;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::{LogicalAddress, Position, RegisterAddress, StationAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::register::map;

/// Frames sent before the measurement, for warm-up.
const BURST: usize = 8;

/// A frame of one datagram.
fn frame(command: Command, target: Target, length: usize) -> Vec<u8> {
    let mut buffer = vec![0; MAX_FRAME];
    let mut builder =
        FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, MacAddress::default()).expect("room for a frame");
    builder.datagram(command, 0, target, length).expect("room for the datagram");
    let length = builder.finish();
    buffer.truncate(length);
    buffer
}

/// Number of terminals of each kind in the line of process data.
const HALF: usize = 25;
/// Blocks of frames of process data, and frames in each.
const BLOCKS: usize = 20;
const FRAMES: usize = 2_000;

fn write(network: &mut Network, position: usize, register: RegisterAddress, data: &[u8]) {
    let target = Target::Position(Position(position as u16), register);
    exchange(network, &filled(Command::Apwr, target, data));
    network.advance_by(Duration::from_millis(50));
}

fn filled(command: Command, target: Target, data: &[u8]) -> Vec<u8> {
    let mut bytes = frame(command, target, data.len());
    bytes[26..26 + data.len()].copy_from_slice(data);
    bytes
}

/// Sends a frame and takes the response.
fn exchange(network: &mut Network, bytes: &[u8]) {
    network.send(HostLink::Main, bytes);
    network.advance_until_quiet(network.now() + Duration::from_millis(10));
    let received = network.receive(HostLink::Main).expect("the line is closed at its end");
    network.give_back(received.bytes);
}

/// Terminals with eight outputs each, then the same number with eight inputs, in OP: one byte after the other from
/// logical address 0.
fn operational(compiled: bool) -> Network {
    let names = ["digital-output-8", "digital-input-8"];
    let devices = names
        .iter()
        .flat_map(|name| (0..HALF).map(|_| Device::new(catalogue::by_name(name).expect("a device of the catalogue"))));
    let options = NetworkOptions::default().with_compiled(compiled);
    let mut network = SegmentBuilder::line(devices.collect()).options(options).build().expect("a line");
    network.advance_by(Duration::from_millis(50));
    for position in 0..2 * HALF {
        let (control, kind) = if position < HALF { (0x64, 2) } else { (0x20, 1) };
        let place = position as u8;
        write(&mut network, position, map::sync_manager(0), &[0x00, 0x10, 1, 0, control, 0, 1, 0]);
        write(&mut network, position, map::fmmu(0), &[place, 0, 0, 0, 1, 0, 0, 7, 0x00, 0x10, 0, kind, 1, 0, 0, 0]);
    }
    for state in [2, 4, 8] {
        let request = filled(Command::Bwr, Target::Broadcast(map::AL_CONTROL), &[state, 0]);
        exchange(&mut network, &request);
        for _ in 0..40 {
            network.advance_by(Duration::from_millis(1));
            exchange(&mut network, &process_data(0));
        }
    }
    assert!(network.devices().all(|device| device.al_status().bits() == 8), "all are in OP");
    network
}

/// A frame with outputs and inputs in one datagram, and a read of the AL status of all SubDevices.
fn process_data(outputs: u8) -> Vec<u8> {
    let mut buffer = vec![0; MAX_FRAME];
    let mut builder =
        FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, MacAddress::default()).expect("room for a frame");
    let at = builder.datagram(Command::Lrw, 0, Target::Logical(LogicalAddress(0)), 2 * HALF).expect("room");
    builder.datagram(Command::Brd, 0, Target::Broadcast(map::AL_STATUS), 2).expect("room for the datagram");
    builder.data_mut(at, HALF).expect("the datagram exists").fill(outputs);
    let length = builder.finish();
    buffer.truncate(length);
    buffer
}

/// Measures the round trip, and the work of the devices afterwards.
fn measure_process_data(compiled: bool) {
    let mut network = operational(compiled);
    let (mut response, mut reaction) = (f64::INFINITY, f64::INFINITY);
    for block in 0..BLOCKS {
        let bytes = process_data(block as u8);
        let (mut there, mut after) = (Duration::ZERO, Duration::ZERO);
        let mut last = Instant::now();
        for _ in 0..FRAMES {
            network.advance_by(Duration::from_micros(1));
            exchange(&mut network, &bytes);
            let answered = Instant::now();
            network.settle_all();
            there += answered - last;
            last = Instant::now();
            after += last - answered;
        }
        response = response.min(there.as_secs_f64() * 1e6 / FRAMES as f64);
        reaction = reaction.min(after.as_secs_f64() * 1e6 / FRAMES as f64);
    }
    println!(
        "process data of {} terminals: {response:.2} us to the response, {reaction:.2} us of the devices after it",
        2 * HALF
    );
}

fn main() {
    let compiled = !std::env::args().any(|argument| argument == "--general");
    measure_process_data(compiled);
    let numbers = std::env::args().skip(1).filter(|argument| !argument.starts_with("--"));
    let mut arguments = numbers.map(|text| text.parse::<usize>());
    let devices = arguments.next().and_then(Result::ok).unwrap_or(1_000);
    let frames = arguments.next().and_then(Result::ok).unwrap_or(2_000);
    let terminal = catalogue::by_name("digital-output-8").expect("a terminal of the catalogue");
    let line = (0..devices).map(|_| Device::new(terminal.clone())).collect();
    let options = NetworkOptions::default().with_compiled(compiled);
    let mut network = SegmentBuilder::line(line).options(options).build().expect("a line");
    println!("{devices} devices in a line, {frames} frames of each kind");
    for (name, bytes) in [
        ("NOP, 32 bytes", frame(Command::Nop, Target::None, 32)),
        ("FPRD of no SubDevice", frame(Command::Fprd, Target::Station(StationAddress(0xABCD), map::AL_STATUS), 2)),
        ("LRD of nothing mapped, 1400 bytes", frame(Command::Lrd, Target::Logical(LogicalAddress(0)), 1_400)),
        ("BRD of AL status", frame(Command::Brd, Target::Broadcast(map::AL_STATUS), 2)),
    ] {
        let before = network.statistics().hops();
        let start = Instant::now();
        for _ in 0..frames.div_ceil(BURST) {
            for _ in 0..BURST {
                network.send(HostLink::Main, &bytes);
            }
            while network.statistics().link(HostLink::Main).frames_received
                < network.statistics().link(HostLink::Main).frames_sent
            {
                let Some(next) = network.next_event() else { break };
                network.advance(next + Duration::from_micros(100));
            }
            while let Some(received) = network.receive(HostLink::Main) {
                network.give_back(received.bytes);
            }
        }
        let ns = start.elapsed().as_nanos() as f64;
        let hops = network.statistics().hops() - before;
        println!("{name:36} {hops:>9} hops, {:6.1} ns per hop", ns / hops as f64);
    }
}
