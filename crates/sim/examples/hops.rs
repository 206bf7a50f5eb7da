//! Prints how long the simulator takes for a hop of a frame over a device of a long line.
//!
//! `cargo run --release -p ringcat-sim --example hops [devices] [frames]`

use std::time::Instant;

use ringcat_sim::cable::HostLink;
use ringcat_sim::catalogue;
use ringcat_sim::device::Device;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_wire::address::{LogicalAddress, StationAddress};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MacAddress};
use ringcat_wire::register::map;

/// Frames that are sent before the line is let run.
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

fn main() {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<usize>());
    let devices = arguments.next().and_then(Result::ok).unwrap_or(1_000);
    let frames = arguments.next().and_then(Result::ok).unwrap_or(2_000);
    let terminal = catalogue::by_name("digital-output-8").expect("a terminal of the catalogue");
    let line = (0..devices).map(|_| Device::new(terminal.clone())).collect();
    let mut network = SegmentBuilder::line(line).build().expect("a line");
    println!("{devices} devices in a line, {frames} frames of each kind");
    for (name, bytes) in [
        ("NOP, 32 bytes", frame(Command::Nop, Target::None, 32)),
        ("FPRD of nobody", frame(Command::Fprd, Target::Station(StationAddress(0xABCD), map::AL_STATUS), 2)),
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
                network.advance(next + std::time::Duration::from_micros(100));
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
