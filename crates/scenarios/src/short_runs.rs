//! Short seeded runs of small rings: cuts, repairs, losses, delays and power cycles at random, and at the end all
//! SubDevices are in OP again ([`run`]). Ten thousand runs take about a minute.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use ringcat::{Event, Options, Redundancy, RingState, Scan, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;

use crate::check::{Delivery, ring_events};
use crate::dice::Dice;
use crate::seeds;
use crate::segments::{descriptions, ring};
use crate::world::{CYCLE, World};

const KINDS: [&str; 7] = [
    "coupler",
    "digital-input-8",
    "digital-output-16",
    "emulated-output-8",
    "emulated-input-8",
    "analog-output-4",
    "digital-input-16",
];
/// Time limit of the recovery.
const RECOVERY: Duration = Duration::from_secs(12);

/// Runs a seed.
///
/// # Panics
/// When something does not hold.
pub fn run(seed: u64) {
    let mut dice = Dice::new(seed);
    let count = 2 + dice.below(5) as usize;
    let kinds: Vec<&str> = (0..count).map(|_| *dice.pick(&KINDS)).collect();
    let detection = Duration::from_micros(*dice.pick(&[10, 200, 1_500]));
    let options = NetworkOptions::default().with_seed(seed).with_detection_delay(detection);
    let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE).with_sends_again(seeds::sends_again(seed));
    let mut world = World::with(seed, ring(descriptions(&kinds), options), &Options::default(), declare)
        .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    world.settle();
    // Late and duplicated frames change the devices.
    world.evaluate_latched(false);
    let mut cut: Option<CableId> = None;
    let mut off: Option<DeviceIndex> = None;
    for _ in 0..3 + dice.below(6) {
        let fault = next_fault(&mut dice, count, &mut cut, &mut off);
        world.fault_in(Duration::from_micros(dice.below(1_000)), fault);
        world.run_cycles(1 + dice.below(10));
    }
    for cable in (0..=count).map(CableId) {
        world.fault(Fault::Drop { cable, direction: None, count: 0 });
        world.fault(Fault::Duplicate { cable, direction: None, count: 0 });
        world.fault(Fault::Corrupt { cable, direction: None, count: 0 });
        world.fault(Fault::Delay { cable, direction: None, count: 0, by: Duration::ZERO });
    }
    cut.into_iter().for_each(|cable| world.heal(cable));
    off.into_iter().for_each(|device| world.power_on(device));
    world.until(RECOVERY, "all back", |world| {
        let complete =
            world.evaluated(world.beginning()).last().is_some_and(|evaluated| evaluated.delivery == Delivery::Complete);
        let redundancy = world.application().ring_status().redundancy;
        let settled = world.all_in_op() && world.application().all_settled();
        settled && complete && world.application().ring() == RingState::Closed && redundancy == Redundancy::Ready
    });
    // Wait for delayed frames and for the end of the ring's damping.
    world.run_cycles(40);
    world.evaluate_latched(true);
    let mark = world.mark();
    world.run_cycles(15);
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
    let reports = ring_events(world.events(world.beginning()));
    changes_alternate(reports);
    assert!(world.application().pace().skipped == 0 && world.now().0 > CYCLE.as_nanos() as u64);
}

/// A fault of the cables or devices, or the end of a lasting fault.
fn next_fault(dice: &mut Dice, count: usize, cut: &mut Option<CableId>, off: &mut Option<DeviceIndex>) -> Fault {
    let cable = CableId(dice.below(count as u64 + 1) as usize);
    let direction = *dice.pick(&[None, Some(Direction::AToB), Some(Direction::BToA)]);
    let few = 1 + dice.below(3) as u32;
    match dice.below(9) {
        0..=3 => match cut.take() {
            Some(cable) => Fault::Heal(cable),
            None => Fault::Cut(*cut.insert(cable)),
        },
        4 => Fault::Drop { cable, direction, count: few },
        5 => Fault::Corrupt { cable, direction, count: few },
        6 => Fault::Delay { cable, direction, count: few, by: Duration::from_micros(dice.below(3_000)) },
        7 => Fault::Duplicate { cable, direction, count: few },
        _ => match off.take() {
            Some(device) => Fault::PowerOn(device),
            None => Fault::PowerOff(*off.insert(DeviceIndex(dice.below(count as u64) as usize))),
        },
    }
}

/// The ring opens and closes alternately, and is closed at the end.
fn changes_alternate<'a>(reports: impl IntoIterator<Item = &'a Event>) {
    // Each change is reported once: never the same twice in a row.
    let (mut is_open, mut edges) = (false, 0);
    for event in reports {
        match event {
            Event::RingOpened { .. } => assert!(!std::mem::replace(&mut is_open, true), "opened twice"),
            Event::RingClosed { .. } => assert!(std::mem::replace(&mut is_open, false), "closed twice"),
            _ => continue,
        }
        edges += 1;
    }
    assert!(!is_open && edges % 2 == 0);
}

/// Runs seeds; returns those that fail, each printed with its log.
pub fn runs(seeds: std::ops::Range<u64>) -> Vec<u64> {
    seeds.filter(|seed| catch_unwind(AssertUnwindSafe(|| run(*seed))).is_err()).collect()
}
