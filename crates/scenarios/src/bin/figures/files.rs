//! A file of 1 MiB through the mailbox of one SubDevice in virtual time: time and round trips per packet, and
//! their independence of the application's cycle.
//!
//! The SubDevice responds at once, or after 200 us. Process data of the whole segment is exchanged meanwhile.

use std::process::ExitCode;
use std::time::Duration;

use ringcat::{Options, Scan, automatic};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::stream::Bytes;
use ringcat_sim::network::NetworkOptions;
use scenarios::figures::{Figures, verdict};
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

/// The device with all protocols.
const ALL: usize = 2;
const MAILBOX: u16 = 1024;
const BYTES: usize = 1 << 20;
const LIMIT: Duration = Duration::from_secs(60);
/// Maximum milliseconds per packet.
const BAR: f64 = 3.0;

pub fn main() -> ExitCode {
    let title = format!("FoE: 1 MiB written through a mailbox of {MAILBOX} bytes, ms of a packet, virtual time");
    let mut figures = Figures::new(&title);
    for response in [Duration::ZERO, Duration::from_micros(200)] {
        for cycle in [1, 10] {
            let name = format!("answers after {} us, cycle of {cycle} ms", response.as_micros());
            match measure(response, Duration::from_millis(cycle)) {
                Ok(packet) => {
                    figures.at_most(&name, packet.time.as_secs_f64() * 1e3, BAR, "ms");
                    figures.show("      round trips of a packet, all frames of the acyclic half", packet.trips());
                }
                Err(error) => {
                    eprintln!("files: {name}: {error}");
                    return ExitCode::FAILURE;
                }
            }
        }
    }
    verdict(figures.print())
}

/// A packet, as the mean of all.
struct Packet {
    time: Duration,
    /// Sequential accesses to the mailbox and its status.
    trips: f64,
    frames: f64,
}

impl Packet {
    fn trips(&self) -> String {
        format!("{:.2}, {:.2}", self.trips, self.frames)
    }
}

fn measure(response: Duration, cycle: Duration) -> Result<Packet, String> {
    let mut segment = descriptions(&["coupler", "digital-input-8", "all-protocols", "servo", "digital-output-8"]);
    segment[ALL].set_mailbox_bytes(MAILBOX);
    segment[ALL].mailbox.as_mut().ok_or("it has a mailbox")?.response_time = response;
    let declare = |scan: &Scan| automatic(&scan.subdevices, cycle);
    let network = ring(segment, NetworkOptions::default());
    let mut world = World::with(1, network, &Options::default(), declare).map_err(|error| error.to_string())?;
    world.settle();
    let mailbox = world.mailbox(ALL);
    let trips = |world: &World| {
        let counters = world.mailbox(ALL).counters();
        counters.written + counters.rewritten + counters.read + counters.polls + counters.empty_reads
    };
    let frames = |world: &World| world.application().acyclic_counters().sent;
    let before = (world.now(), trips(&world), frames(&world));
    let data: Vec<u8> = (0..BYTES).map(|at| (at * 7 % 253) as u8).collect();
    let work = world.start(async move {
        let mut packets = 0u32;
        let mut source = Bytes::new(&data);
        let written = foe::write(&mailbox, "large", FoeOptions::default(), &mut source, |_| packets += 1);
        written.await.map_err(|error| error.to_string())?;
        Ok::<_, String>((packets, mailbox.bus().now()))
    });
    let (packets, end) = world.finish(LIMIT, work)?;
    let took = Duration::from_nanos(end.0 - before.0.0);
    let mean = |count: u64| count as f64 / f64::from(packets);
    Ok(Packet { time: took / packets, trips: mean(trips(&world) - before.1), frames: mean(frames(&world) - before.2) })
}
