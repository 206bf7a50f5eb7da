//! Random faults of a ring of two, one after the other, each repaired before the next one: the INACTIVE is killed,
//! hangs, loses its power, cables are cut, frames are lost.

use std::ops::Range;
use std::time::Duration;

use ringcat::RingState;
use ringcat_sim::cable::{CableId, Host};
use ringcat_sim::fault::Fault;
use ringcat_sim::host::program::TurnAround;
use ringcat_sim::network::Network;
use ringcat_sim::network::NetworkOptions;
use ringcat_sim::network::builder::SegmentBuilder;
use scenarios::dice::Dice;
use scenarios::pair::{CYCLE, Pair};
use scenarios::seeds;
use scenarios::segments::{descriptions, devices};

use super::{GUARD, KINDS};

/// Cycles between a fault and its end, and after it.
const CALM: u32 = 60;
/// Faults of a run.
const FAULTS: u32 = 6;

/// What happens.
#[derive(Clone, Copy, Debug)]
enum Trouble {
    Cut(usize),
    /// Frames are lost on a cable.
    Losses(usize, u32),
    StandbyKilled,
    /// For so many microseconds.
    StandbyHangs(u64),
    StandbyOff,
    StandbyEnds,
}

fn any_trouble(dice: &mut Dice, cables: usize) -> Trouble {
    let cable = dice.below(cables as u64) as usize;
    match dice.below(7) {
        0 | 1 => Trouble::Cut(cable),
        2 => Trouble::Losses(cable, 1 + dice.below(5) as u32),
        3 => Trouble::StandbyKilled,
        4 => Trouble::StandbyHangs(100 + dice.below(20_000)),
        5 => Trouble::StandbyOff,
        _ => Trouble::StandbyEnds,
    }
}

fn segment(dice: &mut Dice, seed: u64) -> Network {
    let count = 1 + dice.below(10) as usize;
    let kinds: Vec<&str> = (0..count).map(|_| *dice.pick(&KINDS)).collect();
    let detection = Duration::from_micros(*dice.pick(&[10, 300]));
    let options = NetworkOptions::default().with_seed(seed).with_detection_delay(detection);
    let near = *dice.pick(&Host::ALL);
    let devices = devices(descriptions(&kinds));
    SegmentBuilder::ring_of_two(devices, near).options(options).build().expect("the cables fit")
}

fn down(network: &mut Network) {
    Host::Second.links().into_iter().for_each(|link| network.disconnect(link, true));
}

/// Ends a trouble.
fn mend(pair: &mut Pair, trouble: Trouble) {
    match trouble {
        Trouble::Cut(cable) => pair.heal(cable),
        Trouble::Losses(cable, _) => pair.fault(Fault::Drop { cable: CableId(cable), direction: None, count: 0 }),
        Trouble::StandbyHangs(_) if !pair.hosts().guard_has_acted(Host::Second) => {}
        Trouble::StandbyOff => {
            pair.hosts().with_network(down);
            pair.fault(Fault::PowerHostOn(Host::Second));
            restart(pair);
        }
        Trouble::StandbyKilled | Trouble::StandbyHangs(_) | Trouble::StandbyEnds => restart(pair),
    }
}

fn restart(pair: &mut Pair) {
    pair.hosts().dismiss_guard(Host::Second);
    pair.start_standby(Host::Second);
    pair.run_cycles(1);
    pair.hosts().guard(Host::Second, GUARD);
}

fn begin(pair: &mut Pair, trouble: Trouble, moment: Duration) {
    match trouble {
        Trouble::Cut(cable) => pair.fault_in(moment, Fault::Cut(CableId(cable))),
        Trouble::Losses(cable, count) => {
            pair.fault_in(moment, Fault::Drop { cable: CableId(cable), direction: None, count });
        }
        Trouble::StandbyKilled => {
            pair.hosts().run_for(moment);
            pair.kill(Host::Second);
        }
        Trouble::StandbyHangs(us) => {
            pair.fault_in(moment, Fault::StopHost(Host::Second, true));
            pair.fault_in(moment + Duration::from_micros(us), Fault::StopHost(Host::Second, false));
        }
        Trouble::StandbyOff => pair.fault_in(moment, Fault::PowerHostOff(Host::Second)),
        Trouble::StandbyEnds => {
            pair.hosts().dismiss_guard(Host::Second);
            pair.stop(Host::Second);
        }
    }
}

/// Cycles that a trouble may cost.
fn allowed(trouble: Trouble) -> u64 {
    match trouble {
        Trouble::Losses(_, count) => u64::from(count) + 1,
        // The guard, the detection of the link, and the cycles at either edge.
        Trouble::StandbyKilled | Trouble::StandbyHangs(_) => 5,
        _ => 3,
    }
}

fn run(seed: u64) {
    let mut dice = Dice::new(seed);
    let network = segment(&mut dice, seed);
    let cables = network.cables().len();
    let mut pair = Pair::without_programs(seed, network);
    let least = Duration::from_micros(dice.below(20));
    pair.set_turn_around(TurnAround { least, most: least + Duration::from_micros(dice.below(60)) });
    pair.start_standby(Host::Second);
    pair.start_active(Host::First);
    pair.settle();
    pair.hosts().guard(Host::Second, GUARD);
    for _ in 0..FAULTS {
        let trouble = any_trouble(&mut dice, cables);
        let moment = Duration::from_nanos(dice.below(CYCLE.as_nanos() as u64));
        let before = pair.incomplete(Host::First);
        pair.say(format!("{trouble:?} in {moment:?}"));
        begin(&mut pair, trouble, moment);
        pair.run_cycles(CALM);
        let lost = pair.incomplete(Host::First) - before;
        assert!(lost <= allowed(trouble), "{trouble:?}: {lost} cycles\n{}", pair.log());
        let before = pair.incomplete(Host::First);
        mend(&mut pair, trouble);
        pair.run_cycles(CALM);
        let lost = pair.incomplete(Host::First) - before;
        assert!(lost <= 3 && pair.all_in_op(), "{trouble:?} is over: {lost} cycles\n{}", pair.log());
        assert_eq!(pair.ring(Host::First), RingState::Closed, "{trouble:?} is over\n{}", pair.log());
    }
    assert!(pair.checked_passes() > 0);
}

/// Runs seeds; a failing one prints itself.
fn run_all(seeds: Range<u64>) {
    seeds.for_each(run);
}

// covers: standby
#[test]
fn seeds_0_to_20_hold_under_faults_of_the_standby_and_the_cables() {
    run_all(0..20);
}

// covers: standby
#[test]
fn seeds_from_the_environment_hold() {
    if let Some(seeds) = seeds::from_environment() {
        run_all(seeds);
    }
}
