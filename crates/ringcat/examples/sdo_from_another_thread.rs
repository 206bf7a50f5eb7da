//! Cycles in a thread of their own, and objects of a drive read from another thread meanwhile.
//!
//! `cargo run -p ringcat --example sdo_from_another_thread` on a simulated segment;
//! `cargo run -p ringcat --example sdo_from_another_thread -- eth1` (as root) on a network interface whose first
//! SubDevice is a drive.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::thread;
use std::time::Duration;

use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::{AlState, Declaration, LastOutputs, Links, Options, Position, SubDeviceConfig, SupervisorThread};

const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"servo\"\n";
const LIMIT: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn Error>> {
    match std::env::args().nth(1) {
        Some(interface) => {
            let (cyclic, acyclic) = PacketLinks::open_halves(&interface, None, ReceiveMode::Blocking)?;
            run(cyclic, acyclic)
        }
        None => {
            let network = Network::from_description(Segment::from_toml(SEGMENT, Path::new("."))?)?;
            let (cyclic, acyclic) = SharedSegment::halves(network);
            run(cyclic, acyclic)
        }
    }
}

fn run<L: Links + Send + 'static>(cyclic: L, acyclic: L) -> Result<(), Box<dyn Error>> {
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    supervisor.scan()?;
    // Before activation a SubDevice is named by its position.
    let serial = supervisor.subdevice(Position(0)).sdo_read::<u32>(0x1018, 4)?;
    println!("serial number {serial}");

    let mut declaration = Declaration::new(Duration::from_millis(2));
    let id = declaration.add(SubDeviceConfig::at_position(0));
    let application = supervisor.activate(declaration, cyclic)?;
    let cycles = application.start_cycles(ringcat::realtime::precise_timers, |_| ControlFlow::Continue(()))?;
    cycles.supervisor().wait_until_op(LIMIT)?;

    // Any number of threads may have a handle each; the cycles wait for none of them.
    let supervisor = cycles.supervisor().clone();
    let reader = thread::spawn(move || {
        let drive = supervisor.subdevice(id).within(LIMIT);
        (0..5).map(|_| drive.sdo_read::<i32>(0x6064, 0)).collect::<Result<Vec<i32>, ringcat::Error>>()
    });
    // Two at once from this one: a job is waited for, polled, or awaited as a future.
    let background = cycles.supervisor().background();
    let mode = background.subdevice(id).sdo_read::<i8>(0x6061, 0);
    let modes = background.subdevice(id).sdo_read::<u32>(0x6502, 0);
    println!("mode {}, supported modes {:#010x}", mode.finish()?, modes.finish()?);
    let positions = reader.join().map_err(|_| "the reader has panicked")??;
    println!("positions {positions:?}");
    // An object that is not there is an error that names SubDevice and object.
    if let Err(error) = cycles.supervisor().subdevice(id).sdo_read::<u32>(0x7777, 0) {
        println!("as expected: {error}");
    }
    println!("{:?}", cycles.cyclic_status().pace());
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}
