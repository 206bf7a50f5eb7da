//! Fresh inputs were written into this frame by their SubDevice, with any cuts, repairs, losses and power failures.
//!
//! Every world checks this with the logs of the devices (`scenarios::truth`); these segments and faults are designed to
//! confuse a sum of working counters.
//!
//! `SEED=17 cargo test -p scenarios --test virtual_time freshness::seeds -- --nocapture` runs one seed,
//! `SEED=0..10000` many.

use std::ops::Range;
use std::time::Duration;

use ringcat::{
    DomainId, DomainState, Freshness, JunctionMode, LastOutputs, MainDevice, Options, SubDeviceId, automatic,
};
use ringcat_sim::application::{Behaviour, InputSource};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::description::{DeviceDescription, TransitionTimes};
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlState;
use ringcat_wire::register::{PortKind, map};
use scenarios::check::Delivery;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{
    MAIN, REDUNDANT, RING_BEHIND_JUNCTION, RING_IN_RING, TWO_RINGS, at, descriptions, line, ring, wired_with,
};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 8] = [
    "digital-input-8",
    "digital-input-8",
    "digital-output-8",
    "emulated-input-8",
    "emulated-output-8",
    "analog-input-4",
    "servo",
    "block",
];
const DOMAIN: DomainId = DomainId(0);

/// Devices of these kinds with four MII ports each.
fn with_four_ports(kinds: &[&str]) -> Vec<DeviceDescription> {
    let mut described = descriptions(kinds);
    for it in &mut described {
        it.ports = [PortKind::Mii; 4];
        if let Behaviour::Terminal(source @ InputSource::Constant(_)) = &mut it.behaviour {
            *source = InputSource::Constant(vec![0xAA; 2]);
        }
    }
    described
}

fn junctions() -> Options {
    Options::default().with_junctions(JunctionMode::Automatic)
}

/// A ring behind a junction that breaks at one cable while the break at another is repaired: the sum of the working
/// counters is as expected before, but from other SubDevices.
// covers: freshness
#[test]
fn an_absent_subdevice_keeps_its_last_inputs_when_a_break_moves() {
    let kinds = ["digital-input-8", "junction", "digital-input-8", "digital-input-8"];
    let cables = [
        (MAIN, at(0, Port::A)),
        (at(0, Port::B), at(1, Port::A)),
        (at(1, Port::D), at(2, Port::A)),
        (at(1, Port::B), at(3, Port::A)),
    ];
    let network = wired_with(with_four_ports(&kinds), &cables);
    let declare = |scan: &ringcat::Scan| automatic(&scan.subdevices, CYCLE);
    let mut world = World::with(1, network, &junctions(), declare).expect("it fits");
    world.settle();
    world.cut(CableId(3));
    world.run_cycles(150);
    world.heal(CableId(3));
    world.cut(CableId(2));
    world.run_cycles(2);
    let exchange = world.application().exchange();
    let freshness: Vec<Freshness> =
        (0..4).map(|subdevice| exchange.freshness(DOMAIN, SubDeviceId(subdevice))).collect();
    let of =
        |device: usize| (0..4).find(|it| world.device_of(*it) == Some(DeviceIndex(device))).expect("it was scanned");
    assert_eq!(freshness[of(0)], Freshness::Fresh);
    assert_ne!(freshness[of(2)], Freshness::Fresh, "it is not there");
    assert_eq!(exchange.image(DOMAIN), [0xAA; 3], "the absent SubDevice keeps its last value");
    assert_eq!(freshness[of(3)], Freshness::Fresh, "it is back, with evidence in this frame");
}

