//! Lost frames are sent again within their cycle: cuts and repairs of a ring, single losses, devices that must not see
//! outputs twice. Evaluated by the domain's status and by the logs of the devices.

mod own_loops;

use std::time::Duration;

use ringcat::{ClockConfig, Declaration, DomainState, Options, RawDatagram, Scan, SyncSignals, automatic};
use ringcat_engine::config::Repetition;
use ringcat_sim::cable::{CableId, Direction};
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::address::LogicalAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use scenarios::check::Evaluated;
use scenarios::one_buffer::{self, one_buffer};
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::World;

const MS: Duration = Duration::from_millis(1);
const US: Duration = Duration::from_micros(1);
const CYCLES: [Duration; 3] = [US.saturating_mul(250), MS, MS.saturating_mul(4)];
/// Largest number of lost cycles, and the bound, by the detection time of the ends: for each of [`CYCLES`].
const EXPECTED: [(Duration, [usize; CYCLES.len()]); 4] = [
    (US.saturating_mul(10), [0, 0, 0]),
    (US.saturating_mul(100), [0, 0, 0]),
    (MS, [4, 1, 0]),
    (MS.saturating_mul(10), [40, 10, 2]),
];
/// The page with this table.
const PAGE: &str = include_str!("../../../../docs/redundancy.md");
/// Cycles until the round trips of frames are known.
const LEARNING: u64 = 200;

/// SubDevices without a mailbox: their outputs may be repeated.
fn kinds(count: usize) -> Vec<&'static str> {
    const KINDS: [&str; 5] =
        ["digital-output-8", "digital-input-8", "digital-output-16", "digital-input-16", "coupler"];
    KINDS.into_iter().cycle().take(count).collect()
}

fn world(network: Network, declare: impl FnOnce(&Scan) -> Declaration) -> World {
    let declare = |scan: &Scan| declare(scan).with_sends_again(true);
    let mut world = World::with(0, network, &Options::default(), declare).expect("it starts");
    world.settle();
    world.run_cycles(LEARNING);
    world
}

/// All of a table, or a part of it in each test run.
fn is_full() -> bool {
    std::env::var_os("LOSSLESS").is_some()
}

/// Lost cycles of the edges of one ring.
#[derive(Default)]
struct Row {
    edges: u64,
    /// Largest number of lost cycles at a cut and at a repair, and their sums.
    worst: [usize; 2],
    sum: [usize; 2],
    allowed: usize,
    sent_again: u64,
}

/// Longest time that a frame takes, in the closed ring and in one that is cut at its end, as the simulator shows it.
fn ways(world: &mut World, count: usize) -> [u64; 2] {
    let measure = |world: &mut World| {
        world.application_mut().links_mut().measure_flights();
        world.run_cycles(10);
        world.application().links().flight_ns()
    };
    let closed = measure(world);
    world.cut(CableId(count));
    world.run_cycles(100);
    let open = measure(world);
    world.heal(CableId(count));
    world.run_cycles(200);
    [closed, open]
}

