//! A running light whose cycles have a thread of their own: what a machine runs.
//!
//! `cargo run -p ringcat --example two_threads` on a simulated segment;
//! `cargo run -p ringcat --example two_threads -- eth1` (as root) on a network interface whose second SubDevice has
//! outputs.

use std::ops::ControlFlow;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::text::{Names, describe};
use ringcat::{
    AlState, DomainId, DomainState, Error, LastOutputs, Links, Options, SubDeviceId, SupervisorThread, automatic,
};

const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\n";
const LAMPS: SubDeviceId = SubDeviceId(1);
/// The light runs for this time.
const RUN: Duration = Duration::from_secs(1);
const LIMIT: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    match std::env::args().nth(1) {
        Some(interface) => {
            let (cyclic, acyclic) = PacketLinks::open_halves(&interface, None, ReceiveMode::Blocking)?;
            run(cyclic, acyclic)?;
        }
        None => {
            let network = Network::from_description(Segment::from_toml(SEGMENT, Path::new("."))?)?;
            let (cyclic, acyclic) = SharedSegment::halves(network);
            run(cyclic, acyclic)?;
        }
    }
    Ok(())
}

fn run<L: Links + Send + 'static>(cyclic: L, acyclic: L) -> Result<(), Error> {
    // Scan, configuration, mailboxes, recovery: all that is not process data has this thread.
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    let scan = supervisor.scan()?;
    let application = supervisor.clone().activate(automatic(&scan.subdevices, Duration::from_millis(1)), cyclic)?;
    let lamps: Vec<_> =
        (0..8).filter_map(|channel| application.output::<bool>(LAMPS, 0x7000 + 0x10 * channel, 1).ok()).collect();

    // The cycles: no allocation, no lock, no waiting in here. `prepare` is the place for `ringcat::realtime`.
    let prepare = ringcat::realtime::precise_timers;
    let cycles = application.start_cycles(prepare, move |data| {
        let lit = (data.cycle() / 50) as usize;
        for (channel, lamp) in lamps.iter().enumerate() {
            data.set(*lamp, channel == lit % lamps.len());
        }
        ControlFlow::Continue(())
    })?;

    let begin = Instant::now();
    // On a busy host the start takes longer, or the frame of the last cycle is late.
    let status = loop {
        while let Some(event) = supervisor.pop_event() {
            println!("{}", describe(&event, &Names::default()));
        }
        sleep(Duration::from_millis(10));
        let status = cycles.cyclic_status().status(DomainId(0))?;
        let limit = if status.state == DomainState::Complete { RUN } else { LIMIT };
        if begin.elapsed() >= limit {
            break status;
        }
    };
    println!("working counter {} of {}; {:?}", status.wkc, status.expected, cycles.cyclic_status().pace());
    println!("round trips: {}", cycles.cyclic_status().round_trips());
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}
