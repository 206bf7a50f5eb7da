//! Two faults at once, within one round trip of a frame or half a second apart: cables that are interrupted briefly,
//! repaired in one direction first, delay or duplicate frames; power failures of microseconds; state requests
//! meanwhile.
//!
//! The values themselves are checked: each SubDevice stamps its inputs with its number and a unique count, so a value
//! of another SubDevice, an older value, or parts of two values are detected in the process image. Some SubDevices are
//! identical, exchange in OP only, are slow, or have few FMMUs; there are several domains.
//!
//! `SEED=17 cargo test -p scenarios --test virtual_time double_faults::seeds -- --nocapture` runs one seed,
//! `SEED=0..2000` many.

use std::cell::Cell;
use std::ops::Range;
use std::time::Duration;

use ringcat::{
    Declaration, Direction as Way, DomainConfig, DomainId, DomainMember, DomainState, DomainStatus, Freshness,
    JunctionMode, LrwPolicy, Options, Scan, SubDeviceId, automatic,
};
use ringcat_sim::application::{Behaviour, InputFunction, InputSource};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction, Endpoint};
use ringcat_sim::description::{DeviceDescription, TransitionTimes};
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port;
use ringcat_sim::time::SimTime;
use ringcat_wire::al::AlState;
use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{SiiSyncManager, SyncManagerKind};
use scenarios::check::Delivery;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{
    MAIN, REDUNDANT, RING_BEHIND_JUNCTION, RING_IN_RING, TWO_RINGS, at, descriptions, wired_with,
};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 9] = [
    "digital-input-8",
    "digital-input-16",
    "digital-output-8",
    "emulated-input-8",
    "emulated-output-8",
    "analog-input-4",
    "analog-input-4",
    "servo",
    "block",
];
const STATES: [AlState; 5] = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op, AlState::Op];

/// Periods of domains, in cycles.
const PERIODS: [&[u32]; 4] = [&[1, 1], &[1, 2], &[1, 3, 5], &[2, 1]];

/// What cables connect.
type Cables = Vec<(Endpoint, Endpoint)>;

thread_local! { static STAMPED: Cell<u32> = const { Cell::new(0) }; }

/// Inputs of the device with this number: repeatedly its number plus one and three bytes of a count.
fn stamp<const DEVICE: u8>(_now: SimTime, _outputs: &[u8], inputs: &mut [u8]) {
    let count = STAMPED.get() + 1;
    STAMPED.set(count);
    let [low, middle, high, _] = count.to_le_bytes();
    let stamp = [DEVICE + 1, low, middle, high];
    inputs.iter_mut().zip(stamp.iter().cycle()).for_each(|(byte, stamped)| *byte = *stamped);
}

const STAMPS: [InputFunction; 8] =
    [stamp::<0>, stamp::<1>, stamp::<2>, stamp::<3>, stamp::<4>, stamp::<5>, stamp::<6>, stamp::<7>];

/// A tree of up to eight, with the redundant link at a free port of the last one or not.
fn random_tree(dice: &mut Dice) -> (usize, Cables) {
    let count = 1 + dice.below(8) as usize;
    let mut free: Vec<(usize, Port)> = Vec::new();
    let mut cables = Vec::new();
    for device in 0..count {
        let parent = if device == 0 {
            MAIN
        } else {
            let place = if dice.one_in(2) {
                free.iter().position(|(parent, _)| *parent + 1 == device).unwrap_or(0)
            } else {
                dice.below(free.len() as u64) as usize
            };
            let (parent, port) = free.remove(place);
            at(parent, port)
        };
        cables.push((parent, at(device, Port::A)));
        free.extend([Port::B, Port::C, Port::D].map(|port| (device, port)));
    }
    if !dice.one_in(3) {
        cables.push((at(count - 1, Port::B), REDUNDANT));
    }
    (count, cables)
}

/// Kinds and cables of a random segment.
fn random_wiring(dice: &mut Dice) -> (Vec<&'static str>, Cables) {
    let pick =
        |count: usize, dice: &mut Dice| -> Vec<&'static str> { (0..count).map(|_| *dice.pick(&KINDS)).collect() };
    let (mut kinds, junctions, cables) = match dice.below(7) {
        0 => (pick(7, dice), &[1][..], RING_BEHIND_JUNCTION.to_vec()),
        1 => (pick(7, dice), &[0, 3][..], TWO_RINGS.to_vec()),
        2 => (pick(5, dice), &[1][..], RING_IN_RING.to_vec()),
        _ => {
            let (count, cables) = random_tree(dice);
            (pick(count, dice), &[][..], cables)
        }
    };
    junctions.iter().for_each(|junction| kinds[*junction] = "junction");
    (kinds, cables)
}

