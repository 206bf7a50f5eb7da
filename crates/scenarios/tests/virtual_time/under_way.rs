//! Several cycles of a domain under way: ways that are longer than a cycle, breaks and losses meanwhile.

use std::time::Duration;

use ringcat::{DomainId, DomainState, Event, Options, RingState, automatic};
use ringcat_sim::application::behaviours::{Behaviour, InputSource};
use ringcat_sim::cable::{CableId, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::check::troubles;
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::{CYCLE, World};

const DOMAIN: DomainId = DomainId(0);
const KINDS: [&str; 5] =
    ["digital-input-8", "digital-output-8", "digital-input-16", "emulated-input-8", "analog-input-4"];
/// A way through segment and host that takes three cycles.
const LONG: Duration = Duration::from_micros(2_600);

/// Inputs are the number of the cycle in which they were read, without its upper bits.
fn stamp(now: SimTime, _outputs: &[u8], inputs: &mut [u8]) {
    inputs.fill((now.0 / CYCLE.as_nanos() as u64) as u8);
}

/// Its terminals stamp their inputs.
fn segment(closed: bool) -> Network {
    let mut described = descriptions(&KINDS);
    for it in &mut described {
        if let Behaviour::Terminal(source) = &mut it.behaviour {
            *source = InputSource::Function(stamp);
        }
    }
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    if closed { ring(described, options) } else { line(described, options) }
}

/// A world in OP that looks at how old the first SubDevice's inputs are.
struct Stamped {
    world: World,
    at: usize,
    stamp: u8,
    /// Cycles that they are older than the cycle in which they are seen.
    age: u8,
    oldest: u8,
}

impl Stamped {
    fn new(seed: u64, closed: bool, under_way: u8) -> Stamped {
        let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE).with_under_way(under_way);
        let mut world = World::with(seed, segment(closed), &Options::default(), declare).expect("it fits");
        world.settle();
        // Its checks know of one cycle under way.
        world.set_strict(false);
        let inputs = world.application().directory().areas(0).iter().find(|area| area.placed.area.length > 0);
        let at = inputs.expect("it has inputs").placed.image_offset as usize;
        let mut stamped = Stamped { world, at, stamp: 0, age: 0, oldest: 0 };
        stamped.stamp = stamped.look();
        stamped
    }

    fn look(&self) -> u8 {
        self.world.application().exchange().image(DOMAIN)[self.at]
    }

    fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.world.cycle();
            let (stamp, now) = (self.look(), self.world.now().0 / CYCLE.as_nanos() as u64);
            assert!(stamp.wrapping_sub(self.stamp) < 0x80, "inputs of {stamp} behind those of {}", self.stamp);
            self.stamp = stamp;
            self.age = (now as u8).wrapping_sub(stamp);
            self.oldest = self.oldest.max(self.age);
        }
    }

    /// Frames out to the segment take so much longer from now on.
    fn lengthen(&mut self, by: Duration) {
        let (cable, direction) = (CableId(0), Some(Direction::AToB));
        self.world.fault(Fault::Delay { cable, direction, count: u32::MAX, by });
    }

    fn incomplete(&self) -> u64 {
        self.world.application().cyclic_counters().incomplete
    }
}

#[test]
fn a_way_of_three_cycles_costs_two_of_three_with_one_under_way_and_none_with_four() {
    for (under_way, most_skipped, least_skipped) in [(1, 140, 120), (4, 0, 0)] {
        let mut stamped = Stamped::new(1, false, under_way);
        stamped.world.application_mut().exchange_mut().set_timeout(DOMAIN, 4 * CYCLE);
        stamped.lengthen(LONG);
        stamped.run(10);
        let before = stamped.world.application().cyclic_counters();
        stamped.oldest = 0;
        stamped.run(200);
        let after = stamped.world.application().cyclic_counters();
        let skipped = after.skipped - before.skipped;
        assert!((least_skipped..=most_skipped).contains(&skipped), "{under_way} under way: {skipped} skipped");
        assert_eq!(after.incomplete - before.incomplete, 0, "{under_way} under way");
        assert_eq!(after.sent - before.sent, 200 - skipped, "{under_way} under way");
        assert!(stamped.oldest <= if under_way == 4 { 4 } else { 6 }, "{under_way}: {} cycles old", stamped.oldest);
        assert_eq!(stamped.world.left_op(stamped.world.beginning()), []);
    }
}

