//! Random programs of the calls of `ecrt.h`, with cables, power, hung applications, refused states and other programs
//! meanwhile.
//!
//! Checked at all times: nothing panics; calls that do not wait let no time pass, the others keep their limits; outputs
//! inside the SubDevices are those that were queued, and move only while an application is active
//! ([`scenarios::calls::witness`]); emergencies and procedures are bounded. At the end all SubDevices are in PREOP
//! without FMMUs and SYNC signals, reach OP with complete data, answer, and are idle again.
//!
//! `SEED=17 cargo test -p scenarios --test virtual_time calls::seeds -- --nocapture` runs one seed, `SEED=0..10000`
//! many.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use ringcat::{DomainId, EmergencyRing, LastOutputs, SubDeviceId};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::register::map;
use scenarios::calls::configure::ChosenPdos;
use scenarios::calls::errno::Errno;
use scenarios::calls::master::Ecrt;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{descriptions, line, ring};

use super::{KINDS, SIZES, assert_idle, configure};

/// Longest start with clocks.
const START: Duration = Duration::from_secs(12);
/// Time after the last fault in which ports and applications recover by themselves.
const CALM: Duration = Duration::from_millis(1_500);
/// Procedures under way: a constant number, and per SubDevice.
const PROCEDURES: (usize, usize) = (40, 10);
const FEWEST_STEPS: u64 = 15;
const MORE_STEPS: u64 = 35;

/// What a seed has shown.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    steps: u64,
    activations: u64,
    refused: u64,
    incomplete_ends: u64,
    compared: u64,
    most_procedures: usize,
}

/// A program of calls under way.
struct Sequence {
    ecrt: Ecrt,
    dice: Dice,
    described: Vec<DeviceDescription>,
    configs: Vec<SubDeviceId>,
    rings: Vec<(EmergencyRing, usize)>,
    shown: Shown,
}

fn network(dice: &mut Dice, seed: u64) -> (Network, Vec<DeviceDescription>) {
    let count = *dice.pick(&SIZES);
    let kinds: Vec<&str> = (0..count).map(|_| *dice.pick(&KINDS)).collect();
    let mut described = descriptions(&kinds);
    if dice.one_in(3) {
        described[0].alias = 7;
    }
    let options = NetworkOptions::default().with_seed(seed);
    let options = options.with_detection_delay(Duration::from_micros(*dice.pick(&[10, 1_000])));
    let network = if dice.one_in(2) { ring } else { line };
    (network(described.clone(), options), described)
}

impl Sequence {
    fn new(seed: u64) -> Sequence {
        let mut dice = Dice::new(seed);
        let (network, described) = network(&mut dice, seed);
        let (ecrt, shown) = (Ecrt::new(network), Shown::default());
        Sequence { ecrt, dice, described, configs: Vec::new(), rings: Vec::new(), shown }
    }

    fn pause(&mut self) {
        let time = *self.dice.pick(&[10, 300, 2_000, 20_000, 150_000]);
        let time = self.dice.below(time);
        self.ecrt.pause(Duration::from_micros(time));
    }

    /// Configures a SubDevice: that of the segment at a position mostly, or another one.
    fn configure_one(&mut self) {
        let count = self.described.len() as u64;
        let at = self.dice.below(count + 1) as usize;
        let device = self.described[at.min(self.described.len() - 1)].clone();
        let mut identity = (device.identity.vendor_id, device.identity.product_code);
        if self.dice.one_in(10) {
            identity.1 += 1;
        }
        let (alias, position) = if self.dice.one_in(8) { (7, at) } else { (0, at) };
        let Ok(config) = self.ecrt.slave_config(alias, position as u16, identity) else { return };
        let entries = if self.dice.one_in(3) {
            let syncs = self.dice.pick(&ChosenPdos::ALL).of(&device);
            self.ecrt.pdos(config, &syncs);
            Ecrt::entries_of(&syncs)
        } else {
            self.ecrt.default_entries(config)
        };
        let domains = self.ecrt.domains() as u64;
        for entry in entries {
            if domains > 0 && !self.dice.one_in(8) {
                let domain = DomainId(self.dice.below(domains) as usize);
                let _ = self.ecrt.reg_pdo_entry(config, entry, domain, Some(&mut 0));
            }
        }
        if self.dice.one_in(4) && self.ecrt.found(config).is_some_and(|info| info.controller.features.dc) {
            self.ecrt.dc(config, 0x0300, 1_000_000, 100_000);
        }
        match self.dice.below(8) {
            0 => self.ecrt.watchdog(config, 0, *self.dice.pick(&[0, 100, 5_000])),
            1 => self.ecrt.config_sdo(config, 0x1C32, 1, &[0, 0]),
            2 => {
                let size = self.dice.below(5) as usize;
                self.rings.extend(self.ecrt.emerg_size(config, size).map(|ring| (ring, size)));
            }
            3 => {
                let _ = self.ecrt.create_sdo_request(config, 0x1018, 1);
                let _ = self.ecrt.create_reg_request(config);
            }
            4 => {
                let _ = self.ecrt.create_soe_request(config);
                let _ = self.ecrt.create_voe_handler(config);
            }
            5 => self.ecrt.select_reference_clock(config),
            _ => {}
        }
        self.configs.push(config);
    }