/// Devices that stamp their inputs. In one of four segments devices of one type are identical.
fn random_devices(kinds: &[&str], dice: &mut Dice) -> Vec<DeviceDescription> {
    let mut described = descriptions(kinds);
    let alike = dice.one_in(4);
    let slow = *dice.pick(&[0, 0, 3, 30]);
    for (number, it) in described.iter_mut().enumerate() {
        it.ports = [PortKind::Mii; 4];
        if let Behaviour::Terminal(source) = &mut it.behaviour {
            *source = InputSource::Function(STAMPS[number]);
        }
        if !alike {
            it.identity.product_code += 0x1000 * number as u32;
        }
        let carries_data = |kind| matches!(kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs);
        let needed = it.sync_managers.iter().filter(|manager| carries_data(manager.kind) && manager.length > 0).count();
        let fmmus: Option<u8> = *dice.pick(&[None, None, None, Some(4), Some(3), Some(2), Some(1)]);
        it.controller_fmmus = fmmus.map(|count| count.max(needed as u8));
        if slow > 0 {
            it.transitions = TransitionTimes::all(Duration::from_millis(1 + dice.below(slow)));
        }
        if dice.one_in(6) && it.emulation {
            for manager in &mut it.sync_managers {
                if manager.kind == SyncManagerKind::Outputs && manager.length > 0 {
                    manager.enable = SiiSyncManager::ENABLE | SiiSyncManager::OP_ONLY;
                }
            }
        }
    }
    described
}

/// One domain, or several with different periods; one LRW, or one for each SubDevice.
fn declare(scan: &Scan, dice: &mut Dice) -> Declaration {
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    if dice.one_in(3) && scan.subdevices.len() > 1 {
        let periods = *dice.pick(&PERIODS);
        let members = |first: usize| {
            let subdevices = (first..scan.subdevices.len()).step_by(periods.len());
            subdevices.map(|subdevice| DomainMember::new(SubDeviceId(subdevice))).collect::<Vec<_>>()
        };
        let domain = |(first, period): (usize, &u32)| DomainConfig::new(*period * CYCLE, members(first));
        declaration.domains = periods.iter().enumerate().map(domain).filter(|it| !it.members.is_empty()).collect();
    }
    if dice.one_in(4) {
        declaration.lrw = LrwPolicy::PerSubDevice;
    }
    declaration.with_under_way(1 + dice.below(4) as u8)
}

/// Amount of checks of a seed.
#[derive(Clone, Copy, Default)]
struct Tally {
    /// Stamps that were read.
    stamps: u64,
    /// Areas of process data that were found in the logs of their devices.
    proven: u64,
}

struct Run {
    world: World,
    dice: Dice,
    cables: usize,
    cut: Vec<CableId>,
    off: Vec<DeviceIndex>,
    /// By SubDevice: the count of the last stamp.
    counts: Vec<u32>,
    /// By domain: the image after the last cycle in which it was evaluated.
    images: Vec<Vec<u8>>,
    /// All SubDevices should be in OP: no other state is requested.
    all_to_op: bool,
    stamps: u64,
}

impl Run {
    fn new(seed: u64) -> Run {
        let mut dice = Dice::new(seed ^ 0xB4EA_0000);
        STAMPED.set(0);
        let (kinds, cables) = random_wiring(&mut dice);
        let network = wired_with(random_devices(&kinds, &mut dice), &cables);
        let options = Options::default().with_junctions(JunctionMode::Automatic);
        let mut domains = 0;
        let declare = |scan: &Scan| {
            let declaration = declare(scan, &mut dice).with_sends_again(seeds::sends_again(seed));
            domains = declaration.domains.len();
            declaration
        };
        let mut world = World::with(seed, network, &options, declare).unwrap_or_else(|it| panic!("seed {seed}: {it}"));
        // Latched outputs are checked elsewhere; here the logs and the stamps are used.
        world.evaluate_latched(false);
        world.settle();
        Run {
            world,
            dice,
            cables: cables.len(),
            cut: Vec::new(),
            off: Vec::new(),
            counts: vec![0; kinds.len()],
            images: vec![Vec::new(); domains],
            all_to_op: true,
            stamps: 0,
        }
    }

    fn cycles(&mut self, cycles: u64) {
        (0..cycles).for_each(|_| self.cycle());
    }

    fn cycle(&mut self) {
        let domains: Vec<DomainId> = (0..self.images.len()).map(DomainId).collect();
        let of = domains.clone();
        let statuses: Vec<Option<DomainStatus>> = self.world.cycle_with(|data| {
            of.into_iter().map(|it| data.is_due(it).then(|| data.status(it).expect("it is declared"))).collect()
        });
        for (domain, status) in domains.into_iter().zip(statuses) {
            if let Some(status) = status.filter(|status| !status.pending) {
                self.evaluate(domain, status.state);
            }
        }
    }