/// Protocol 5.2: FMMUs are set before SAFEOP is requested. Some controllers read them only during this transition.
// covers: freshness
#[test]
fn subdevices_that_latch_fmmus_before_safeop_exchange_process_data() {
    let mut described = descriptions(&["coupler", "digital-input-8", "servo", "digital-output-8", "analog-input-4"]);
    described.iter_mut().for_each(|it| it.latches_fmmus = true);
    let mut world = World::in_op(1, line(described, NetworkOptions::default()));
    for device in [2, 4] {
        world.power_off(DeviceIndex(device));
        world.run_cycles(20);
        world.power_on(DeviceIndex(device));
        world.settle();
    }
    world.run_cycles(20);
    assert_eq!(world.application().exchange().status(DOMAIN).expect("it is declared").state, DomainState::Complete);
    assert!(world.all_in_op());
}

/// SubDevices return one after the other, with FMMUs set long before SAFEOP: inputs of the others stay fresh in each
/// cycle.
// covers: freshness
#[test]
fn a_slow_transition_to_safeop_leaves_inputs_of_others_fresh() {
    let kinds = ["digital-input-8", "emulated-input-8", "servo", "emulated-output-8", "analog-input-4", "block"];
    for closed in [false, true] {
        let mut described = descriptions(&kinds);
        described.iter_mut().for_each(|it| it.transitions = TransitionTimes::all(Duration::from_millis(30)));
        let options = NetworkOptions::default();
        let mut world = World::in_op(1, if closed { ring(described, options) } else { line(described, options) });
        for (subdevice, kind) in kinds.iter().enumerate() {
            let request =
                world.application_mut().engine_mut().start_state_request(SubDeviceId(subdevice), AlState::Init);
            world.finish(Duration::from_secs(5), request).expect("it goes there");
            let mark = world.mark();
            let request = world.application_mut().engine_mut().start_state_request(SubDeviceId(subdevice), AlState::Op);
            world.finish(Duration::from_secs(5), request).expect("it comes back");
            let stale = world
                .evaluated(mark)
                .iter()
                .flat_map(|evaluated| evaluated.stale.iter().filter(|it| **it != subdevice));
            assert_eq!(stale.count(), 0, "ring: {closed}, {kind} comes back");
            assert_eq!(world.incomplete(mark), 0, "ring: {closed}, {kind} comes back");
            world.settle();
        }
    }
}

/// A SubDevice is unreachable while the MainDevice restarts, and keeps its station address, FMMUs and state. In the new
/// session another SubDevice has this address; it loses its power when the old one becomes reachable again.
// covers: freshness
#[test]
fn a_subdevice_of_an_earlier_session_is_not_mistaken_for_another() {
    let mut described = with_four_ports(&["digital-input-16"; 3]);
    for (number, it) in described.iter_mut().enumerate() {
        it.identity.product_code += 0x1000 * number as u32;
        it.behaviour = Behaviour::Terminal(InputSource::Constant(vec![0xA0 + number as u8; 2]));
    }
    let cables = [(MAIN, at(0, Port::A)), (at(0, Port::B), at(1, Port::A)), (at(0, Port::D), at(2, Port::A))];
    let mut main_device = MainDevice::request(Tap::new(wired_with(described, &cables)), &Options::default());
    let scan = main_device.scan().expect("three are there");
    let mut application =
        main_device.activate(automatic(&scan.subdevices, CYCLE)).map_err(|it| it.error).expect("fits");
    (0..1_000).for_each(|_| application.cycle(|_| ()));
    assert!(application.all_settled());
    let named = |device: usize| scan.subdevices.iter().position(|it| it.name.ends_with(&device.to_string()));
    // In processing order the branch at port D is first: the SubDevice there has the second address.
    assert_eq!((named(2), named(1)), (Some(1), Some(2)));
    application.links_mut().network_mut().cut(CableId(2));
    let mut main_device = application.stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(1)).expect("it stops");
    let scan = main_device.scan().expect("two are there");
    assert_eq!(scan.subdevices.len(), 2);
    let mut application =
        main_device.activate(automatic(&scan.subdevices, CYCLE)).map_err(|it| it.error).expect("fits");
    (0..1_000).for_each(|_| application.cycle(|_| ()));
    let network = application.links_mut().network_mut();
    network.power_off(DeviceIndex(1));
    network.heal(CableId(2));
    for cycle in 0..5_000 {
        application.cycle(|_| ());
        let exchange = application.exchange();
        // Frames sent before may still arrive.
        assert!(cycle < 2 || exchange.freshness(DOMAIN, SubDeviceId(1)) != Freshness::Fresh, "cycle {cycle}");
        assert_eq!(exchange.image(DOMAIN), [0xA0, 0xA0, 0xA1, 0xA1], "cycle {cycle}");
    }
}

