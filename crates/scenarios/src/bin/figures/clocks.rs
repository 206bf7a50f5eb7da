//! Distributed clocks: error of delays, spread of clocks, phase of the host.
//!
//! All runs use virtual time and clocks with errors ([`scenarios::clocks`]): drift up to 50 or 100 ppm, slow wander, 40
//! ns of jitter on every receive time, a fourth of them with 32 bits. The true times, which the MainDevice cannot read,
//! come from the simulator.

use std::process::ExitCode;
use std::time::Duration;

use ringcat::{JunctionMode, SyncSignals, Trigger};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::controller::Wander;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::device::Device;
use ringcat_sim::frame::Port;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use ringcat_wire::register::map;
use scenarios::clocks::{clock_tree, clocked, config, delay, largest_spread, lock, spread, wired, with_clocks, world};
use scenarios::figures::{Figures, verdict};
use scenarios::segments::{MAIN, at, line, ring};
use scenarios::world::World;

/// Maximum error of a delay per hop, in nanoseconds.
const HOP_BAR: f64 = 20.0;
/// Maximum spread of all clocks in the steady state.
const SPREAD_BAR: f64 = 100.0;
/// Maximum spread over a cut and its repair, inside a part and across both.
const INSIDE_BAR: f64 = 1_000.0;
const ACROSS_BAR: f64 = 5_000.0;
/// Maximum deviation of SYNC0 from its scheduled phase, mean of a second, relative to the scheduled wake-up.
const PHASE_BAR: f64 = 5_000.0;
/// Maximum virtual time from power-on to the lock of a hundred clocks.
const LOCK_BAR: f64 = 3.0;
const HOST_JITTER: Duration = Duration::from_micros(50);

pub fn main() -> ExitCode {
    let mut figures = Figures::new("distributed clocks, in virtual time");
    let options = NetworkOptions::default;
    delays(&mut figures, "line of 200", |ideal| line(descriptions(200, ideal), options()));
    delays(&mut figures, "tree of 100, three branches each", |ideal| clock_tree(descriptions(100, ideal)));
    hundred(&mut figures);
    two_hundred(&mut figures);
    cuts(&mut figures);
    junction(&mut figures);
    phase(&mut figures);
    verdict(figures.print())
}

/// Devices with clocks, with errors or ideal.
fn descriptions(count: usize, ideal: bool) -> Vec<DeviceDescription> {
    let mut all = clocked(count, 100);
    for device in all.iter_mut().filter(|_| ideal) {
        (device.clock_drift_ppb, device.clock_start_ns) = (0, 0);
        (device.clock_wander, device.receive_jitter) = (Wander::default(), Duration::ZERO);
    }
    all
}

/// Written delays compared with those of ideal clocks.
fn delays(figures: &mut Figures, name: &str, network: impl Fn(bool) -> Network) {
    let written = |ideal: bool| -> (Vec<f64>, Vec<u64>) {
        let mut world = world(1, network(ideal), config());
        let count = world.network().devices().len();
        let is_set_up = |world: &World| delay(world.network(), count - 1) != 0;
        world.until(Duration::from_secs(2), "set up", is_set_up);
        world.run_cycles(5);
        let unit = |device: &Device| {
            let bytes = device.controller.register(map::DC_RECEIVE_TIME_EPU, 8);
            bytes.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes)) & 0xFFFF_FFFF
        };
        let units = world.network().devices().map(unit).collect();
        ((0..count).map(|device| f64::from(delay(world.network(), device))).collect(), units)
    };
    let (_, truth) = written(true);
    let (measured, _) = written(false);
    let truth: Vec<f64> = truth.iter().map(|unit| unit.wrapping_sub(truth[0]) as u32 as f64).collect();
    let errors: Vec<f64> = measured.iter().zip(&truth).map(|(measured, truth)| measured - truth).collect();
    let is_line = name.starts_with("line");
    let parent = |device: usize| if is_line { device - 1 } else { (device - 1) / 3 };
    let mut hops = vec![0u32; errors.len()];
    let (mut per_hop, mut share) = (0.0f64, 0.0f64);
    for device in 1..errors.len() {
        hops[device] = hops[parent(device)] + 1;
        per_hop = per_hop.max((errors[device] - errors[parent(device)]).abs());
        share = share.max(errors[device].abs() / (10.0 + 10.0 * f64::from(hops[device]).sqrt()));
    }
    let worst = errors.iter().fold(0.0f64, |worst, error| worst.max(error.abs()));
    figures.at_most(&format!("{name}: delay error of a hop"), per_hop, HOP_BAR, "ns");
    figures.at_most(&format!("{name}: sum ({worst:.0} ns at most) against 10 + 10 sqrt(hops) ns"), share, 1.0, "x");
}

fn hundred(figures: &mut Figures) {
    let network = line(clocked(100, 50), NetworkOptions::default());
    let mut world = World::with(2, network, &ringcat::Options::default(), |scan| {
        let mut declaration = with_clocks(scan, config());
        for subdevice in &mut declaration.subdevices {
            subdevice.sync = Some(SyncSignals::sync0(1_000_000, 0));
        }
        declaration
    })
    .expect("it can be activated");
    lock(&mut world, Duration::from_secs(20));
    let locked = world.now().0 as f64 / 1e9;
    figures.at_most("100 clocks, +-50 ppm: from power-on to the lock", locked, LOCK_BAR, "s");
    world.until(Duration::from_secs(5), "all in OP", World::all_in_op);
    let op = world.now().0 as f64 / 1e9;
    let without = without_clocks();
    figures.show("the same, to OP with SYNC0 everywhere; without clocks", format!("{op:.3} s; {without:.3} s"));
    let all: Vec<usize> = (0..100).collect();
    let largest = largest_spread(&mut world, &all, 10_000);
    figures.at_most("the same: spread in 10 s of 1 ms cycles", largest as f64, SPREAD_BAR, "ns");
}

