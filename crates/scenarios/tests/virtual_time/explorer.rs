//! Short runs of random segments under random faults, each from its seed: nothing panics, nothing hangs, and after the
//! end of the faults all SubDevices are in OP and all domains complete.
//!
//! `SEED=17 cargo test -p scenarios --test virtual_time explorer::seeds -- --nocapture` runs one seed,
//! `SEED=1000..2000` many.

use std::ops::Range;
use std::time::Duration;

use ringcat::{Event, Options, RingState};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::check::{Delivery, troubles};
use scenarios::dice::Dice;
use scenarios::one_buffer::{automatic, one_buffer};
use scenarios::seeds;
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 10] = [
    "coupler",
    "digital-input-8",
    "digital-output-16",
    "analog-input-4",
    "analog-output-4",
    "servo",
    "emulated-input-8",
    "emulated-output-8",
    "junction",
    "block",
];
/// Time limit of the recovery. The configuration of a SubDevice is retried after pauses of up to 5 s.
const RECOVERY: Duration = Duration::from_secs(12);

/// Active faults.
#[derive(Default)]
struct Broken {
    cut: Vec<CableId>,
    off: Vec<DeviceIndex>,
    hanging: Vec<DeviceIndex>,
    blocked: Option<(CableId, Direction)>,
}

/// Frames on a random cable are disturbed.
fn frame_fault(dice: &mut Dice, cables: usize) -> Fault {
    let cable = CableId(dice.below(cables as u64) as usize);
    let direction = *dice.pick(&[None, Some(Direction::AToB), Some(Direction::BToA)]);
    let count = 1 + dice.below(4) as u32;
    match dice.below(4) {
        0 => Fault::Drop { cable, direction, count },
        1 => Fault::Duplicate { cable, direction, count },
        2 => Fault::Corrupt { cable, direction, count },
        _ => {
            let longest = if dice.one_in(8) { 400_000 } else { 4_000 };
            Fault::Delay { cable, direction, count, by: Duration::from_micros(dice.below(longest)) }
        }
    }
}

fn toggled<T: Copy + PartialEq>(list: &mut Vec<T>, what: T, most: usize) -> Option<bool> {
    if let Some(at) = list.iter().position(|other| *other == what) {
        list.swap_remove(at);
        return Some(false);
    }
    let room = list.len() < most;
    if room {
        list.push(what);
    }
    room.then_some(true)
}

/// Starts or ends another fault.
fn any_fault(dice: &mut Dice, cables: usize, devices: usize, broken: &mut Broken) -> Fault {
    let cable = CableId(dice.below(cables as u64) as usize);
    let device = DeviceIndex(dice.below(devices as u64) as usize);
    let direction = *dice.pick(&Direction::ALL);
    let fault = match dice.below(8) {
        0 | 1 => toggled(&mut broken.cut, cable, 2).map(|cut| if cut { Fault::Cut(cable) } else { Fault::Heal(cable) }),
        2 => toggled(&mut broken.off, device, 2)
            .map(|off| if off { Fault::PowerOff(device) } else { Fault::PowerOn(device) }),
        3 => toggled(&mut broken.hanging, device, 1).map(|hangs| Fault::Hang(device, hangs)),
        4 => match broken.blocked.take() {
            Some((cable, direction)) => Some(Fault::OneWay { cable, direction, blocked: false }),
            None => {
                broken.blocked = Some((cable, direction));
                Some(Fault::OneWay { cable, direction, blocked: true })
            }
        },
        _ => None,
    };
    fault.unwrap_or_else(|| frame_fault(dice, cables))
}

/// Ends all faults.
fn mend(world: &mut World, broken: Broken) {
    let cables = world.network().cables().len();
    for cable in (0..cables).map(CableId) {
        world.fault(Fault::Drop { cable, direction: None, count: 0 });
        world.fault(Fault::Duplicate { cable, direction: None, count: 0 });
        world.fault(Fault::Corrupt { cable, direction: None, count: 0 });
        world.fault(Fault::Delay { cable, direction: None, count: 0, by: Duration::ZERO });
    }
    broken.cut.into_iter().for_each(|cable| world.heal(cable));
    broken.off.into_iter().for_each(|device| world.power_on(device));
    broken.hanging.into_iter().for_each(|device| world.hang(device, false));
    if let Some((cable, direction)) = broken.blocked {
        world.fault(Fault::OneWay { cable, direction, blocked: false });
    }
}

