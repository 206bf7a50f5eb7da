//! Cables that are cut and repaired within milliseconds during frame loss: no false crossed line is reported in a ring,
//! and a real one is reported (protocol 9.5).
//!
//! `SEED=0..2000 cargo test -p scenarios --test virtual_time false_crossings::seeds -- --nocapture` runs many.

use std::time::Duration;

use ringcat::{Event, Options, Scan, automatic};
use ringcat_sim::cable::{CableId, Direction, Endpoint};
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{MAIN, REDUNDANT, at, descriptions, devices};
use scenarios::world::{CYCLE, World};

use super::explorer::from_environment;

const KINDS: [&str; 6] = ["coupler", "digital-input-8", "digital-output-8", "servo", "junction", "emulated-output-8"];

/// Faults of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// Cuts and losses in OP.
    InOp,
    /// The same, with enhanced detection that takes the redundant link down.
    Enhanced,
    /// Cuts and losses while the segment is scanned.
    Scan,
    /// As in OP, with one crossed SubDevice.
    Crossed,
}

/// Single frames are lost within the next millisecond, with a probability of one in `n`.
fn lose_frames(dice: &mut Dice, cables: usize, one_in: u64) -> Option<(Duration, Fault)> {
    dice.one_in(one_in).then(|| {
        let cable = CableId(dice.below(cables as u64) as usize);
        let direction = *dice.pick(&[None, Some(Direction::AToB), Some(Direction::BToA)]);
        (Duration::from_micros(dice.below(1_000)), Fault::Drop { cable, direction, count: 1 })
    })
}

/// A cut and, some time later, the repair.
fn cut_and_heal(dice: &mut Dice, cables: usize) -> [(Duration, Fault); 2] {
    let cable = CableId(dice.below(cables as u64) as usize);
    let begin = Duration::from_micros(dice.below(1_000));
    let gap = *dice.pick(&[500, 3_000, 12_000, 40_000]);
    let end = begin + Duration::from_micros(1 + dice.below(gap));
    [(begin, Fault::Cut(cable)), (end, Fault::Heal(cable))]
}

/// A ring of these kinds, with at most one crossed SubDevice.
fn segment(kinds: &[&str], crossed: Option<usize>, options: NetworkOptions) -> Network {
    let ports = |device: usize| if crossed == Some(device) { [Port::B, Port::A] } else { [Port::A, Port::B] };
    let builder = devices(descriptions(kinds)).into_iter().fold(SegmentBuilder::new(), SegmentBuilder::device);
    let begin = |device: usize| if device == kinds.len() { REDUNDANT } else { at(device, ports(device)[0]) };
    let end = |cable: usize| -> Endpoint { cable.checked_sub(1).map_or(MAIN, |device| at(device, ports(device)[1])) };
    let cabled = (0..=kinds.len()).fold(builder, |builder, cable| builder.cable(end(cable), begin(cable)));
    cabled.options(options).build().expect("a ring")
}

/// False and missing reports.
fn run(seed: u64, course: Course) -> Vec<String> {
    let mut dice = Dice::new(seed);
    let kinds: Vec<&str> = (0..3 + dice.below(8)).map(|_| *dice.pick(&KINDS)).collect();
    let crossed = (course == Course::Crossed).then(|| dice.below(kinds.len() as u64) as usize);
    let detection = Duration::from_micros(*dice.pick(&[10, 100, 1_000, 3_000]));
    let options = NetworkOptions::default().with_seed(seed).with_detection_delay(detection);
    let cables = kinds.len() + 1;
    let mut network = segment(&kinds, crossed, options);
    let one_in = *dice.pick(&[2, 5, 20]);
    if course == Course::Scan {
        let cuts =
            cut_and_heal(&mut dice, cables).map(|(at, fault)| (at + Duration::from_millis(dice.below(25)), fault));
        for (at, fault) in cuts {
            network.schedule(SimTime::ZERO + at, fault);
        }
        for millisecond in 0..60 {
            if let Some((at, fault)) = lose_frames(&mut dice, cables, one_in) {
                network.schedule(SimTime::ZERO + Duration::from_millis(millisecond) + at, fault);
            }
        }
    }
    let options = Options::default().with_enhanced_line_crossed(course == Course::Enhanced);
    let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE).with_sends_again(seeds::sends_again(seed));
    let mut world = World::with(seed, network, &options, declare).expect("activation");
    // Lost copies change the devices; freshness is checked in other scenarios.
    world.evaluate_latched(false);
    if course == Course::Scan {
        world.run_cycles(80);
    } else {
        world.settle();
        for _ in 0..8 {
            cut_and_heal(&mut dice, cables).into_iter().for_each(|(at, fault)| world.fault_in(at, fault));
            for _ in 0..45 {
                if let Some((at, fault)) = lose_frames(&mut dice, cables, one_in) {
                    world.fault_in(at, fault);
                }
                world.cycle();
            }
        }
        world.run_cycles(100);
    }
    let position = |device: usize| (0..kinds.len()).find(|it| world.device_of(*it).map(|it| it.0) == Some(device));
    let truth = crossed.map(|device| position(device).expect("it was scanned"));
    let said = world.events(world.beginning()).iter().filter_map(|timed| match timed.event {
        Event::LineCrossed { position, .. } => Some(position.map(|it| usize::from(it.0))),
        Event::InterfacesSwapped => Some(Some(usize::MAX)),
        _ => None,
    });
    let said: Vec<Option<usize>> = said.collect();
    let is_true = |place: &Option<usize>| truth.is_some() && (place.is_none() || *place == truth);
    let all_said = truth.is_none() || !said.is_empty();
    let is_well = said.iter().all(is_true) && said.len() <= 2 && all_said;
    if is_well { Vec::new() } else { vec![format!("{course:?}, seed {seed}: crossed {truth:?}, said {said:?}")] }
}

const COURSES: [Course; 4] = [Course::InOp, Course::Enhanced, Course::Scan, Course::Crossed];

// covers: LC-01, crossed-lines
#[test]
fn short_cuts_under_frame_loss_report_no_crossed_line() {
    let reports: Vec<String> = (0..150).flat_map(|seed| run(seed, Course::InOp)).collect();
    assert_eq!(reports, Vec::<String>::new());
}

// covers: LC-03, crossed-lines
#[test]
fn short_cuts_with_enhanced_detection_and_at_the_scan_cross_no_line() {
    let both = |seed| [Course::Enhanced, Course::Scan].into_iter().flat_map(move |course| run(seed, course));
    let reports: Vec<String> = (0..75).flat_map(both).collect();
    assert_eq!(reports, Vec::<String>::new());
}

// covers: LC-01, crossed-lines
#[test]
fn a_crossed_line_is_reported_in_spite_of_cuts_and_loss() {
    let reports: Vec<String> = (0..75).flat_map(|seed| run(seed, Course::Crossed)).collect();
    assert_eq!(reports, Vec::<String>::new());
}

#[test]
fn seeds_from_the_environment() {
    let all = |seed| COURSES.into_iter().flat_map(move |course| run(seed, course));
    from_environment(
        |seed| assert_eq!(all(seed).collect::<Vec<_>>(), Vec::<String>::new()),
        |seeds| assert_eq!(seeds.flat_map(all).collect::<Vec<String>>(), Vec::<String>::new()),
    );
}