/// Cuts and repairs each cable in each phase of the cycle.
fn edges(count: usize, detection: Duration, cycle: Duration, cables: &[usize], phases: u32) -> Row {
    let network = ring(descriptions(&kinds(count)), NetworkOptions::default().with_detection_delay(detection));
    let mut world = world(network, |scan| automatic(&scan.subdevices, cycle));
    world.evaluate_latched(false);
    world.compare_tries();
    let wait = world.application().exchange().waits_for_ns().expect("the round trips are known");
    let [flight, open] = ways(&mut world, count);
    // The host measures one round trip in a closed ring: that of the open one is at most twice as long.
    assert!(wait > open && wait <= 2 * flight * 9 / 8 + 10_000, "r {wait} ns, {flight} ns closed, {open} ns open");
    let needed = detection.as_nanos() as u64 + 2 * flight + open * 9 / 8 + 10_000;
    let allowed = (needed.div_ceil(cycle.as_nanos() as u64) as usize).saturating_sub(1);
    let mut row = Row { allowed, ..Row::default() };
    let rest = detection.as_nanos().div_ceil(cycle.as_nanos()) as u64 + 80;
    for cable in cables {
        for phase in 0..phases {
            // Ends that detect a repair at different times.
            let direction = if phase % 2 == 0 { Direction::AToB } else { Direction::BToA };
            let heal = Fault::HealUnevenly { cable: CableId(*cable), direction, by: detection };
            for (edge, fault) in [Fault::Cut(CableId(*cable)), heal].into_iter().enumerate() {
                let mark = world.mark();
                world.fault_in(cycle * phase / phases, fault.clone());
                world.run_cycles(rest);
                let lost = world.incomplete(mark);
                row.worst[edge] = row.worst[edge].max(lost);
                row.sum[edge] += lost;
                row.edges += 1;
                assert!(
                    lost <= allowed,
                    "ring of {count}, cable {cable}, {fault:?} in phase {phase} of {phases}: {lost} cycles lost, \
                     {allowed} allowed (d {detection:?}, T {cycle:?}, f {flight} ns, r {wait} ns)"
                );
            }
        }
    }
    row.sent_again = world.application().cyclic_counters().sent_again;
    assert_eq!(world.left_op(world.beginning()), []);
    row
}

// covers: lost-frames
#[test]
fn cuts_and_repairs_cost_no_cycle_where_the_time_fits() {
    println!("{:>4} {:>9} {:>7} {:>7} {:>9} {:>9} {:>6}", "ring", "d", "T", "edges", "lost cut", "repair", "bound");
    let mut worst = [[0; CYCLES.len()]; EXPECTED.len()];
    for count in [4, 10, 33] {
        let all: Vec<usize> = (0..=count).collect();
        let some = [0, 1, count / 2, count - 1, count];
        // Two thirds of the time would go into the longest ring.
        let (cables, phases) = match count {
            _ if is_full() => (&all[..], 40),
            33 => (&some[1..4], 4),
            _ => (&some[..], 8),
        };
        for (of_detection, (detection, lost)) in worst.iter_mut().zip(EXPECTED) {
            for ((of_cycle, cycle), bound) in of_detection.iter_mut().zip(CYCLES).zip(lost) {
                let row = edges(count, detection, cycle, cables, phases);
                let [cut, repair] = [0, 1].map(|edge| format!("{} ({})", row.worst[edge], row.sum[edge]));
                let (d, t) = (format!("{detection:?}"), format!("{cycle:?}"));
                println!("{count:>4} {d:>9} {t:>7} {:>7} {cut:>9} {repair:>9} {:>6}", row.edges, row.allowed);
                assert!(row.sent_again > 0, "frames were lost at some edge");
                *of_cycle = row.worst.into_iter().fold(*of_cycle, usize::max);
                assert_eq!(row.allowed, bound, "ring of {count}, d {detection:?}, T {cycle:?}");
            }
        }
    }
    for ((detection, lost), worst) in EXPECTED.into_iter().zip(worst) {
        assert_eq!(worst, lost, "d {detection:?}");
        let line = format!("| {} | {} | {} | {} |", shown(detection), lost[0], lost[1], lost[2]);
        assert!(PAGE.lines().any(|of_page| of_page == line), "docs/redundancy.md has no line {line}");
    }
}

/// As on the page.
fn shown(detection: Duration) -> String {
    let us = detection.as_micros();
    if us.is_multiple_of(1_000) { format!("{} ms", us / 1_000) } else { format!("{us} us") }
}

/// Keeps more datagrams waiting than the acyclic half can send: reads of logical addresses that no SubDevice has.
struct FullLoad {
    waiting: Vec<Box<dyn FnMut() -> bool>>,
}