fn segment(dice: &mut Dice, seed: u64) -> (Network, bool) {
    let kinds: Vec<&str> = (0..3 + dice.below(8)).map(|_| *dice.pick(&KINDS)).collect();
    let detection = Duration::from_micros(*dice.pick(&[10, 300, 2_000, 10_000]));
    let options = NetworkOptions::default().with_seed(seed).with_detection_delay(detection);
    let closed = !dice.one_in(4);
    let mut described = descriptions(&kinds);
    for (number, description) in described.iter_mut().enumerate() {
        if seeds::one_buffer(seed, number) {
            *description = one_buffer(description.clone());
        }
    }
    let mut network = if closed { ring(described, options) } else { line(described, options) };
    if dice.one_in(3) {
        for _ in 0..1 + dice.below(8) {
            let at = SimTime::from_micros(dice.below(80_000));
            let cables = network.cables().len();
            network.schedule(at, frame_fault(dice, cables));
        }
    }
    (network, closed)
}

fn run(seed: u64) {
    let mut dice = Dice::new(seed);
    let (network, closed) = segment(&mut dice, seed);
    let options = Options::default().with_sii_cache(!dice.one_in(2));
    let mut world = World::with(seed, network, &options, |scan| {
        automatic(&scan.subdevices, CYCLE).with_sends_again(seeds::sends_again(seed))
    })
    .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    // Late and duplicated frames change the devices.
    world.evaluate_latched(false);
    let (cables, devices) = (world.network().cables().len(), world.network().devices().len());
    let mut broken = Broken::default();
    for _ in 0..10 + dice.below(40) {
        let fault = any_fault(&mut dice, cables, devices, &mut broken);
        world.fault_in(Duration::from_micros(dice.below(1_000)), fault);
        world.run_cycles(1 + dice.below(15));
    }
    mend(&mut world, broken);
    world.until(RECOVERY, "all back", |world| {
        let complete = world.evaluated(world.beginning()).last().is_some_and(|j| j.delivery == Delivery::Complete);
        let ring = if closed { world.application().ring() == RingState::Closed } else { true };
        world.all_in_op() && world.application().all_settled() && complete && ring
    });
    let mistaken: Vec<usize> =
        (0..devices).filter(|device| world.station_of(*device) != 0x1001 + *device as u16).collect();
    assert_eq!(mistaken, [], "each SubDevice has its former identity");
    // Long delayed frames are still outstanding.
    world.run_cycles(500);
    let mark = world.mark();
    world.evaluate_latched(true);
    world.run_cycles(100);
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
    assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new());
    let (links, late) = (world.application().links(), world.application().cyclic_counters().late);
    let expected = links.outdated()..=links.outdated() + links.superseded();
    assert!(expected.contains(&late), "old frames, and no others, are late: {late} of {expected:?}");
    assert!(seeds::sends_again(seed) || links.superseded() == 0, "{expected:?}");
}

fn runs(seeds: Range<u64>) {
    let again = seeds::sending_again(&seeds);
    println!("seeds {} to {}, {again} of them with lost frames sent again", seeds.start, seeds.end - 1);
    let failed: Vec<u64> = seeds.filter(|seed| std::panic::catch_unwind(|| run(*seed)).is_err()).collect();
    assert_eq!(failed, [], "seeds that fail");
}

// covers: robust
#[test]
fn all_subdevices_return_after_random_faults_seeds_0_to_99() {
    runs(0..100);
}

// covers: robust
#[test]
fn all_subdevices_return_after_random_faults_seeds_100_to_199() {
    runs(100..200);
}

// covers: robust
#[test]
fn all_subdevices_return_after_random_faults_seeds_200_to_299() {
    runs(200..300);
}

#[test]
fn seeds_from_the_environment() {
    from_environment(run, runs);
}

/// One seed or a range of them from the environment variable SEED.
pub(crate) fn from_environment(run: impl FnOnce(u64), runs: impl FnOnce(Range<u64>)) {
    match seeds::from_environment() {
        None => println!("skipped: no SEED given"),
        Some(seeds) if seeds.end - seeds.start == 1 => run(seeds.start),
        Some(seeds) => runs(seeds),
    }
}
