//! Random runs of two MainDevices of the library: either program is killed, hangs, loses its power or its links, roles
//! are handed over and requested, cables are cut, frames are lost. A single fault, from a ring that is whole, has a
//! limit for the longest time without outputs. With two faults at a time, only what holds always is checked, and that
//! the ring is whole again after their end.
//!
//! `SEED=17 cargo test -p scenarios --test two_main_devices random_runs::seeds -- --nocapture` runs one seed.

use std::time::Duration;

use ringcat::RingState;
use ringcat::standby::RoleRequest;
use ringcat_sim::cable::{CableId, Host};
use ringcat_sim::fault::Fault;
use ringcat_sim::host::program::TurnAround;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::dice::Dice;
use scenarios::pair::{CYCLE, Pair, Phase, TIME_OUT_CYCLES};
use scenarios::seeds;
use scenarios::segments::{descriptions, devices};

use super::KINDS;

/// Rounds of a run, each with one or two faults that end.
const ROUNDS: u32 = 6;
/// Cycles between a fault and its end, and after it.
const CALM: u32 = 60;
/// Time limit of the guard of a host.
const GUARD: Duration = CYCLE;

/// One of the two MainDevices, by what it is when the fault begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Active,
    Standby,
}

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Disturbance {
    Cut(usize),
    /// Frames are lost on a cable.
    Losses(usize, u32),
    Killed(Side),
    /// For so many microseconds.
    Hangs(Side, u64),
    PowerOff(Side),
    LinksDown(Side),
    HandOver,
    /// The standby is made ACTIVE as well.
    BothActive,
    /// The ACTIVE is made INACTIVE.
    Yields,
}

impl Disturbance {
    /// Any, in a ring with this number of cables.
    fn any(dice: &mut Dice, cables: usize) -> Disturbance {
        let cable = dice.below(cables as u64) as usize;
        let side = *dice.pick(&[Side::Active, Side::Standby]);
        match dice.below(10) {
            0 | 1 => Disturbance::Cut(cable),
            2 => Disturbance::Losses(cable, 1 + dice.below(5) as u32),
            3 | 4 => Disturbance::Killed(side),
            5 => Disturbance::Hangs(side, 100 + dice.below(20_000)),
            6 => Disturbance::PowerOff(side),
            7 => Disturbance::LinksDown(side),
            8 => Disturbance::HandOver,
            _ => *dice.pick(&[Disturbance::BothActive, Disturbance::Yields]),
        }
    }

    /// Longest time without outputs if nothing else happens; `detection` is the time until a port detects its link.
    fn longest_gap(self, detection: Duration) -> Duration {
        // A cycle of which only the first frame has arrived restarts the time-out.
        let time_out = CYCLE * (TIME_OUT_CYCLES + 2);
        match self {
            Disturbance::Killed(Side::Active)
            | Disturbance::Hangs(Side::Active, _)
            | Disturbance::PowerOff(Side::Active) => time_out,
            Disturbance::LinksDown(Side::Active) | Disturbance::Yields => time_out,
            // What the guard takes, the detection of the link, and the cycles at the edge.
            Disturbance::Killed(Side::Standby) | Disturbance::Hangs(Side::Standby, _) => GUARD + detection + 3 * CYCLE,
            Disturbance::Losses(_, count) => CYCLE * (count + 2),
            Disturbance::HandOver => CYCLE + Duration::from_micros(600),
            _ => 3 * CYCLE,
        }
    }
}

/// A run.
struct Run {
    pair: Pair,
    dice: Dice,
    cables: usize,
    detection: Duration,
    /// The faults of this round that have not ended, each with the host that it concerns.
    open: Vec<(Disturbance, Host)>,
}

impl Run {
    fn new(seed: u64) -> Run {
        let mut dice = Dice::new(seed);
        let detection = Duration::from_micros(*dice.pick(&[10, 300]));
        let network = segment(&mut dice, seed, detection);
        let cables = network.cables().len();
        let mut pair = Pair::without_programs(seed, network);
        let least = Duration::from_micros(dice.below(20));
        pair.set_turn_around(TurnAround { least, most: least + Duration::from_micros(dice.below(60)) });
        for host in Host::ALL {
            pair.start_member(host);
            pair.run_cycles(5);
            pair.hosts().guard(host, GUARD);
        }
        pair.until_ready(Host::First);
        Run { pair, dice, cables, detection, open: Vec::new() }
    }