/// FMMUs and SyncManagers are set before SAFEOP: a buffer of one byte can be read from then on, although it has not
/// been written yet.
// covers: freshness
#[test]
fn inputs_of_a_subdevice_below_safeop_are_not_fresh() {
    for (count, fmmus) in [(1, None), (3, None), (3, Some(1))] {
        let mut described = descriptions(&["digital-input-8"; 3][..count]);
        for it in &mut described {
            it.controller_fmmus = fmmus;
            it.transitions = TransitionTimes::all(Duration::from_millis(100));
            it.behaviour = Behaviour::Terminal(InputSource::Constant(vec![0xAA]));
        }
        let mut world = World::in_op(1, line(described, NetworkOptions::default()));
        let last = DeviceIndex(count - 1);
        world.power_off(last);
        world.run_cycles(60);
        world.power_on(last);
        for _ in 0..600 {
            world.cycle();
            let state = world.network().device(last).al_status().al_state();
            let is_fresh = world.application().exchange().freshness(DOMAIN, SubDeviceId(count - 1)) == Freshness::Fresh;
            assert!(
                !is_fresh || !matches!(state, Some(AlState::Init | AlState::PreOp)),
                "{count}, {fmmus:?}: {state:?}"
            );
            assert_eq!(world.application().exchange().image(DOMAIN), vec![0xAA; count], "{count}, {fmmus:?}");
        }
        world.settle();
    }
}

/// One link, LRW: inputs are delivered, outputs are not accepted.
// covers: freshness
#[test]
fn a_domain_is_incomplete_while_outputs_are_not_accepted() {
    for kinds in [&["servo"][..], &["servo", "analog-input-4"]] {
        for fmmus in [None, Some(3), Some(2)] {
            let mut described = descriptions(kinds);
            described[0].controller_fmmus = fmmus;
            let mut world = World::in_op(1, line(described, NetworkOptions::default()));
            world.evaluate_latched(false);
            world.run_cycles(20);
            let write =
                world.application_mut().engine_mut().start_register_write(SubDeviceId(0), map::fmmu(0), vec![0; 16]);
            world.finish(Duration::from_secs(1), write).expect("it is there");
            world.run_cycles(3);
            let mark = world.mark();
            world.run_cycles(60);
            let wrong = world
                .evaluated(mark)
                .iter()
                .filter(|it| it.status.state == DomainState::Complete && it.status.wkc < it.status.expected);
            assert_eq!(wrong.count(), 0, "{kinds:?}, FMMUs: {fmmus:?}");
        }
    }
}

/// A SubDevice with outputs leaves INIT on request while another one loses its power: the sum is unchanged.
// covers: freshness
#[test]
fn outputs_of_a_starting_subdevice_do_not_replace_those_of_a_lost_one() {
    let mut described = descriptions(&["digital-output-8"; 2]);
    for it in &mut described {
        it.controller_fmmus = Some(1);
        it.transitions = TransitionTimes::all(Duration::from_millis(100));
    }
    let mut world = World::in_op(1, line(described, NetworkOptions::default()));
    world.evaluate_latched(false);
    let request = world.application_mut().engine_mut().start_state_request(SubDeviceId(0), AlState::Init);
    world.finish(Duration::from_secs(5), request).expect("it goes there");
    world.run_cycles(50);
    drop(world.application_mut().engine_mut().start_state_request(SubDeviceId(0), AlState::Op));
    world.until(Duration::from_secs(1), "it takes outputs", |world| {
        world.evaluated(world.beginning()).last().is_some_and(|it| it.status.wkc == 2)
    });
    world.power_off(DeviceIndex(1));
    world.run_cycles(2);
    let mark = world.mark();
    world.run_cycles(300);
    let complete = world.evaluated(mark).iter().filter(|it| it.status.state == DomainState::Complete);
    assert_eq!(complete.count(), 0);
}