impl FullLoad {
    const DATAGRAMS: usize = 40;
    const LENGTH: usize = 1_400;

    fn cycle(&mut self, world: &mut World) {
        world.cycle();
        self.waiting.retain_mut(|has_ended| !has_ended());
        while self.waiting.len() < Self::DATAGRAMS {
            let target = Target::Logical(LogicalAddress(0x7000_0000));
            let datagram = RawDatagram::new(Command::Lrd, target, vec![0; Self::LENGTH]);
            let mut reply = world.application_mut().engine_mut().start_datagrams(vec![datagram]);
            self.waiting.push(Box::new(move || reply.take().is_some()));
        }
    }
}

// covers: lost-frames, threads
#[test]
fn a_full_acyclic_half_leaves_the_time_of_a_second_try_free() {
    const EDGES: u32 = 20;
    let detection = 10 * US;
    for (count, cycle) in [(4, CYCLES[0]), (10, CYCLES[1]), (33, CYCLES[1]), (10, CYCLES[2])] {
        let network = ring(descriptions(&kinds(count)), NetworkOptions::default().with_detection_delay(detection));
        let mut world = world(network, |scan| automatic(&scan.subdevices, cycle));
        world.evaluate_latched(false);
        world.compare_tries();
        let mut load = FullLoad { waiting: Vec::new() };
        (0..LEARNING).for_each(|_| load.cycle(&mut world));
        assert_eq!(world.application().cyclic_counters().sent_again, 0, "nothing is lost");
        let (begun, before) = (world.now(), world.application().acyclic_counters().bytes);
        let wait = world.application().exchange().waits_for_ns().expect("the round trips are known");
        let cable = CableId(count / 2);
        for phase in 0..EDGES {
            for fault in [Fault::Cut(cable), Fault::Heal(cable)] {
                let mark = world.mark();
                // While the frames of the cycle are in the ring, and some time longer.
                world.fault_in(Duration::from_nanos(wait) * phase / EDGES, fault.clone());
                (0..80).for_each(|_| load.cycle(&mut world));
                assert_eq!(
                    world.incomplete(mark),
                    0,
                    "ring of {count}, {cycle:?}, {fault:?} in phase {phase} of {EDGES}"
                );
            }
        }
        let bytes = world.application().acyclic_counters().bytes - before;
        let share = bytes as f64 * 80.0 / world.now().since(begun).as_nanos() as f64;
        let saved = world.application().cyclic_counters().saved;
        println!("ring of {count}, {cycle:?}: {saved} cycles saved, acyclic frames {:.0} % of the time", share * 100.0);
        assert!(saved >= 5 && share > 0.4, "{saved}, {share}");
    }
}

// covers: lost-frames
#[test]
fn single_lost_frames_cost_no_cycle() {
    // 0.01 to 1 % of the frames.
    for (one_in, some) in [(10_000, 40_000), (1_000, 5_000), (200, 3_000), (100, 3_000)] {
        let cycles = if is_full() { 5 * one_in.max(20_000) } else { some };
        for in_ring in [true, false] {
            let network = || descriptions(&kinds(10));
            let options = NetworkOptions::default();
            let network = if in_ring { ring(network(), options) } else { line(network(), options) };
            let mut world = world(network, |scan| automatic(&scan.subdevices, MS));
            world.evaluate_latched(false);
            world.compare_tries();
            let mark = world.mark();
            world.application_mut().links_mut().lose_one_in(one_in, 7);
            world.run_cycles(cycles);
            let counters = world.application().cyclic_counters();
            println!(
                "ring {in_ring}, one of {one_in} frames lost, {cycles} cycles: {} sent again, {} saved",
                counters.sent_again, counters.saved
            );
            assert_eq!(world.incomplete(mark), 0);
            assert!(counters.saved > 0);
        }
    }
}

