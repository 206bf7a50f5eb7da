//! Several cycles of a domain under way: round trips longer than a cycle, breaks and losses meanwhile.

use std::time::Duration;

use ringcat::Direction::Inputs;
use ringcat::{DomainId, DomainState, Event, Freshness, JunctionMode, Options, RingState, SubDeviceId, automatic};
use ringcat_engine::main_device::AreaEntries;
use ringcat_sim::application::behaviours::{Behaviour, InputSource};
use ringcat_sim::cable::{CableId, Direction};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::check::troubles;
use scenarios::dice::Dice;
use scenarios::segments::{
    RING_BEHIND_JUNCTION, RING_IN_RING, RING_OF_THREE, TWO_RINGS, descriptions, line, ring, wired_with,
};
use scenarios::world::{CYCLE, World};

const DOMAIN: DomainId = DomainId(0);
const KINDS: [&str; 5] =
    ["digital-input-8", "digital-output-8", "digital-input-16", "emulated-input-8", "analog-input-4"];
/// A round trip through segment and host that takes three cycles.
const LONG: Duration = Duration::from_micros(2_600);

/// Cycles in which frames to a returned SubDevice may still deliver its former inputs.
const AGAIN: u64 = 4;

/// Inputs are the number of the cycle in which they were read, without its upper bits.
fn stamp(now: SimTime, _outputs: &[u8], inputs: &mut [u8]) {
    inputs.fill((now.0 / CYCLE.as_nanos() as u64) as u8);
}

/// Terminals of these kinds stamp their inputs.
fn stamping(kinds: &[&str]) -> Vec<DeviceDescription> {
    let mut described = descriptions(kinds);
    for it in &mut described {
        if let Behaviour::Terminal(source) = &mut it.behaviour {
            *source = InputSource::Function(stamp);
        }
    }
    described
}

fn segment(closed: bool) -> Network {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    let described = stamping(&KINDS);
    if closed { ring(described, options) } else { line(described, options) }
}

/// A world in OP that checks the age of inputs.
struct Stamped {
    world: World,
    at: usize,
    stamp: u8,
    /// Age of the inputs in cycles.
    age: u8,
    oldest: u8,
    /// Inputs of all SubDevices, and the maximum age of fresh ones.
    inputs: Vec<Input>,
    oldest_fresh: u8,
}

/// Inputs of a SubDevice.
struct Input {
    subdevice: usize,
    /// Range in the image.
    at: usize,
    /// Consecutive cycles with fresh inputs.
    fresh_for: u64,
}

impl Stamped {
    fn new(seed: u64, closed: bool, under_way: u8) -> Stamped {
        Stamped::on(seed, segment(closed), under_way)
    }

    fn on(seed: u64, network: Network, under_way: u8) -> Stamped {
        let options = Options::default().with_junctions(JunctionMode::Automatic);
        let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE).with_under_way(under_way);
        let mut world = World::with(seed, network, &options, declare).expect("it fits");
        world.settle();
        // Its checks assume one cycle under way.
        world.evaluate_latched(false);
        let directory = world.application().directory();
        let all = (0..world.scan.subdevices.len()).flat_map(|subdevice| directory.areas(SubDeviceId(subdevice)));
        let inputs = all.filter(|area| area.direction == Inputs && area.placed.area.length > 0);
        let input = |area: &AreaEntries| Input {
            subdevice: area.placed.area.subdevice,
            at: area.placed.image_offset as usize,
            fresh_for: 0,
        };
        let inputs: Vec<Input> = inputs.map(input).collect();
        let at = inputs.first().expect("one has inputs").at;
        let mut stamped = Stamped { world, at, stamp: 0, age: 0, oldest: 0, inputs, oldest_fresh: 0 };
        stamped.stamp = stamped.look();
        stamped
    }

    /// Checks the age of fresh inputs. Devices compute their inputs after each exchange, so a SubDevice that was
    /// unreachable has old inputs for the first frames after its return.
    fn look_at_all(&mut self, now: u8) {
        let exchange = self.world.application().exchange();
        for input in &mut self.inputs {
            let is_fresh = exchange.freshness(DOMAIN, SubDeviceId(input.subdevice)) == Freshness::Fresh;
            input.fresh_for = if is_fresh { input.fresh_for + 1 } else { 0 };
            if input.fresh_for > AGAIN {
                self.oldest_fresh = self.oldest_fresh.max(now.wrapping_sub(exchange.image(DOMAIN)[input.at]));
            }
        }
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
            self.look_at_all(now as u8);
        }
    }

    /// From now on sent frames take this much longer.
    fn lengthen(&mut self, by: Duration) {
        let (cable, direction) = (CableId(0), Some(Direction::AToB));
        self.world.fault(Fault::Delay { cable, direction, count: u32::MAX, by });
    }

    fn incomplete(&self) -> u64 {
        self.world.application().cyclic_counters().incomplete
    }

    /// Two cables are cut at once and repaired one after the other.
    fn cut_two(&mut self, first: CableId, second: CableId) {
        self.world.cut(first);
        self.world.cut(second);
        self.run(100);
        self.world.heal(first);
        self.run(100);
        self.world.heal(second);
        self.run(100);
    }
}

