//! Random disturbances of segments with undeclared SubDevices of declared types: none gets the state of a declared one.
//!
//! `SEED=0..300 cargo test -p scenarios --test virtual_time twins::seeds -- --nocapture` runs many random segments.

use std::time::Duration;

use ringcat::{Options, Scan, automatic};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::device::Device;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{describe, descriptions, line, ring};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 3] = ["digital-output-8", "servo", "emulated-output-8"];
const LIMIT: Duration = Duration::from_secs(4);

#[derive(Clone, Copy, Debug)]
enum Disturbance {
    Power { device: usize, ms: u64 },
    Cable { cable: usize, ms: u64 },
    Drop { cable: usize, count: u32 },
}

/// A segment with declared and undeclared SubDevices of the same types.
struct Twins {
    world: World,
    declared: Vec<bool>,
    text: String,
}

impl Twins {
    fn of(seed: u64, dice: &mut Dice) -> Twins {
        let is_ring = dice.one_in(2);
        let size = 2 + dice.below(6) as usize;
        let kinds: Vec<&str> = (0..size).map(|_| KINDS[dice.below(2) as usize]).collect();
        let declared: Vec<bool> = (0..size).map(|at| at == 0 || dice.one_in(2)).collect();
        let with_idle = dice.one_in(2);
        let text = format!("seed {seed}, ring {is_ring}, idle {with_idle}, {kinds:?}, {declared:?}");
        let build = if is_ring { ring } else { line };
        let network = build(descriptions(&kinds), NetworkOptions::default());
        let declare = |scan: &Scan| {
            let found = scan.subdevices.iter().zip(&declared).filter(|(_, is)| **is).map(|(info, _)| info.clone());
            automatic(&found.collect::<Vec<_>>(), CYCLE)
        };
        let options = Options::default().with_idle_operation(with_idle);
        let mut world = World::with(seed, network, &options, declare).expect("scan and activation");
        world.settle();
        world.evaluate_latched(false);
        world.run_cycles(200);
        Twins { world, declared, text }
    }

    fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.world.run_cycles(1);
            for at in (0..self.declared.len()).filter(|at| !self.declared[*at]) {
                let status = self.world.network().device(DeviceIndex(at)).al_status();
                let is_left = matches!(status.al_state(), Some(AlState::Init | AlState::PreOp));
                assert!(is_left, "{}: SubDevice {at} is in {status}\n{}", self.text, self.world.log());
            }
        }
    }

    fn settle(&mut self) {
        let end = self.world.now().as_nanos() + LIMIT.as_nanos() as u64;
        while !self.is_settled() {
            assert!(
                self.world.now().as_nanos() < end,
                "{}: {}\n{}",
                self.text,
                self.world.condition(),
                self.world.log()
            );
            self.run(1);
        }
    }

    fn is_settled(&self) -> bool {
        let in_op = |at: usize| self.world.network().device(DeviceIndex(at)).al_status() == AlStatus::new(AlState::Op);
        self.world.application().all_settled() && (0..self.declared.len()).all(|at| !self.declared[at] || in_op(at))
    }

    fn disturb(&mut self, disturbance: Disturbance) {
        self.text = format!("{}\n  {disturbance:?}", self.text);
        match disturbance {
            Disturbance::Power { device, ms } => {
                self.world.power_off(DeviceIndex(device));
                self.run(ms);
                self.world.power_on(DeviceIndex(device));
            }
            Disturbance::Cable { cable, ms } => {
                self.world.cut(CableId(cable));
                self.run(ms);
                self.world.heal(CableId(cable));
            }
            Disturbance::Drop { cable, count } => {
                self.world.drop(CableId(cable), count);
                self.run(20);
            }
        }
    }
}

/// Power of members, cables and frames fail at random times, power of the others while nothing else does.
fn one(seed: u64) {
    let mut dice = Dice::new(seed);
    let mut twins = Twins::of(seed, &mut dice);
    let size = twins.declared.len();
    for _ in 0..4 {
        let ms = *dice.pick(&[1, 3, 10, 60, 300, 1_500]);
        let cable = dice.below(size as u64) as usize;
        let device = dice.below(size as u64) as usize;
        match dice.below(4) {
            0 => twins.disturb(Disturbance::Cable { cable, ms }),
            1 => twins.disturb(Disturbance::Drop { cable, count: 1 + dice.below(4) as u32 }),
            _ if twins.declared[device] => twins.disturb(Disturbance::Power { device, ms }),
            _ => {
                twins.settle();
                twins.run(200);
                twins.disturb(Disturbance::Power { device, ms });
                twins.settle();
                twins.run(200);
            }
        }
        if dice.one_in(2) {
            twins.run(dice.below(30));
        } else {
            twins.settle();
        }
    }
    twins.settle();
    twins.run(1_200);
}