    /// Checks all inputs of a domain after a cycle in which it was due.
    fn evaluate(&mut self, domain: DomainId, state: DomainState) {
        let application = self.world.application();
        let exchange = application.exchange();
        let image = exchange.image(domain).to_vec();
        let before = std::mem::replace(&mut self.images[domain.0], image.clone());
        for (subdevice, count) in self.counts.iter_mut().enumerate() {
            let freshness = exchange.freshness(domain, SubDeviceId(subdevice));
            let is_input = |way: Way, length: u16| way == Way::Inputs && length > 0;
            let areas = application.directory().areas(SubDeviceId(subdevice)).iter();
            for area in areas.filter(|it| it.domain == domain && is_input(it.direction, it.placed.area.length)) {
                let first = area.placed.image_offset as usize;
                let place = first..first + usize::from(area.placed.area.length);
                let value = &image[place.clone()];
                let is_zero = |value: &[u8]| value.iter().all(|byte| *byte == 0);
                assert!(
                    freshness == Freshness::Fresh || state != DomainState::Complete || !self.all_to_op,
                    "{domain:?} is complete, and SubDevice {subdevice} is {freshness:?}"
                );
                if freshness != Freshness::Fresh {
                    let is_overwritten = is_zero(value) && before.get(place).is_some_and(|before| !is_zero(before));
                    assert!(!is_overwritten, "zeros over a value of SubDevice {subdevice}, which is {freshness:?}");
                } else if let Some(stamped) = stamp_of(&self.world, subdevice, value) {
                    self.stamps += 1;
                    assert!(stamped >= *count, "SubDevice {subdevice}: {stamped} after {count}");
                    *count = stamped;
                }
            }
        }
    }

    fn fault(&mut self) {
        let within_a_flight = self.dice.one_in(2);
        let tenths = if within_a_flight { self.dice.below(600) } else { self.dice.below(10_000) };
        let delay = Duration::from_nanos(100 * tenths);
        let cable = CableId(self.dice.below(self.cables as u64) as usize);
        let device = DeviceIndex(self.dice.below(self.counts.len() as u64) as usize);
        let direction = *self.dice.pick(&[None, Some(Direction::AToB), Some(Direction::BToA)]);
        let count = 1 + self.dice.below(3) as u32;
        let moment = Duration::from_nanos(100 * self.dice.below(300));
        match self.dice.below(12) {
            0 => self.world.fault_in(delay, Fault::Duplicate { cable, direction, count }),
            1 => {
                let by = Duration::from_nanos(100 * self.dice.below(40_000));
                self.world.fault_in(delay, Fault::Delay { cable, direction, count, by });
            }
            2 => self.world.fault_in(delay, Fault::Drop { cable, direction, count }),
            3 => {
                self.world.fault_in(delay, Fault::PowerOff(device));
                self.world.fault_in(delay + moment, Fault::PowerOn(device));
                self.off.retain(|off| *off != device);
            }
            4 | 5 => {
                self.world.fault_in(delay, Fault::Cut(cable));
                self.world.fault_in(delay + moment, Fault::Heal(cable));
                self.cut.retain(|cut| *cut != cable);
            }
            6 | 7 => {
                let fault = match toggle(&mut self.off, device) {
                    (device, true) => Fault::PowerOff(device),
                    (device, false) => Fault::PowerOn(device),
                };
                self.world.fault_in(delay, fault);
            }
            8 => {
                let by = Duration::from_nanos(100 * self.dice.below(2_000));
                let direction = direction.unwrap_or(Direction::AToB);
                self.world.fault_in(delay, Fault::HealUnevenly { cable, direction, by });
                self.cut.retain(|cut| *cut != cable);
            }
            _ => {
                let fault = match toggle(&mut self.cut, cable) {
                    (cable, true) => Fault::Cut(cable),
                    (cable, false) => Fault::Heal(cable),
                };
                self.world.fault_in(delay, fault);
            }
        }
    }

    /// Requests another state of a SubDevice.
    fn request(&mut self) {
        let subdevice = self.dice.below(self.counts.len() as u64) as usize;
        let state = *self.dice.pick(&STATES);
        self.all_to_op = false;
        self.world.say(format!("SubDevice {subdevice} to {state}"));
        drop(self.world.application_mut().engine_mut().start_state_request(SubDeviceId(subdevice), state));
    }