// covers: under-way
#[test]
fn a_round_trip_of_three_cycles_costs_none_with_four_under_way() {
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

// covers: CR-04, CR-06, CR-07, under-way
#[test]
fn a_break_and_its_repair_cost_at_most_the_cycles_under_way() {
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

// covers: under-way
#[test]
fn inputs_never_become_older_through_breaks_and_are_complete_after() {
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
        let status = stamped.world.application().exchange().status(DOMAIN).expect("it is declared");
        assert_eq!((stamped.incomplete() - before, status.state), (0, DomainState::Complete), "seed {seed}");
        assert_eq!(stamped.world.left_op(mark), [], "seed {seed}");
        assert!(stamped.world.application().cyclic_counters().incomplete > 0, "seed {seed}: nothing was lost");
    }
}

/// Rings behind junctions break and are repaired, one cable or two at once, on one link and on two: at most the cycles
/// under way are lost, and fresh inputs are no older than these.
// covers: JR-02, under-way
#[test]
fn breaks_behind_junctions_cost_the_cycles_under_way_and_no_more() {
    let kinds = ["digital-input-8", "junction", "digital-input-8", "digital-input-16", "digital-input-8"];
    let one = [
        "digital-input-8",
        "junction",
        "digital-input-8",
        "digital-input-16",
        "digital-input-8",
        "coupler",
        "digital-input-8",
    ];
    let two = [
        "junction",
        "digital-input-8",
        "digital-input-16",
        "junction",
        "digital-input-8",
        "digital-input-16",
        "digital-input-8",
    ];
    for (under_way, way) in [(2, CYCLE * 3 / 4), (3, CYCLE * 7 / 4)] {
        for (number, network, cables, pairs) in [
            (0, wired_with(stamping(&one), &RING_BEHIND_JUNCTION), RING_OF_THREE.to_vec(), vec![(3, 4), (2, 5)]),
            (1, wired_with(stamping(&kinds), &RING_IN_RING), (0..7).collect(), vec![(5, 3), (1, 3), (3, 1), (2, 4)]),
            (2, wired_with(stamping(&two), &TWO_RINGS), vec![1, 2, 3, 5, 6, 7], vec![(2, 6), (6, 2), (1, 7)]),
        ] {
            let mut stamped = Stamped::on(number, network, under_way);
            stamped.lengthen(way);
            stamped.run(20);
            let mark = stamped.world.mark();
            for cable in cables.into_iter().map(CableId) {
                for fault in [Fault::Cut(cable), Fault::Heal(cable)] {
                    let before = stamped.incomplete();
                    stamped.world.fault(fault.clone());
                    stamped.run(60);
                    let cost = stamped.incomplete() - before;
                    assert!(
                        cost <= u64::from(under_way),
                        "{number}, {under_way} under way, {way:?}, {fault:?}: {cost}"
                    );
                }
            }
            assert_eq!(stamped.world.left_op(mark), []);
            for (first, second) in pairs {
                stamped.cut_two(CableId(first), CableId(second));
                let before = stamped.incomplete();
                stamped.run(50);
                let oldest = stamped.oldest_fresh;
                println!("{number}, {under_way}, {way:?}, {first} and {second}: {oldest}");
                assert!(oldest <= under_way + 1, "{number}, {first} and {second}: {oldest} cycles old");
                assert_eq!(stamped.incomplete() - before, 0, "{number}, {first} and {second}");
            }
        }
    }
}