/// A tree on the main link, with the redundant link at a free port or not.
fn random_tree(dice: &mut Dice) -> (usize, Vec<(Endpoint, Endpoint)>) {
    let count = 2 + dice.below(9) as usize;
    let mut free: Vec<(usize, Port)> = Vec::new();
    let mut cables = Vec::new();
    for device in 0..count {
        let parent = if device == 0 {
            MAIN
        } else if dice.one_in(2) {
            // Only lines are built.
            let last = free.iter().position(|(parent, _)| *parent + 1 == device).unwrap_or(0);
            let (parent, port) = free.remove(last);
            at(parent, port)
        } else {
            let (parent, port) = free.remove(dice.below(free.len() as u64) as usize);
            at(parent, port)
        };
        cables.push((parent, at(device, Port::A)));
        free.extend([Port::B, Port::C, Port::D].map(|port| (device, port)));
    }
    if !dice.one_in(3) {
        let (device, port) =
            free.iter().copied().rfind(|(device, _)| *device + 1 == count).expect("the last has free ports");
        cables.push((at(device, port), REDUNDANT));
    }
    (count, cables)
}

/// A random segment, and its cables.
fn random_segment(dice: &mut Dice) -> (Network, usize) {
    let kinds = |count: usize, dice: &mut Dice| -> Vec<&str> { (0..count).map(|_| *dice.pick(&KINDS)).collect() };
    let (kinds, cables) = match dice.below(6) {
        0 => {
            let mut kinds = kinds(7, dice);
            kinds[1] = "junction";
            (kinds, RING_BEHIND_JUNCTION.to_vec())
        }
        1 => {
            let mut kinds = kinds(7, dice);
            (kinds[0], kinds[3]) = ("junction", "junction");
            (kinds, TWO_RINGS.to_vec())
        }
        2 => {
            let mut kinds = kinds(5, dice);
            kinds[1] = "junction";
            (kinds, RING_IN_RING.to_vec())
        }
        _ => {
            let (count, cables) = random_tree(dice);
            (kinds(count, dice), cables)
        }
    };
    let mut described = with_four_ports(&kinds);
    for (number, description) in described.iter_mut().enumerate() {
        // The identity of two identical SubDevices is checked elsewhere.
        description.identity.product_code += 0x1000 * number as u32;
        // With few FMMUs none is free.
        description.controller_fmmus = *dice.pick(&[None, None, Some(3), Some(2)]);
    }
    (wired_with(described, &cables), cables.len())
}

struct Run {
    world: World,
    dice: Dice,
    cables: usize,
    cut: Vec<CableId>,
    off: Vec<DeviceIndex>,
}

impl Run {
    /// Cuts or repairs a cable, or switches a device off or on: at most two of each at a time.
    fn fault(&mut self) {
        let dice = &mut self.dice;
        let delay = Duration::from_nanos(dice.below(1_000_000));
        let fault = if dice.one_in(4) {
            let device = DeviceIndex(dice.below(self.world.network().devices().len() as u64) as usize);
            match self.off.iter().position(|off| *off == device) {
                Some(place) => Fault::PowerOn(self.off.remove(place)),
                None if self.off.len() < 2 => {
                    self.off.push(device);
                    Fault::PowerOff(device)
                }
                None => Fault::PowerOn(self.off.remove(0)),
            }
        } else {
            let cable = CableId(dice.below(self.cables as u64) as usize);
            match self.cut.iter().position(|cut| *cut == cable) {
                Some(place) => Fault::Heal(self.cut.remove(place)),
                None if self.cut.len() < 2 => {
                    self.cut.push(cable);
                    Fault::Cut(cable)
                }
                None => Fault::Heal(self.cut.remove(0)),
            }
        };
        self.world.fault_in(delay, fault);
    }

