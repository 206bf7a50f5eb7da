//! A thousand SubDevices: CPU per simulated second and memory of the MainDevice.
//!
//! Terminals as in [`scenarios::terminals`] form a closed ring on two links. With 1,000 of them and 1 us per hop the
//! round trip exceeds a millisecond, so that cycles take 4 ms; with 0.3 us it does not. CPU is the CPU time of this
//! process, engine and simulator together, while all are in OP, as charged and against that of a fixed work beside it,
//! because other programs on the machine make both longer. The lesser one is judged: a machine whose memory is slow for
//! its processor is charged more than by the fixed work. The same program took 0.9 to 1.4 s by the work, and 0.7 to
//! 0.9 s as charged, within a day on one machine. Memory is the allocated memory since the segment was built: the
//! MainDevice, and a few frames and queues of the simulator.

use std::process::ExitCode;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Application, Error, MainDevice, Options, automatic};
use ringcat_engine::RingState;
use scenarios::counting_allocator::{CountingAllocator, counts, restart_peak};
use scenarios::cpu_time::{REFERENCE, process_cpu_time, reference_work};
use scenarios::figures::{Figures, of_blocks, verdict};
use scenarios::terminals::{Links, segment};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Maximum CPU seconds per simulated second with 1,000 SubDevices, as charged or of a machine that takes [`REFERENCE`]
/// for the reference work.
const CPU_BAR: f64 = 1.0;
/// Maximum MiB of a MainDevice with 1,000 SubDevices in OP, and on the way there: 13.2 and 16.1 are measured, 15.86 and
/// 22.77 were at commit 4cd9b5da.
const MEMORY_BARS: (f64, f64) = (14.0, 17.0);
/// SubDevices, cycle in ms, delay of a hop in ns.
const RINGS: [(usize, u64, u64); 3] = [(100, 1, 1_000), (1_000, 4, 1_000), (1_000, 1, 300)];
/// Simulated time of a measurement.
const STRETCH: Duration = Duration::from_secs(2);
const STRETCHES: usize = 3;
const MIB: f64 = (1 << 20) as f64;

fn main() -> ExitCode {
    match measure() {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("scale: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure() -> Result<bool, Error> {
    let mut met = true;
    for (count, period_ms, hop_ns) in RINGS {
        let (period, hop) = (Duration::from_millis(period_ms), Duration::from_nanos(hop_ns));
        let mut figures = Figures::new(&format!("{count} SubDevices, closed ring, {period:?} cycle, {hop:?} per hop"));
        let network = segment(count, true, Links::Two, hop);
        let before = counts();
        restart_peak();
        let mut application = start(network, period)?;
        let after = counts();
        let (cpu, ratios) = cpu_per_second(&mut application, &mut figures);
        let (held, peak) = ((after.bytes - before.bytes) as f64 / MIB, (after.peak - before.bytes) as f64 / MIB);
        figures.show("CPU per simulated second", of_blocks(&cpu, "s"));
        figures.show("the same by the reference work beside it", of_blocks(&ratios, "s"));
        if count == 1_000 {
            let lesser: [f64; STRETCHES] = core::array::from_fn(|block| cpu[block].min(ratios[block]));
            figures.at_most_in_blocks("the lesser of both", &lesser, CPU_BAR, "s");
            figures.at_most("memory in OP", held, MEMORY_BARS.0, "MiB");
            figures.at_most("most memory on the way there", peak, MEMORY_BARS.1, "MiB");
        } else {
            figures.show("memory in OP", format!("{held:.2} MiB"));
            figures.show("most memory on the way there", format!("{peak:.2} MiB"));
        }
        met &= figures.print();
    }
    Ok(met)
}

/// A MainDevice on the segment with all SubDevices in OP.
fn start(network: ringcat_sim::network::Network, period: Duration) -> Result<Application<SimulatedSegment>, Error> {
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let found = main_device.scan()?;
    let declaration = automatic(&found.subdevices, period);
    drop(found);
    let mut application = main_device.activate(declaration)?;
    while !application.all_settled() {
        application.cycle(|_| ());
    }
    Ok(application)
}

/// CPU seconds per simulated second, by stretch: as charged, and by the reference work after each stretch.
fn cpu_per_second(
    application: &mut Application<SimulatedSegment>,
    figures: &mut Figures,
) -> ([f64; STRETCHES], [f64; STRETCHES]) {
    let (mut charged, mut ratios) = ([0.0; STRETCHES], [0.0; STRETCHES]);
    let (cycles, hops) = (application.cyclic_counters().sent, application.links().network().statistics().hops());
    for (charged, ratio) in charged.iter_mut().zip(&mut ratios) {
        let (begin, cpu) = (application.now(), process_cpu_time());
        while application.now().since(begin) < STRETCH {
            application.cycle(|_| ());
        }
        let simulated = application.now().since(begin).as_secs_f64();
        *charged = (process_cpu_time() - cpu).as_secs_f64() / simulated;
        *ratio = *charged * REFERENCE.as_secs_f64() / reference_work().as_secs_f64();
    }
    let counters = application.cyclic_counters();
    assert_eq!((application.ring(), counters.lost), (RingState::Closed, 0), "{counters:?}");
    let hops = application.links().network().statistics().hops() - hops;
    figures.show("frames of process data, hops", format!("{}, {hops}", counters.sent - cycles));
    (charged, ratios)
}