    /// The host that is ACTIVE, or was last.
    fn active(&self) -> Host {
        let is_active = |host: &Host| matches!(self.pair.seen(*host).phase, Phase::Active | Phase::Starting);
        Host::ALL.into_iter().find(is_active).unwrap_or(Host::First)
    }

    /// A fault begins within the next cycle.
    fn begin(&mut self, disturbance: Disturbance) {
        let moment = Duration::from_nanos(self.dice.below(CYCLE.as_nanos() as u64));
        let active = self.active();
        let host = match disturbance {
            Disturbance::Killed(side)
            | Disturbance::Hangs(side, _)
            | Disturbance::PowerOff(side)
            | Disturbance::LinksDown(side) => {
                if side == Side::Active {
                    active
                } else {
                    active.other()
                }
            }
            Disturbance::BothActive => active.other(),
            _ => active,
        };
        let pair = &mut self.pair;
        pair.say(format!("{disturbance:?} of {host:?} in {moment:?}"));
        match disturbance {
            Disturbance::Cut(cable) => pair.fault_in(moment, Fault::Cut(CableId(cable))),
            Disturbance::Losses(cable, count) => {
                pair.fault_in(moment, Fault::Drop { cable: CableId(cable), direction: None, count });
            }
            Disturbance::Killed(_) => {
                pair.hosts().run_for(moment);
                pair.kill(host);
            }
            Disturbance::Hangs(_, us) => {
                pair.fault_in(moment, Fault::StopHost(host, true));
                pair.fault_in(moment + Duration::from_micros(us), Fault::StopHost(host, false));
            }
            Disturbance::PowerOff(_) => pair.fault_in(moment, Fault::PowerHostOff(host)),
            Disturbance::LinksDown(_) => {
                pair.hosts().run_for(moment);
                switch(pair, host, false);
            }
            Disturbance::HandOver => pair.request(host, RoleRequest::HandOver),
            Disturbance::BothActive => pair.request(host, RoleRequest::Active),
            Disturbance::Yields => pair.request(host, RoleRequest::Inactive),
        }
        self.open.push((disturbance, host));
    }

    /// Ends all faults, in any order.
    fn mend(&mut self) {
        while !self.open.is_empty() {
            let at = self.dice.below(self.open.len() as u64) as usize;
            let (disturbance, host) = self.open.swap_remove(at);
            self.end_one(disturbance, host);
            let pause = if self.open.is_empty() { 0 } else { self.dice.below(40) as u32 };
            self.pair.run_cycles(pause);
        }
    }

    fn end_one(&mut self, disturbance: Disturbance, host: Host) {
        let pair = &mut self.pair;
        match disturbance {
            Disturbance::Cut(cable) => pair.heal(cable),
            Disturbance::Losses(cable, _) => {
                pair.fault(Fault::Drop { cable: CableId(cable), direction: None, count: 0 })
            }
            Disturbance::PowerOff(_) => {
                pair.hosts().with_network(|network| down(network, host));
                pair.fault(Fault::PowerHostOn(host));
            }
            Disturbance::LinksDown(_) => switch(pair, host, true),
            _ => {}
        }
        self.restart_if_dead(host);
    }

    /// A service manager starts a program again that has ended, or whose interfaces the guard has switched off.
    fn restart_if_dead(&mut self, host: Host) {
        let is_open = |(disturbance, hit): &(Disturbance, Host)| {
            *hit == host
                && matches!(disturbance, Disturbance::PowerOff(_) | Disturbance::Killed(_) | Disturbance::Hangs(..))
        };
        if self.open.iter().any(is_open) {
            return;
        }
        let pair = &mut self.pair;
        if pair.hosts().has_ended(host) || pair.hosts().guard_has_acted(host) {
            pair.kill(host);
            pair.hosts().dismiss_guard(host);
            pair.start_member(host);
            pair.run_cycles(1);
            pair.hosts().guard(host, GUARD);
        }
    }