/// Twice as many clocks with twice the drift to either side.
fn two_hundred(figures: &mut Figures) {
    let mut world = world(2, line(clocked(200, 100), NetworkOptions::default()), config());
    lock(&mut world, Duration::from_secs(20));
    let locked = world.now().0 as f64 / 1e9;
    figures.show("200 clocks, +-100 ppm: from power-on to the lock", format!("{locked:.2} s"));
    let all: Vec<usize> = (0..200).collect();
    let largest = largest_spread(&mut world, &all, 2_000);
    figures.at_most("the same: spread in 2 s of 1 ms cycles", largest as f64, SPREAD_BAR, "ns");
}

/// From power-on to OP of the same devices without clocks.
fn without_clocks() -> f64 {
    let network = line(clocked(100, 50), NetworkOptions::default());
    let mut world = World::new(2, network);
    world.until(Duration::from_secs(20), "all in OP", World::all_in_op);
    world.now().0 as f64 / 1e9
}

/// A ring behind a junction: each of its cables is cut and repaired.
fn junction(figures: &mut Figures) {
    let (a, b, c, d) = (Port::A, Port::B, Port::C, Port::D);
    let mut cables = vec![(MAIN, at(0, a)), (at(0, b), at(1, a)), (at(1, d), at(2, a))];
    cables.extend((3..8).map(|device| (at(device - 1, b), at(device, a))));
    cables.extend([(at(7, b), at(1, b)), (at(1, c), at(8, a)), (at(8, b), at(9, a))]);
    let options = ringcat::Options::default().with_junctions(JunctionMode::Automatic);
    let network = wired(clocked(10, 50), &cables);
    let mut world = World::with(5, network, &options, |scan| with_clocks(scan, config())).expect("it can be activated");
    lock(&mut world, Duration::from_secs(20));
    world.run_cycles(500);
    let all: Vec<usize> = (0..10).collect();
    let (mut over, mut after) = (0, 0);
    for cable in 2..9 {
        for heal in [false, true] {
            let fault = if heal { World::heal } else { World::cut };
            fault(&mut world, CableId(cable));
            over = over.max(largest_spread(&mut world, &all, 500));
            after = after.max(largest_spread(&mut world, &all, 100));
        }
    }
    figures.at_most("ring behind a junction, each cable cut and healed: spread", over as f64, INSIDE_BAR, "ns");
    figures.at_most("the same, 0.5 s after each", after as f64, SPREAD_BAR, "ns");
}

fn cuts(figures: &mut Figures) {
    const COUNT: usize = 10;
    let (mut inside, mut across, mut after) = (0, 0, 0);
    for cable in 0..=COUNT {
        let mut world = world(3, ring(clocked(COUNT, 50), NetworkOptions::default()), config());
        lock(&mut world, Duration::from_secs(20));
        world.run_cycles(500);
        let (front, behind): (Vec<usize>, Vec<usize>) = ((0..cable).collect(), (cable..COUNT).collect());
        let all: Vec<usize> = (0..COUNT).collect();
        let mut watch = |world: &mut World| {
            for _ in 0..2_000 {
                world.cycle();
                let network = world.network();
                inside = inside.max(spread(network, &front)).max(spread(network, &behind));
                across = across.max(spread(network, &all));
            }
        };
        world.cut(CableId(cable));
        watch(&mut world);
        world.heal(CableId(cable));
        watch(&mut world);
        after = after.max(largest_spread(&mut world, &all, 100));
    }
    figures.at_most("ring of 10, each cable cut and healed: spread inside a part", inside as f64, INSIDE_BAR, "ns");
    figures.at_most("the same, across both parts", across as f64, ACROSS_BAR, "ns");
    figures.at_most("the same, 2 s after the repair", after as f64, SPREAD_BAR, "ns");
}

/// The host follows the clocks: time of SYNC0 relative to the scheduled wake-ups.
fn phase(figures: &mut Figures) {
    const PHASE_NS: i64 = 300_000;
    let mut world =
        World::with(4, line(clocked(10, 50), NetworkOptions::default()), &ringcat::Options::default(), |scan| {
            let mut declaration = with_clocks(scan, config());
            for subdevice in &mut declaration.subdevices {
                subdevice.sync = Some(SyncSignals::sync0(1_000_000, 0));
            }
            declaration
        })
        .expect("it can be activated");
    world.application_mut().set_trigger(Trigger::ReferenceClock { phase_ns: PHASE_NS });
    world.application_mut().links_mut().oversleep(HOST_JITTER);
    world.until(Duration::from_secs(20), "all in OP", World::all_in_op);
    world.run_cycles(3_000);
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for _ in 0..1_000 {
        world.cycle();
        let application = world.application();
        let began = application.begun_at();
        let scheduled = SimTime(began.0 - application.pace().last_delay.as_nanos() as u64);
        let network = world.network();
        let next = network.device(DeviceIndex(5)).controller.next_sync0(scheduled).expect("SYNC0 runs");
        // SYNC0 is at 0 modulo 1 ms, wake-ups are scheduled 0.3 ms behind it.
        let error = next.0 as f64 - scheduled.0 as f64 - (1_000_000.0 - PHASE_NS as f64);
        sum += error;
        worst = worst.max(error.abs());
    }
    let mean: f64 = sum / 1_000.0;
    figures.at_most(
        "SYNC0 against scheduled wake-ups, host 50 us late at random, mean of 1 s",
        mean.abs(),
        PHASE_BAR,
        "ns",
    );
    figures.show("the same, worst of 1,000", format!("{worst:.0} ns"));
}