    /// Ends all faults.
    fn mend(&mut self) {
        self.world.run_cycles(2);
        (0..self.cables).for_each(|cable| self.world.heal(CableId(cable)));
        let devices = self.world.network().devices().len();
        (0..devices).for_each(|device| self.world.power_on(DeviceIndex(device)));
    }
}

/// Amount of checks of a seed.
#[derive(Clone, Copy, Default)]
struct Tally {
    /// Areas of process data that were found in the logs of their devices.
    proven: u64,
    /// Frames that were sent again.
    again: u64,
    /// Areas that these frames spared, as they must.
    spared: u64,
}

/// Runs a seed.
fn run(seed: u64) -> Tally {
    let mut dice = Dice::new(seed);
    let (network, cables) = random_segment(&mut dice);
    let under_way = 1 + dice.below(3) as u8;
    let declare = |scan: &ringcat::Scan| {
        let declaration = automatic(&scan.subdevices, CYCLE).with_under_way(under_way);
        declaration.with_sends_again(seeds::sends_again(seed))
    };
    let mut world =
        World::with(seed, network, &junctions(), declare).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    // Latched outputs are checked elsewhere; here only the logs are used.
    world.evaluate_latched(false);
    if under_way == 1 {
        world.compare_tries();
    }
    world.settle();
    let lost = *dice.pick(&[0, 0, 0, 1, 10, 50, 200]);
    world.application_mut().links_mut().lose_per_mille(lost, seed);
    let mut run = Run { world, dice, cables, cut: Vec::new(), off: Vec::new() };
    for _ in 0..6 + run.dice.below(20) {
        run.fault();
        if run.dice.one_in(2) {
            // A break that moves.
            run.fault();
        }
        let cycles = if run.dice.one_in(3) { 40 + run.dice.below(200) } else { 1 + run.dice.below(12) };
        run.world.run_cycles(cycles);
    }
    run.world.application_mut().links_mut().lose_per_mille(0, seed);
    run.mend();
    run.world.until(Duration::from_secs(25), "all back", |world| {
        let last = world.evaluated(world.beginning()).last().map(|evaluated| evaluated.delivery);
        world.all_in_op() && last == Some(Delivery::Complete)
    });
    run.world.run_cycles(20);
    let status = run.world.application().exchange().status(DOMAIN).expect("it is declared");
    assert_eq!(status.state, DomainState::Complete);
    let again = run.world.application().cyclic_counters().sent_again;
    Tally { proven: run.world.proven(), again, spared: run.world.spared() }
}

fn runs(seeds: Range<u64>) {
    let (mut all, mut failed) = (Tally::default(), Vec::new());
    for seed in seeds.clone() {
        match std::panic::catch_unwind(|| run(seed)) {
            Ok(one) => {
                let Tally { proven, again, spared } = all;
                all = Tally { proven: proven + one.proven, again: again + one.again, spared: spared + one.spared };
            }
            Err(_) => failed.push(seed),
        }
    }
    println!(
        "freshness, seeds {} to {}: {} areas of process data found in the logs of their devices, {} frames sent again, \
         {} areas spared, {} seeds failed",
        seeds.start,
        seeds.end - 1,
        all.proven,
        all.again,
        all.spared,
        failed.len()
    );
    assert_eq!(failed, [], "seeds that fail");
    assert!(all.again > 0 && all.spared > 0 || seeds.end - seeds.start < 100, "frames were lost in some seeds");
}

// covers: freshness
#[test]
fn fresh_inputs_were_written_into_this_frame_seeds_0_to_99() {
    runs(0..100);
}

// covers: freshness
#[test]
fn fresh_inputs_were_written_into_this_frame_seeds_100_to_199() {
    runs(100..200);
}

#[test]
fn seeds_from_the_environment() {
    crate::explorer::from_environment(|seed| println!("{} areas of process data proven", run(seed).proven), runs);
}
