//! Outputs of SubDevices with SYNC0 signals that are sent again within their cycle: evaluated inside the SubDevices, by
//! the true times of their writes and of their signals.

use std::time::Duration;

use ringcat::{ClockConfig, Options, SyncSignals, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::controller::LogicalAccess;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::pulses::Pulses;
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::World;

const MS: Duration = Duration::from_millis(1);
const CYCLE_NS: u32 = 1_000_000;
/// Cycles until the paths of frames are known, and clocks run.
const LEARNING: u64 = 200;
/// Cycles in which a fault has its effects.
const EFFECTS: u64 = 12;

/// The signals of all devices since the beginning.
struct Signals {
    pulses: Pulses,
    times: Vec<Vec<SimTime>>,
    /// Nanoseconds that are added to their times.
    later: u64,
}

impl Signals {
    fn new(network: &Network, later: u64) -> Signals {
        let devices = network.devices().len();
        Signals { pulses: Pulses::new(network, 0..devices, CYCLE_NS.into()), times: vec![Vec::new(); devices], later }
    }

    fn observe(&mut self, network: &Network) {
        self.pulses.observe(network);
        for (pulse, times) in self.pulses.devices().iter().zip(&mut self.times) {
            let Some(last) = pulse.last else { continue };
            let new = pulse.count.saturating_sub(times.len() as u64);
            times.extend((0..new).rev().map(|before| SimTime(last.0 - before * u64::from(CYCLE_NS))));
        }
    }

    /// Whether a device has had a signal after the first time, and not after the second one.
    fn between(&self, device: usize, first: SimTime, second: SimTime) -> bool {
        self.times[device].iter().map(|at| SimTime(at.0 + self.later)).any(|at| first < at && at <= second)
    }
}

/// Bytes that a SubDevice took from a datagram; none if it took none.
fn outputs(access: &LogicalAccess) -> Vec<u8> {
    let written = access.moved.iter().filter(|moved| moved.write);
    written.flat_map(|moved| access.data[moved.at..moved.at + moved.len].iter().copied()).collect()
}

/// What the devices have seen.
#[derive(Debug, Default)]
struct Seen {
    /// Outputs that a device took twice without a signal between both.
    repeated: u64,
    /// The same with a signal between both.
    across: Vec<String>,
}

impl Seen {
    fn look(&mut self, world: &World, signals: &Signals, since: SimTime, what: &str) {
        for device in 0..world.network().devices().len() {
            let controller = &world.network().device(DeviceIndex(device)).controller;
            let writes: Vec<(SimTime, Vec<u8>)> = controller
                .logical_accesses()
                .filter(|access| access.at >= since)
                .map(|access| (access.at, outputs(access)))
                .filter(|(_, bytes)| !bytes.is_empty())
                .collect();
            for pair in writes.windows(2) {
                let [(first, bytes), (second, again)] = pair else { continue };
                if bytes != again {
                    continue;
                }
                if signals.between(device, *first, *second) {
                    self.across.push(format!("{what}: device {device}: {first:?} and {second:?}"));
                } else {
                    self.repeated += 1;
                }
            }
        }
    }
}

/// A segment of servos with these shifts of their signals, in OP.
fn world(count: usize, in_ring: bool, shifts: impl Fn(usize) -> i32) -> World {
    let devices = descriptions(&vec!["servo"; count]);
    let build = if in_ring { ring } else { line };
    let network = build(devices, NetworkOptions::default().with_detection_delay(Duration::from_micros(10)));
    let declare = |scan: &ringcat::Scan| {
        let mut declaration = automatic(&scan.subdevices, MS);
        declaration.clocks = Some(ClockConfig::default());
        for (at, subdevice) in declaration.subdevices.iter_mut().enumerate() {
            subdevice.sync = Some(SyncSignals::sync0(CYCLE_NS, shifts(at)));
        }
        declaration.with_sends_again(true)
    };
    let mut world = World::with(0, network, &Options::default(), declare).expect("it starts");
    world.settle();
    world.evaluate_latched(false);
    world.run_cycles(LEARNING);
    world
}

/// Faults that cost a frame: single losses in both directions, in a ring cuts and repairs too.
fn faults(count: usize, in_ring: bool) -> Vec<Fault> {
    let cables = [1, count / 2, count - 1].map(CableId);
    let lost = |cable| Direction::ALL.map(|way| Fault::Drop { cable, direction: Some(way), count: 1 });
    let mut faults: Vec<Fault> = cables.into_iter().flat_map(lost).collect();
    if in_ring {
        faults.extend(cables.into_iter().flat_map(|cable| [Fault::Cut(cable), Fault::Heal(cable)]));
    }
    faults
}

/// What devices saw, frames that were sent again, and faults after which none was. Signals are taken for later ones.
fn look(count: usize, in_ring: bool, later: u64) -> (Seen, u64, u64) {
    let (mut seen, mut sent_again, mut refused) = (Seen::default(), 0, 0);
    for base in (0..CYCLE_NS).step_by(100_000) {
        // All signals at once, or one after the other.
        let step = if base % 200_000 == 0 { 0 } else { 70_000 };
        let shift = |at: usize| (base + at as u32 * step) % CYCLE_NS;
        let mut world = world(count, in_ring, |at| shift(at) as i32);
        let mut signals = Signals::new(world.network(), later);
        for (number, fault) in faults(count, in_ring).into_iter().enumerate() {
            let since = world.now();
            let before = world.application().cyclic_counters().sent_again;
            world.fault_in(MS * (number as u32 % 10) / 10, fault.clone());
            for _ in 0..EFFECTS {
                world.cycle();
                signals.observe(world.network());
            }
            let what = format!("{count}, ring {in_ring}, shift {base} ns, step {step} ns, {fault:?}");
            seen.look(&world, &signals, since, &what);
            let tries = world.application().cyclic_counters().sent_again - before;
            (sent_again, refused) = (sent_again + tries, refused + u64::from(tries == 0));
        }
        assert_eq!(world.left_op(world.beginning()), []);
    }
    println!("{count}, ring {in_ring}: {sent_again} sent again, {refused} not, {} taken twice", seen.repeated);
    (seen, sent_again, refused)
}

// covers: lost-frames, dc-sync
#[test]
fn no_output_comes_twice_across_sync0_at_any_shift_in_lines_and_rings() {
    for (count, in_ring) in [(2, false), (3, false), (4, true), (10, true)] {
        let (seen, sent_again, refused) = look(count, in_ring, 0);
        assert!(seen.across.is_empty(), "{:#?}", seen.across);
        assert!(sent_again > 0 && seen.repeated > 0 && refused > 0, "{count}: {sent_again}, {seen:?}, {refused}");
    }
}

/// Shows that the check above works: signals that came at other times than declared would be between two tries.
// covers: lost-frames
#[test]
fn outputs_come_twice_across_signals_that_are_later_than_declared() {
    for (count, in_ring) in [(2, false), (4, true)] {
        let (seen, sent_again, _) = look(count, in_ring, u64::from(CYCLE_NS) / 2);
        assert!(!seen.across.is_empty() && sent_again > 0, "{count}: {sent_again}, {seen:?}");
    }
}