// covers: identity
#[test]
fn seeds_from_the_environment() {
    for seed in seeds::from_environment().unwrap_or(0..20) {
        one(seed);
    }
}

/// Devices of one type behind a coupler and upstream of an input; which of them are declared.
fn behind_a_coupler(is_ring: bool, declared: [bool; 3], with_idle: bool) -> Twins {
    let kinds = ["coupler", "digital-output-8", "digital-output-8", "digital-output-8", "digital-input-8"];
    let declared = vec![true, declared[0], declared[1], declared[2], true];
    let build = if is_ring { ring } else { line };
    let declare = |scan: &Scan| {
        let found = scan.subdevices.iter().zip(&declared).filter(|(_, is)| **is).map(|(info, _)| info.clone());
        automatic(&found.collect::<Vec<_>>(), CYCLE)
    };
    let options = Options::default().with_idle_operation(with_idle);
    let network = build(descriptions(&kinds), NetworkOptions::default());
    let mut world = World::with(11, network, &options, declare).expect("scan and activation");
    world.settle();
    world.evaluate_latched(false);
    world.run_cycles(200);
    Twins { world, text: format!("ring {is_ring}, {declared:?}, idle {with_idle}"), declared }
}

const DECLARED: [[bool; 3]; 4] = [[false, true, true], [true, false, true], [true, true, false], [false, true, false]];

/// As with one supply for several terminals: an undeclared one may come back first.
// covers: identity
#[test]
fn an_undeclared_subdevice_that_returns_first_is_not_taken_for_a_declared_one() {
    for (declared, is_ring) in DECLARED.into_iter().flat_map(|it| [false, true].map(|is_ring| (it, is_ring))) {
        for (with_idle, later_ms) in [(true, 0), (false, 40), (true, 40), (true, 700)] {
            let mut twins = behind_a_coupler(is_ring, declared, with_idle);
            twins.text += &format!(", members {later_ms} ms later");
            for off_ms in [1, 50, 400] {
                [1, 2, 3].into_iter().for_each(|at| twins.world.power_off(DeviceIndex(at)));
                twins.run(off_ms);
                let is_member = |at: &usize| declared[*at - 1];
                let (members, others): (Vec<usize>, Vec<usize>) = [1, 2, 3].into_iter().partition(is_member);
                others.into_iter().for_each(|at| twins.world.power_on(DeviceIndex(at)));
                twins.run(later_ms);
                members.into_iter().for_each(|at| twins.world.power_on(DeviceIndex(at)));
                twins.settle();
                twins.run(500);
            }
        }
    }
}

/// An undeclared one that has just come back is not read yet when a member is lost.
// covers: identity
#[test]
fn an_undeclared_subdevice_that_is_still_read_is_not_taken_for_a_lost_one() {
    for (declared, is_ring) in DECLARED.into_iter().flat_map(|it| [false, true].map(|is_ring| (it, is_ring))) {
        for after_ms in [0, 1, 2, 4, 8, 15, 30] {
            let mut twins = behind_a_coupler(is_ring, declared, after_ms % 2 == 0);
            twins.text += &format!(", lost {after_ms} ms after the cable is back");
            let member = (1..4).find(|at| declared[at - 1]).expect("one is declared");
            twins.disturb(Disturbance::Cable { cable: 1, ms: 60 });
            twins.run(after_ms);
            twins.disturb(Disturbance::Power { device: member, ms: 300 });
            twins.settle();
            twins.run(500);
        }
    }
}