// Facts CR-04, CR-06, CR-07.
#[test]
fn a_break_and_its_mending_cost_at_most_the_cycles_that_are_under_way() {
    for (under_way, way) in [(2, Duration::ZERO), (2, CYCLE * 3 / 4), (3, CYCLE * 7 / 4)] {
        let mut stamped = Stamped::new(u64::from(under_way), true, under_way);
        stamped.lengthen(way);
        stamped.run(20);
        let mark = stamped.world.mark();
        for cable in (0..=KINDS.len()).map(CableId) {
            for fault in [Fault::Cut(cable), Fault::Heal(cable)] {
                let before = stamped.incomplete();
                stamped.world.fault(fault.clone());
                stamped.run(30);
                let cost = stamped.incomplete() - before;
                assert!(cost <= u64::from(under_way), "{under_way} under way, {way:?}, {fault:?}: {cost}");
            }
            assert_eq!(stamped.world.application().ring(), RingState::Closed);
        }
        assert_eq!(stamped.world.left_op(mark), []);
        assert_eq!(troubles(stamped.world.events(mark)), Vec::<&Event>::new());
        assert_eq!(stamped.world.application().cyclic_counters().skipped, 0);
    }
}

#[test]
fn whatever_is_lost_or_broken_inputs_never_become_older_and_afterwards_all_is_complete() {
    for seed in 0..8 {
        println!("seed {seed}");
        let mut dice = Dice::new(seed);
        let under_way = 2 + dice.below(3) as u8;
        let closed = !dice.one_in(4);
        let mut stamped = Stamped::new(seed, closed, under_way);
        stamped.lengthen(CYCLE * dice.below(u64::from(under_way - 1) * 4) as u32 / 4);
        stamped.run(10);
        let mark = stamped.world.mark();
        let mut broken = None;
        for _ in 0..60 {
            let cable = CableId(dice.below(KINDS.len() as u64 + u64::from(closed)) as usize);
            let direction = *dice.pick(&[None, Some(Direction::AToB), Some(Direction::BToA)]);
            let count = 1 + dice.below(3) as u32;
            let fault = match dice.below(4) {
                0 => Fault::Drop { cable, direction, count },
                1 => Fault::Duplicate { cable, direction, count },
                2 => Fault::Corrupt { cable, direction, count },
                _ if !closed => continue,
                _ => match broken.take() {
                    Some(cable) => Fault::Heal(cable),
                    None => Fault::Cut(*broken.insert(cable)),
                },
            };
            stamped.world.fault_in(Duration::from_micros(dice.below(1_000)), fault);
            stamped.run(1 + dice.below(6));
        }
        broken.into_iter().for_each(|cable| stamped.world.heal(cable));
        for cable in (0..KINDS.len() + usize::from(closed)).map(CableId) {
            for direction in [None, Some(Direction::AToB), Some(Direction::BToA)] {
                stamped.world.fault(Fault::Drop { cable, direction, count: 0 });
                stamped.world.fault(Fault::Corrupt { cable, direction, count: 0 });
                stamped.world.fault(Fault::Duplicate { cable, direction, count: 0 });
            }
        }
        stamped.run(50);
        let before = stamped.incomplete();
        stamped.run(50);
        let status = stamped.world.application().exchange().status(DOMAIN);
        assert_eq!((stamped.incomplete() - before, status.state), (0, DomainState::Complete), "seed {seed}");
        assert_eq!(stamped.world.left_op(mark), [], "seed {seed}");
        assert!(stamped.world.application().cyclic_counters().incomplete > 0, "seed {seed}: nothing was lost");
    }
}
