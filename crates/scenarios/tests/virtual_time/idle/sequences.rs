//! Random sequences of request, configure, activate, deactivate and release, with cables, power and foreign changes of
//! states meanwhile: nothing panics, nothing hangs, and after the end of the faults all states are as requested.
//!
//! `SEED=17 cargo test -p scenarios --test virtual_time idle::sequences -- --nocapture` runs one seed,
//! `SEED=1000..2000` many.

use std::ops::Range;
use std::time::Duration;

use ringcat::{
    Application, ClockConfig, Declaration, Error, JunctionMode, LastOutputs, MainDevice, Options, PortReport, Position,
    Services, SubDeviceConfig,
};
use ringcat_sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::frame::Port;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlControl, AlState, AlStatus};
use ringcat_wire::register::map;
use scenarios::clocks::wired;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{MAIN, REDUNDANT, at, descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::CYCLE;

const KINDS: [&str; 7] =
    ["coupler", "servo", "digital-output-8", "emulated-output-8", "digital-input-8", "servo", "analog-input-4"];
const STATES: [AlState; 4] = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
const LIMIT: Duration = Duration::from_millis(300);
/// Time in which all recover. A failed configuration is repeated after pauses of up to 5 s.
const RECOVERY: Duration = Duration::from_secs(15);

/// Either side of an activation.
enum Side {
    Idle(Box<MainDevice<Tap>>),
    Active(Box<Application<Tap>>),
}

impl Side {
    fn network(&mut self) -> &mut Network {
        match self {
            Side::Idle(main_device) => main_device.links_mut().network_mut(),
            Side::Active(application) => application.links_mut().network_mut(),
        }
    }

    fn work(&mut self, time: Duration) {
        match self {
            Side::Idle(main_device) => {
                main_device.attend(time);
                while main_device.pop_event().is_some() {}
            }
            Side::Active(application) => {
                let end = application.now() + time;
                while application.now() < end {
                    application.cycle(|_| ());
                }
                while application.pop_event().is_some() {}
            }
        }
    }
}

struct Faults {
    cut: Option<CableId>,
    off: Option<DeviceIndex>,
}

impl Faults {
    fn change(&mut self, dice: &mut Dice, side: &mut Side) {
        let network = side.network();
        let (cables, devices) = (network.cables().len() as u64, network.devices().len() as u64);
        match dice.below(3) {
            0 => match self.cut.take() {
                Some(cable) => network.apply(Fault::Heal(cable)),
                None => {
                    let cable = CableId(dice.below(cables) as usize);
                    network.apply(Fault::Cut(cable));
                    self.cut = Some(cable);
                }
            },
            1 => match self.off.take() {
                Some(device) => network.apply(Fault::PowerOn(device)),
                None => {
                    let device = DeviceIndex(dice.below(devices) as usize);
                    network.apply(Fault::PowerOff(device));
                    self.off = Some(device);
                }
            },
            // A foreign program changes a state.
            _ => {
                let (at, state) = (dice.below(devices) as u16, *dice.pick(&STATES));
                if let Side::Idle(main_device) = side {
                    let control = u16::from_le_bytes(AlControl::new(state).encode());
                    let _ = main_device.subdevice(Position(at)).within(LIMIT).register_write(map::AL_CONTROL, control);
                }
            }
        }
    }

    fn end(&mut self, network: &mut Network) {
        self.cut.take().into_iter().for_each(|cable| network.apply(Fault::Heal(cable)));
        self.off.take().into_iter().for_each(|device| network.apply(Fault::PowerOn(device)));
    }
}

fn declare(dice: &mut Dice, main_device: &MainDevice<Tap>) -> Declaration {
    let mut declaration = Declaration::default();
    for info in main_device.subdevices() {
        if dice.one_in(3) {
            continue;
        }
        let domain = declaration.add_domain(CYCLE * (1 + dice.below(2) as u32));
        let mut config = SubDeviceConfig::from_info(&info);
        config.optional = dice.one_in(2);
        declaration.add_to(domain, config);
    }
    declaration.with_clocks(dice.one_in(3).then(ClockConfig::default))
}

/// A call that examines rings or closes ports, or a scan that begins meanwhile.
fn examine(dice: &mut Dice, main_device: &mut MainDevice<Tap>) {
    match dice.below(4) {
        0 => _ = main_device.port_report(),
        // The caller stops waiting for the result.
        1 => {
            let report = main_device.engine_mut().start_port_report();
            main_device.attend(Duration::from_micros(dice.below(12_000)));
            drop(report);
        }
        2 => {
            let report = main_device.engine_mut().start_port_report();
            main_device.attend(Duration::from_micros(dice.below(12_000)));
            let _ = main_device.engine_mut().restart_scan();
            drop(report);
        }
        _ => _ = main_device.rescan(LIMIT),
    }
}

/// The next call of the application.
fn step(dice: &mut Dice, side: Side, options: &Options) -> Side {
    let calls = if options.junctions == JunctionMode::Automatic { 9 } else { 6 };
    match side {
        Side::Idle(mut main_device) => match dice.below(calls) {
            0..=2 => {
                let declaration = declare(dice, &main_device);
                match main_device.activate(declaration) {
                    Ok(application) => Side::Active(Box::new(application)),
                    Err(refused) => Side::Idle(Box::new(refused.main_device)),
                }
            }
            3 => {
                let (at, state) = (dice.below(KINDS.len() as u64) as u16, *dice.pick(&STATES));
                let _ = main_device.subdevice(Position(at)).within(LIMIT).request_state(state);
                let _ = main_device.subdevice(Position(at)).within(LIMIT).request_state(AlState::PreOp);
                Side::Idle(main_device)
            }
            4 => {
                let at = dice.below(KINDS.len() as u64) as u16;
                let _ = main_device.subdevice(Position(at)).within(LIMIT).sdo_read::<u32>(0x1018, 1);
                Services::retry(&mut *main_device, None);
                Side::Idle(main_device)
            }
            6..=8 => {
                examine(dice, &mut main_device);
                Side::Idle(main_device)
            }
            // Released, and requested again.
            _ => {
                let network = std::mem::replace(
                    main_device.links_mut().network_mut(),
                    line(descriptions(&KINDS[..1]), NetworkOptions::default()),
                );
                drop(main_device);
                Side::Idle(Box::new(MainDevice::request(Tap::new(network), options)))
            }
        },
        Side::Active(application) => match dice.below(3) {
            0 => Side::Active(application),
            _ => match application.deactivate(LastOutputs::Zero, LIMIT) {
                Ok(main_device) => Side::Idle(Box::new(main_device)),
                Err(refused) => Side::Idle(Box::new(refused.main_device)),
            },
        },
    }
}

/// A line, or a ring of two links.
fn row(dice: &mut Dice) -> (Vec<&'static str>, Network) {
    let count = 2 + dice.below(KINDS.len() as u64 - 1) as usize;
    let kinds: Vec<&str> = (0..count).map(|_| *dice.pick(&KINDS)).collect();
    let described = descriptions(&kinds);
    let network = if dice.one_in(2) {
        ring(described, NetworkOptions::default())
    } else {
        line(described, NetworkOptions::default())
    };
    (kinds, network)
}

/// One or two rings behind junctions, on a line or in a ring of two links, with SubDevices before and behind each.
fn rings(dice: &mut Dice) -> (Vec<&'static str>, Network) {
    let (mut cables, mut count) = (Vec::new(), 0);
    let mut hang = |from: Endpoint, cables: &mut Vec<(Endpoint, Endpoint)>| {
        cables.push((from, at(count, Port::A)));
        count += 1;
        count - 1
    };
    let mut end = MAIN;
    for _ in 0..1 + dice.below(2) {
        for _ in 0..dice.below(2) {
            end = at(hang(end, &mut cables), Port::B);
        }
        let junction = hang(end, &mut cables);
        let mut member = at(junction, Port::D);
        for _ in 0..1 + dice.below(3) {
            member = at(hang(member, &mut cables), Port::B);
        }
        cables.push((member, at(junction, Port::B)));
        end = at(junction, Port::C);
    }
    for _ in 0..dice.below(2) {
        end = at(hang(end, &mut cables), Port::B);
    }
    if dice.one_in(2) {
        cables.push((end, REDUNDANT));
    }
    let kinds: Vec<&str> = (0..count).map(|_| *dice.pick(&KINDS)).collect();
    let network = wired(descriptions(&kinds), &cables);
    (kinds, network)
}

fn run(seed: u64) -> Result<(), String> {
    let mut dice = Dice::new(seed);
    let (kinds, network) = row(&mut dice);
    run_on(&mut dice, &kinds, network, JunctionMode::Disabled)
}

fn run_of_rings(seed: u64) -> Result<(), String> {
    let mut dice = Dice::new(seed);
    let (kinds, network) = rings(&mut dice);
    run_on(&mut dice, &kinds, network, JunctionMode::Automatic)
}

fn run_on(dice: &mut Dice, kinds: &[&str], network: Network, junctions: JunctionMode) -> Result<(), String> {
    let count = kinds.len();
    let options = Options::default().with_idle_operation(true).with_junctions(junctions);
    let mut side = Side::Idle(Box::new(MainDevice::request(Tap::new(network), &options)));
    let mut faults = Faults { cut: None, off: None };
    for _ in 0..8 + dice.below(12) {
        side.work(Duration::from_micros(dice.below(120_000)));
        if dice.one_in(2) {
            faults.change(dice, &mut side);
        }
        side = step(dice, side, &options);
    }
    faults.end(side.network());
    if let Side::Active(mut application) = side {
        let end = application.now() + RECOVERY;
        while !application.all_settled() {
            if application.now() >= end {
                return Err(format!("{kinds:?}: not settled: {:?}", application.states()));
            }
            application.cycle(|_| ());
        }
        let declared = application.states().len();
        let mut side = Side::Active(application);
        side.work(Duration::from_secs(3));
        let states: Vec<AlStatus> = side.network().devices().map(|device| device.al_status()).collect();
        let of = |state| states.iter().filter(|status| **status == AlStatus::new(state)).count();
        if (of(AlState::Op), of(AlState::PreOp)) != (declared, count - declared) {
            return Err(format!("{kinds:?}: {declared} declared: {states:?}"));
        }
        let Side::Active(application) = side else { return Ok(()) };
        let ended = application.deactivate(LastOutputs::Zero, Duration::from_secs(2)).map_err(Error::from);
        side = Side::Idle(Box::new(ended.map_err(|error| format!("{kinds:?}: {error}"))?));
        return in_preop(&mut side, count, kinds);
    }
    side.work(RECOVERY);
    in_preop(&mut side, count, kinds)
}

/// All are in PREOP, known, and answer.
fn in_preop(side: &mut Side, count: usize, kinds: &[&str]) -> Result<(), String> {
    side.work(Duration::from_millis(500));
    let states: Vec<AlStatus> = side.network().devices().map(|device| device.al_status()).collect();
    if states.iter().any(|status| *status != AlStatus::new(AlState::PreOp)) {
        return Err(format!("{kinds:?}: not in PREOP: {states:?}"));
    }
    let Side::Idle(main_device) = side else { return Err("an application is active".into()) };
    let found = main_device.subdevices();
    if found.len() != count {
        return Err(format!("{kinds:?}: {} found", found.len()));
    }
    for info in found.iter().filter(|info| info.protocols.coe()) {
        let read = main_device.subdevice(info.position).sdo_read::<u32>(0x1018, 1);
        read.map_err(|error| format!("{kinds:?}: {error}"))?;
    }
    let under_way = main_device.engine().under_way();
    if under_way.procedures > 6 + 2 * count {
        return Err(format!("{kinds:?}: procedures are left: {under_way:?}"));
    }
    ports_are_known(main_device).map_err(|error| format!("{kinds:?}: {error}"))
}

/// No port is closed on purpose, and the other end of each cable is known.
fn ports_are_known(main_device: &mut MainDevice<Tap>) -> Result<(), String> {
    let loops = |device: &Device| device.controller.register(map::DL_CONTROL, 2)[1];
    let closed: Vec<u8> = main_device.links_mut().network().devices().map(loops).collect();
    if closed.iter().any(|loops| *loops != 0) {
        return Err(format!("ports are closed: {closed:?}"));
    }
    for it in main_device.port_report().map_err(|error| error.to_string())? {
        let is_known = |port: &PortReport| port.registers.is_some_and(|now| now.link == port.neighbour.is_some());
        if !it.ports.iter().all(is_known) {
            return Err(format!("cables of SubDevice {} are not known: {:?}", it.position, it.ports));
        }
    }
    Ok(())
}

fn explore(what: &str, seeds: Range<u64>, run: impl Fn(u64) -> Result<(), String>) {
    let mut failed = Vec::new();
    for seed in seeds.clone() {
        if let Err(reason) = run(seed) {
            println!("seed {seed}: {reason}");
            failed.push(seed);
        }
    }
    println!("{what}: seeds {seeds:?}: {} fail", failed.len());
    assert!(failed.is_empty(), "seeds {failed:?}");
}

// covers: states, stop
#[test]
fn seeds_of_sequences_of_calls_with_faults() {
    explore("sequences", seeds::from_environment().unwrap_or(0..200), run);
}

// covers: states, stop, junctions, registers
#[test]
fn seeds_of_sequences_in_rings_behind_junctions() {
    explore("rings", seeds::from_environment().unwrap_or(0..8), run_of_rings);
}