    fn configure_some(&mut self) {
        for _ in 0..self.dice.below(3) {
            let _ = self.ecrt.create_domain();
        }
        for _ in 0..self.dice.below(2 + self.described.len() as u64) {
            self.configure_one();
        }
        if self.dice.one_in(6) {
            self.ecrt.with_clocks();
        }
    }

    fn use_mailbox(&mut self) {
        let at = self.dice.below(self.described.len() as u64 + 1) as u16;
        match self.dice.below(6) {
            // Another assignment, by a program written for the device; a part of one, by a program that is killed.
            4 => {
                let other = [(0x1C12, 0, &[0][..]), (0x1C12, 1, &[1, 0x16]), (0x1C12, 0, &[1])];
                let count = 1 + self.dice.below(3) as usize;
                other[..count].iter().for_each(|(index, sub_index, data)| {
                    let _ = self.ecrt.sdo_download(at, *index, *sub_index, data);
                });
            }
            5 => drop(self.ecrt.sdo_download(at, 0x1C13, 0, &[0])),
            0 => drop(self.ecrt.sdo_upload(at, 0x1018, 1, 4)),
            1 => drop(self.ecrt.sdo_upload(at, 0x1008, 0, 64)),
            2 => drop(self.ecrt.sdo_download(at, 0x5FFF, 0, &[1, 2])),
            _ => drop(self.ecrt.sdo_upload(at, 0x1C12, 0, 1)),
        }
    }

    fn use_requests(&mut self) {
        let requests = &mut self.ecrt.requests;
        let (write, cancel) = (self.dice.one_in(3), self.dice.one_in(5));
        for request in &mut requests.sdo {
            let _ = if write { request.write(&[0; 4]) } else { request.read() };
            if cancel {
                request.cancel();
            }
        }
        for request in &mut requests.register {
            let _ = request.read(map::AL_STATUS, 2);
        }
        for request in &mut requests.soe {
            let _ = request.read();
        }
        for handler in &mut requests.voe {
            let _ = if write { handler.write(&[1, 2, 3]) } else { handler.read() };
            handler.execute();
        }
    }

    /// A call of a cycle.
    fn part(&mut self) {
        let domains = self.ecrt.domains() as u64;
        let domain = DomainId(self.dice.below(domains) as usize);
        match self.dice.below(14) {
            0..3 => self.ecrt.receive(),
            3 | 4 if domains > 0 => drop(self.ecrt.process(domain)),
            5..7 if domains > 0 => drop(self.ecrt.queue(domain)),
            7..10 => self.ecrt.send(),
            10 => self.ecrt.write(),
            11 => {
                let time = if self.dice.one_in(4) { self.dice.roll() } else { self.ecrt.application_clock() };
                self.ecrt.application_time(time);
            }
            12 => {
                let _ = self.ecrt.sync_reference_clock();
                let _ = self.ecrt.sync_slave_clocks();
                let _ = self.ecrt.sync_monitor_queue();
            }
            13 => {
                let _ = self.ecrt.reference_clock_time();
                self.ecrt.sync_monitor_process();
                let configs = self.configs.clone();
                self.ecrt.master_state();
                for config in configs {
                    let _ = self.ecrt.slave_config_state(config);
                }
            }
            _ => self.pause(),
        }
    }

    fn activate(&mut self) {
        let was_active = self.ecrt.is_active();
        match self.ecrt.activate() {
            Ok(()) if !was_active => self.shown.activations += 1,
            Ok(()) => {}
            Err(error) => self.shown.refused += u64::from(error != Errno::NoDev),
        }
    }

    fn deactivate(&mut self) {
        let outputs = if self.dice.one_in(2) { LastOutputs::Zero } else { LastOutputs::Held };
        let was_active = self.ecrt.is_active();
        let result = self.ecrt.deactivate_with(outputs);
        assert!(was_active || result.is_err());
        self.shown.incomplete_ends += u64::from(was_active && result.is_err());
        self.configs.clear();
    }

    fn step(&mut self) {
        self.shown.steps += 1;
        let is_active = self.ecrt.is_active();
        match self.dice.below(20) {
            0 | 1 => drop(self.ecrt.request()),
            2 | 3 => self.configure_some(),
            4..7 => self.activate(),
            7 if self.dice.one_in(2) => self.use_mailbox(),
            7 => self.use_requests(),
            8 => self.deactivate(),
            9 if self.dice.one_in(2) => {
                self.ecrt.release();
                self.configs.clear();
            }
            10 if self.dice.one_in(3) => {
                self.ecrt.killed();
                self.configs.clear();
                self.rings.clear();
            }
            11 => self.ecrt.reset(),
            12 => {
                for (ring, _) in &self.rings {
                    let _ = Ecrt::emerg_pop(ring);
                }
            }
            13 | 14 => (0..self.dice.below(30)).for_each(|_| self.part()),
            15..19 if is_active => {
                let count = *self.dice.pick(&[3, 20, 150]);
                let count = self.dice.below(count) as usize;
                self.ecrt.cycles(count);
            }
            _ => self.pause(),
        }
        for (ring, size) in &self.rings {
            assert!(ring.len() <= *size, "{} emergencies in a ring of {size}", ring.len());
        }
        let procedures = self.ecrt.side.engine().under_way().procedures;
        self.shown.most_procedures = self.shown.most_procedures.max(procedures);
        let most = PROCEDURES.0 + PROCEDURES.1 * self.described.len();
        assert!(procedures <= most, "{procedures} procedures are under way");
    }