// covers: lost-frames
#[test]
fn nothing_is_sent_again_in_undisturbed_cycles() {
    let cycles = if is_full() { 1_000_000 } else { 20_000 };
    for in_ring in [true, false] {
        let (described, options) = (descriptions(&kinds(4)), NetworkOptions::default());
        let network = if in_ring { ring(described, options) } else { line(described, options) };
        let mut world = world(network, |scan| automatic(&scan.subdevices, MS));
        world.run_cycles(cycles);
        assert_eq!(world.application().cyclic_counters().sent_again, 0, "ring: {in_ring}");
        assert!(world.application().exchange().waits_for_ns().is_some());
    }
}

/// The host wakes up late while a frame waits for it, and frames are lost later.
// covers: lost-frames
#[test]
fn a_host_that_is_late_now_and_then_still_sends_lost_frames_again() {
    const ROUNDS: u64 = 20;
    // Single delays in each second, and a burst of them before a second without any.
    for (delays, rest) in [(1, 150), (4, 300)] {
        let mut world =
            world(line(descriptions(&kinds(10)), NetworkOptions::default()), |scan| automatic(&scan.subdevices, MS));
        world.evaluate_latched(false);
        let usual = world.application().exchange().waits_for_ns().expect("the round trips are known");
        let mark = world.mark();
        for _ in 0..ROUNDS {
            for _ in 0..delays {
                world.stall(MS * 8 / 10);
                world.run_cycles(2);
            }
            world.run_cycles(rest);
            let wait = world.application().exchange().waits_for_ns().expect("it is known");
            assert!(wait <= usual + usual / 8, "{delays} delays: {usual} ns have become {wait} ns");
            world.fault(Fault::Drop { cable: CableId(1), direction: Some(Direction::AToB), count: 1 });
            world.run_cycles(2);
        }
        assert_eq!(world.incomplete(mark), 0, "{delays} delays");
        assert_eq!(world.application().cyclic_counters().saved, ROUNDS, "{delays} delays");
    }
}

fn latched(world: &World) -> Vec<u64> {
    world.network().devices().map(Device::outputs_latched).collect()
}

// covers: lost-frames
#[test]
fn outputs_of_sm_synchronous_subdevices_are_taken_once_in_a_cycle() {
    // Servos have CoE, and no command selects free run: they are taken for SM-synchronous.
    let kinds = ["digital-output-8", "servo", "digital-input-8", "servo", "digital-output-16", "digital-input-8"];
    let network = ring(descriptions(&kinds), NetworkOptions::default());
    let mut world = world(network, |scan| {
        let mut declaration = automatic(&scan.subdevices, MS);
        declaration.subdevices[3].repetition = Repetition::Everything;
        declaration
    });
    world.evaluate_latched(false);
    world.compare_tries();
    for cable in 1..=kinds.len() {
        let (before, mark) = (latched(&world), world.mark());
        let tries = world.application().cyclic_counters().sent_again;
        world.fault(Fault::Drop { cable: CableId(cable), direction: Some(Direction::AToB), count: 1 });
        world.run_cycles(3);
        assert_eq!(world.application().cyclic_counters().sent_again - tries, 1, "cable {cable}");
        let taken: Vec<u64> = latched(&world).iter().zip(before).map(|(now, before)| now - before).collect();
        // Devices upstream of the loss have processed the first try.
        let times = |device: usize| if device < cable { 4 } else { 3 };
        assert_eq!((taken[0], taken[3], taken[4]), (times(0), times(3), times(4)), "cable {cable}");
        assert_eq!(taken[1], if 1 < cable { 3 } else { 2 }, "cable {cable}: once in each cycle at most");
        assert!(world.evaluated(mark).iter().all(|evaluated| evaluated.stale.is_empty()), "inputs are read again");
        // No copy shows that the servo took the outputs of that cycle.
        let whole = |evaluated: &&Evaluated| evaluated.status.state == DomainState::Complete;
        let missed = world.evaluated(mark).iter().filter(|evaluated| !whole(evaluated)).count();
        assert_eq!(missed, 1, "cable {cable}");
    }
}