    /// Waits until one is ACTIVE and the other one ready, and both interfaces of a ring that is whole are used.
    fn until_whole(&mut self) {
        for _ in 0..5_000 {
            self.pair.cycle();
            let active = self.active();
            let seen = self.pair.seen(active);
            let is_whole = seen.phase == Phase::Active && seen.is_last_complete && seen.is_other_ready;
            if is_whole && seen.ring == RingState::Closed && self.pair.all_in_op() {
                return;
            }
        }
        panic!("no ACTIVE with a standby that is ready within 5,000 cycles\n{}", self.pair.log());
    }

    /// One fault, from a ring that is whole.
    fn round(&mut self) {
        let disturbance = Disturbance::any(&mut self.dice, self.cables);
        self.pair.take_longest_gap();
        let before = Host::ALL.map(|host| self.pair.seen(host).cold_takeovers);
        self.begin(disturbance);
        self.pair.run_cycles(CALM);
        let gap = self.pair.take_longest_gap();
        let most = disturbance.longest_gap(self.detection);
        assert!(gap <= most, "{disturbance:?}: {gap:?} without outputs, at most {most:?}\n{}", self.pair.log());
        assert!(self.pair.all_in_op(), "{disturbance:?}: {:?}\n{}", self.pair.not_in_op(), self.pair.log());
        self.mend();
        self.until_whole();
        let gap = self.pair.take_longest_gap();
        assert!(gap <= 3 * CYCLE, "{disturbance:?} is over: {gap:?} without outputs\n{}", self.pair.log());
        let cold = Host::ALL.map(|host| self.pair.seen(host).cold_takeovers);
        assert_eq!(cold, before, "{disturbance:?}: a takeover through INIT\n{}", self.pair.log());
    }

    /// A second fault before the first one has ended.
    fn double_round(&mut self) {
        let first = Disturbance::any(&mut self.dice, self.cables);
        let second = Disturbance::any(&mut self.dice, self.cables);
        // Two cuts make two networks, each with its ACTIVE.
        if let (Disturbance::Cut(_), Disturbance::Cut(_)) = (first, second) {
            return self.round();
        }
        self.begin(first);
        let pause = self.dice.below(30) as u32;
        self.pair.run_cycles(pause);
        self.begin(second);
        self.pair.run_cycles(CALM);
        self.mend();
        self.until_whole();
    }
}

fn segment(dice: &mut Dice, seed: u64, detection: Duration) -> Network {
    let count = 1 + dice.below(10) as usize;
    let kinds: Vec<&str> = (0..count).map(|_| *dice.pick(&KINDS)).collect();
    let options = NetworkOptions::default().with_seed(seed).with_detection_delay(detection);
    let near = *dice.pick(&Host::ALL);
    let devices = devices(descriptions(&kinds));
    SegmentBuilder::ring_of_two(devices, near).options(options).build().expect("the cables fit")
}

fn down(network: &mut Network, host: Host) {
    host.links().into_iter().for_each(|link| network.disconnect(link, true));
}

fn switch(pair: &mut Pair, host: Host, up: bool) {
    pair.say(format!("links of {host:?} are {}", if up { "up" } else { "down" }));
    pair.hosts().with_network(|network| host.links().into_iter().for_each(|link| network.disconnect(link, !up)));
}

fn run(seed: u64) {
    let mut run = Run::new(seed);
    for _ in 0..ROUNDS {
        if run.dice.one_in(2) { run.round() } else { run.double_round() }
    }
    assert!(run.pair.checked_passes() > 0);
}

/// Runs seeds; a failing one prints itself.
fn run_all(seeds: impl IntoIterator<Item = u64>) {
    seeds.into_iter().for_each(run);
}

// covers: standby, MR-07, MR-08, MR-10, MR-18, MR-25, MR-26, REQ005, REQ015
#[test]
fn seeds_0_to_20_hold_under_faults_of_both_maindevices_and_the_cables() {
    run_all(0..20);
}

/// Faults that were found: an ACTIVE went through INIT although it had received no frame of another one (1, 2); two
/// scanned at the same time for ever (131); no more rounds of reads after a role that ended during one (826); no yield
/// after a takeover during a scan of the other MainDevice (1307); a takeover each time-out during such a scan (4614).
// covers: standby, MR-10, MR-16
#[test]
fn seeds_that_found_faults_hold() {
    run_all([1, 2, 131, 826, 1307, 4614]);
}

// covers: standby
#[test]
fn seeds_from_the_environment_hold() {
    if let Some(seeds) = seeds::from_environment() {
        run_all(seeds);
    }
}