    fn disturb(&mut self) {
        let mut faults = std::mem::take(&mut self.ecrt.faults);
        let hung = faults.hung();
        let text = faults.change(&mut self.dice, self.ecrt.network());
        self.go_on(hung.filter(|device| faults.hung() != Some(*device)));
        self.ecrt.faults = faults;
        self.ecrt.note(text);
    }

    /// A device does not hang any more.
    fn go_on(&mut self, device: Option<DeviceIndex>) {
        let Some(device) = device else { return };
        let mut witness = std::mem::take(&mut self.ecrt.witness);
        witness.go_on(self.ecrt.network(), device);
        self.ecrt.witness = witness;
    }

    /// The segment recovers: all SubDevices are idle, reach OP, and are idle again.
    fn end(&mut self) {
        let count = self.described.len();
        let mut faults = std::mem::take(&mut self.ecrt.faults);
        let hung = faults.hung();
        faults.end(self.ecrt.network());
        self.go_on(hung);
        self.ecrt.note("all faults end");
        if self.ecrt.is_active() && self.dice.one_in(2) {
            self.ecrt.cycles(CALM.as_millis() as usize);
        } else {
            self.ecrt.pause(CALM);
        }
        self.ecrt.release();
        if self.ecrt.side.is_active() {
            unreachable!("a release ends it");
        }
        self.ecrt.pause(CALM);
        self.ecrt.request().expect("it is free");
        assert_idle(&mut self.ecrt, "requested after the last fault");
        let (_, configs) = configure(&mut self.ecrt, 0..count);
        assert_eq!(configs.len(), count, "all are found");
        if self.dice.one_in(4) {
            self.ecrt.with_clocks();
        }
        self.ecrt.activate().expect("it fits");
        if let Err(error) = self.ecrt.cycle_until_op(START) {
            panic!("{error}");
        }
        self.ecrt.cycles(20);
        let all = self.ecrt.master_state();
        assert_eq!((usize::from(all.responding), all.al_states), (count, 8));
        self.answer();
        self.ecrt.deactivate().expect("all follow");
        assert_idle(&mut self.ecrt, "at the end");
        self.answer();
    }

    /// All mailboxes answer.
    fn answer(&mut self) {
        let found = self.ecrt.side.engine().subdevices();
        assert_eq!(found.len(), self.described.len());
        for info in found.iter().filter(|info| info.protocols.coe()) {
            let read = self.ecrt.sdo_upload(info.position.0, 0x1018, 1, 4);
            assert_eq!(read.as_deref(), Ok(&info.identity.vendor_id.to_le_bytes()[..]), "at {}", info.position);
        }
    }
}

fn run(seed: u64) -> Shown {
    let mut sequence = Sequence::new(seed);
    let is_disturbed = !sequence.dice.one_in(8);
    let _ = sequence.ecrt.request();
    for _ in 0..FEWEST_STEPS + sequence.dice.below(MORE_STEPS) {
        if is_disturbed && sequence.dice.one_in(4) {
            sequence.disturb();
        }
        sequence.step();
    }
    sequence.end();
    Shown { compared: sequence.ecrt.witness.compared, ..sequence.shown }
}

fn explore(seeds: Range<u64>) {
    let (mut failed, mut all) = (Vec::new(), Shown::default());
    for seed in seeds.clone() {
        match catch_unwind(AssertUnwindSafe(|| run(seed))) {
            Ok(shown) => {
                all.steps += shown.steps;
                all.activations += shown.activations;
                all.refused += shown.refused;
                all.incomplete_ends += shown.incomplete_ends;
                all.compared += shown.compared;
                all.most_procedures = all.most_procedures.max(shown.most_procedures);
            }
            Err(_) => {
                println!("seed {seed} failed: SEED={seed} repeats it");
                failed.push(seed);
            }
        }
    }
    println!("calls: seeds {seeds:?}: {} fail; {all:?}", failed.len());
    assert!(failed.is_empty(), "seeds {failed:?}");
    let count = seeds.end - seeds.start;
    assert!(count < 20 || (all.activations > count / 2 && all.compared > 10 * count), "too little: {all:?}");
}

// covers: states, stop, api
#[test]
fn seeds_of_random_programs_of_calls_with_faults() {
    explore(seeds::from_environment().unwrap_or(0..30));
}