/// A spare under power at a place of its own is not taken for a lost member, also after a restart. A device in the
/// place of the member is.
// covers: identity
#[test]
fn a_spare_at_its_own_place_is_not_used_and_one_in_place_of_the_member_is() {
    for is_ring in [false, true] {
        for declared in [[false, true, true], [true, false, true], [false, false, true]] {
            let mut twins = behind_a_coupler(is_ring, declared, true);
            // In a line those behind it are out of reach.
            let member = (1..4).rev().find(|at| declared[at - 1]).expect("one is declared");
            let spare = (1..4).find(|at| !declared[at - 1]).expect("one is not declared");
            twins.world.power_off(DeviceIndex(member));
            twins.run(300);
            twins.disturb(Disturbance::Power { device: spare, ms: 50 });
            twins.run(1_500);
            let mut device = Device::new(describe("digital-output-8", "another"));
            device.power_off(twins.world.now());
            *twins.world.network_mut().device_mut(DeviceIndex(member)) = device;
            twins.world.power_on(DeviceIndex(member));
            twins.settle();
            twins.run(500);
        }
    }
}

/// While both have no power, a declared SubDevice is put in the place of an undeclared one of another type.
// covers: identity
#[test]
fn a_declared_subdevice_in_the_place_of_an_undeclared_one_of_another_type_is_in_op() {
    let kinds = ["coupler", "digital-output-8", "digital-output-16", "digital-input-8"];
    for (is_ring, off_ms, with_idle) in
        [(false, 50, true), (false, 1_500, false), (true, 50, false), (true, 1_500, true)]
    {
        let declared = vec![true, false, true, true];
        let declare = |scan: &Scan| {
            let found = scan.subdevices.iter().zip(&declared).filter(|(_, is)| **is).map(|(info, _)| info.clone());
            automatic(&found.collect::<Vec<_>>(), CYCLE)
        };
        let options = Options::default().with_idle_operation(with_idle);
        let build = if is_ring { ring } else { line };
        let network = build(descriptions(&kinds), NetworkOptions::default());
        let mut world = World::with(13, network, &options, declare).expect("scan and activation");
        world.settle();
        world.evaluate_latched(false);
        world.run_cycles(200);
        let text = format!("ring {is_ring}, off for {off_ms} ms, idle {with_idle}");
        let mut twins = Twins { world, declared, text };
        [1, 2].into_iter().for_each(|at| twins.world.power_off(DeviceIndex(at)));
        twins.run(off_ms);
        for (at, kind) in [(1, kinds[2]), (2, kinds[1])] {
            let mut device = Device::new(describe(kind, "moved"));
            device.power_off(twins.world.now());
            *twins.world.network_mut().device_mut(DeviceIndex(at)) = device;
        }
        twins.declared = vec![true, true, false, true];
        [1, 2].into_iter().for_each(|at| twins.world.power_on(DeviceIndex(at)));
        twins.settle();
        twins.run(500);
    }
}

/// A spare of the type of the second SubDevice of a hot connect group is directly behind it: when that one is lost, a
/// ring reaches the spare from the other side, as the next one behind the head of the group.
// covers: identity, hot-connect
#[test]
fn a_spare_behind_a_hot_connect_group_does_not_join_it() {
    use super::hot_connect::{TOOL, group, infos, tool};
    use ringcat::{DomainMember, SubDeviceConfig};
    let base = ["coupler", "digital-input-8"];
    for off_ms in [1, 5, 100, 1_500] {
        let mut all = descriptions(&base);
        all.extend(tool());
        all.push(describe("digital-output-16", "spare"));
        all.push(describe("digital-input-16", "last"));
        let declare = |_: &Scan| {
            let mut declaration = automatic(&infos(&base), CYCLE);
            let members = declaration.add_group(group(SubDeviceConfig::at_alias(TOOL, 0))).members;
            declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
            declaration
        };
        let network = ring(all, NetworkOptions::default());
        let options = Options::default().with_idle_operation(true);
        let mut world = World::with(12, network, &options, declare).expect("scan and activation");
        world.until(LIMIT, "all in OP", |world| world.application().all_settled());
        world.evaluate_latched(false);
        world.run_cycles(300);
        let declared = vec![true, true, true, true, false, false];
        let mut twins = Twins { world, declared, text: format!("off for {off_ms} ms") };
        for device in [3, 3, 2, 3] {
            twins.disturb(Disturbance::Power { device, ms: off_ms });
            twins.settle();
            twins.run(300);
        }
    }
}