// covers: lost-frames
#[test]
fn process_data_of_one_buffer_subdevices_is_transferred_once_in_a_cycle() {
    let kinds = ["digital-output-8", "digital-output-16", "digital-input-16", "analog-output-4", "analog-input-4"];
    for first in [0, 1] {
        for in_ring in [true, false] {
            let mut described = descriptions(&kinds);
            for number in (first..kinds.len()).step_by(2) {
                described[number] = one_buffer(described[number].clone());
            }
            let options = NetworkOptions::default();
            let network = if in_ring { ring(described, options) } else { line(described, options) };
            let mut world = world(network, |scan| one_buffer::automatic(&scan.subdevices, MS));
            world.compare_tries();
            let mark = world.mark();
            world.run_cycles(100);
            assert_eq!(world.incomplete(mark), 0, "buffers are emptied and filled in each cycle");
            world.evaluate_latched(false);
            for cable in 1..kinds.len() {
                for direction in Direction::ALL {
                    let (before, spared) = (latched(&world), world.spared());
                    let tries = world.application().cyclic_counters().sent_again;
                    world.fault(Fault::Drop { cable: CableId(cable), direction: Some(direction), count: 1 });
                    world.run_cycles(3);
                    let what = format!("cable {cable}, {direction:?}, ring {in_ring}, every second from {first}");
                    let taken: Vec<u64> =
                        latched(&world).iter().zip(before).map(|(now, before)| now - before).collect();
                    let most = |device: usize| if device % 2 == first { 3 } else { 4 };
                    assert!((0..kinds.len()).all(|device| taken[device] <= most(device)), "{what}: {taken:?}");
                    let sent_again = world.application().cyclic_counters().sent_again - tries;
                    assert!(sent_again == 0 || world.spared() > spared, "{what}: their areas were not in the try");
                    world.run_cycles(20);
                }
            }
            assert!(world.application().cyclic_counters().sent_again > 3, "ring {in_ring}");
            let mark = world.mark();
            world.run_cycles(20);
            assert_eq!((world.incomplete(mark), world.left_op(world.beginning())), (0, vec![]));
        }
    }
}

// covers: lost-frames
#[test]
fn outputs_of_subdevices_with_sync_signals_are_not_repeated_across_sync0() {
    let (mut saved, mut refused) = (0, 0);
    for shift_ns in (0..1_000_000).step_by(50_000) {
        let network = line(descriptions(&["servo"; 3]), NetworkOptions::default());
        let mut world = world(network, |scan| {
            let mut declaration = automatic(&scan.subdevices, MS);
            declaration.clocks = Some(ClockConfig::default());
            for subdevice in &mut declaration.subdevices {
                subdevice.sync = Some(SyncSignals::sync0(1_000_000, shift_ns));
            }
            declaration
        });
        world.evaluate_latched(false);
        let before = world.application().cyclic_counters();
        world.fault(Fault::Drop { cable: CableId(1), direction: Some(Direction::AToB), count: 1 });
        world.run_cycles(10);
        let after = world.application().cyclic_counters();
        assert_eq!(after.saved - before.saved, after.sent_again - before.sent_again, "shift {shift_ns} ns");
        saved += after.saved - before.saved;
        refused += u64::from(after.sent_again == before.sent_again);
    }
    println!("{saved} saved, {refused} refused");
    assert!(saved >= 10 && refused >= 1 && saved + refused == 20, "{saved} {refused}");
}

/// Found by a random run: while a SubDevice is absent, the cycle of its domain is incomplete though all frames are
/// back, and the wire was kept free for a second try that never left. The SubDevice was never read then.
// covers: lost-frames, byte-budget
#[test]
fn a_subdevice_returns_beside_incomplete_cycles_that_are_not_sent_again() {
    scenarios::short_runs::run(8776);
}