    /// Ends all faults; all SubDevices have to return to OP.
    fn mend(&mut self) {
        self.world.application_mut().links_mut().lose_per_mille(0, 0);
        self.cycles(2);
        (0..self.cables).for_each(|cable| self.world.heal(CableId(cable)));
        let subdevices = self.counts.len();
        (0..subdevices).for_each(|device| self.world.power_on(DeviceIndex(device)));
        self.cycles(1_000);
        (0..subdevices).for_each(|it| {
            drop(self.world.application_mut().engine_mut().start_state_request(SubDeviceId(it), AlState::Op))
        });
        let domains = self.images.len();
        self.world.until(Duration::from_secs(30), "all back", |world| {
            let evaluated = world.evaluated(world.beginning());
            let last = |domain: usize| evaluated.iter().rev().find(|it| it.domain == DomainId(domain));
            let is_complete = |domain| last(domain).is_some_and(|it| it.delivery == Delivery::Complete);
            world.all_in_op() && (0..domains).all(is_complete)
        });
        self.cycles(30);
        self.all_to_op = true;
        let mark = self.world.mark();
        self.cycles(40);
        for evaluated in self.world.evaluated(mark) {
            assert!(evaluated.status.state == DomainState::Complete && evaluated.stale.is_empty(), "{evaluated:?}");
        }
    }
}

/// Toggles an element; at most two are out at a time: instead of a third, another one is restored.
fn toggle<T: Copy + PartialEq>(out: &mut Vec<T>, it: T) -> (T, bool) {
    match out.iter().position(|other| *other == it) {
        Some(place) => (out.remove(place), false),
        None if out.len() < 2 => {
            out.push(it);
            (it, true)
        }
        None => (out.remove(0), false),
    }
}

/// The count of a fresh stamped value, if the value is large enough. The stamp must be that of a device with the
/// station address of the SubDevice; inputs are zero before the first stamp.
fn stamp_of(world: &World, subdevice: usize, value: &[u8]) -> Option<u32> {
    let station = world.application().engine().stations()[subdevice].0;
    let powered = |device: &usize| world.network().device(DeviceIndex(*device)).controller.is_powered();
    let mut here = (0..world.network().devices().len())
        .filter(|device| world.station_of(*device) == station)
        .filter(powered)
        .peekable();
    let first = *here.peek()?;
    let described = &world.network().device(DeviceIndex(first)).description;
    if !matches!(described.behaviour, Behaviour::Terminal(_)) || value.iter().all(|byte| *byte == 0) {
        return None;
    }
    assert!(here.any(|device| device as u8 + 1 == value[0]), "SubDevice {subdevice} has {value:02x?} of another one");
    let stamp = value.first_chunk::<4>()?;
    assert!(value.chunks(4).all(|it| stamp.starts_with(it)), "SubDevice {subdevice} has parts of two: {value:02x?}");
    Some(u32::from_le_bytes([stamp[1], stamp[2], stamp[3], 0]))
}

fn run(seed: u64) -> Tally {
    let mut run = Run::new(seed);
    let lost = *run.dice.pick(&[0, 0, 0, 1, 10, 50]);
    run.world.application_mut().links_mut().lose_per_mille(lost, seed);
    let with_requests = run.dice.one_in(2);
    for _ in 0..6 + run.dice.below(20) {
        run.fault();
        if run.dice.one_in(2) {
            run.fault();
        }
        if with_requests && run.dice.one_in(2) {
            run.request();
        }
        let cycles = if run.dice.one_in(3) { 40 + run.dice.below(200) } else { run.dice.below(12) };
        run.cycles(cycles);
    }
    run.mend();
    Tally { stamps: run.stamps, proven: run.world.proven() }
}

fn runs(seeds: Range<u64>) {
    let (mut stamps, mut proven, mut failed) = (0, 0, Vec::new());
    for seed in seeds.clone() {
        match std::panic::catch_unwind(|| run(seed)) {
            Ok(tally) => (stamps, proven) = (stamps + tally.stamps, proven + tally.proven),
            Err(_) => failed.push(seed),
        }
    }
    println!(
        "double faults, seeds {} to {}: {stamps} stamps read, {proven} areas proven, {} seeds failed",
        seeds.start,
        seeds.end - 1,
        failed.len()
    );
    assert_eq!(failed, [], "seeds that fail");
    assert!(stamps > 1_000 * (seeds.end - seeds.start), "{stamps} stamps");
}

// covers: freshness
#[test]
fn values_are_those_of_their_subdevice_under_double_faults_seeds_0_to_29() {
    runs(0..30);
}

// covers: freshness
#[test]
fn values_are_those_of_their_subdevice_under_double_faults_seeds_30_to_59() {
    runs(30..60);
}

#[test]
fn seeds_from_the_environment() {
    let one = |seed| {
        let Tally { stamps, proven } = run(seed);
        println!("{stamps} stamps read, {proven} areas of process data proven");
    };
    crate::explorer::from_environment(one, runs);
}
