//! Networks of files are compared with buses that were changed at random: with SYNC signals, with modules in slots, and
//! with process data that is left to the EEPROM or assigned by start-up commands. `compare` marks a difference that
//! prevents OP exactly if the network does not reach OP there, by the network file and by its ENI.

use std::path::Path;
use std::time::Duration;

use ringcat::config::network::Bytes;
use ringcat::config::network::model::{Clocks, Required, Sdo, Startup, SyncManager};
use ringcat::config::{Configuration, Difference, ExportOptions, FoundNetwork, StatedProperties};
use ringcat::eni::EniFile;
use ringcat::esi::EsiDevices;
use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{AlState, Declaration, MainDevice, Options, Position, Scan, SyncSignals};
use scenarios::dice::Dice;
use scenarios::seeds;

const PERIOD: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(5);
const FILES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files");
const TYPES: [&str; 8] = [
    "coupler",
    "digital-output-8",
    "digital-input-8",
    "emulated-output-8",
    "analog-input-4",
    "servo",
    "AM01\"\nesi = \"acme.xml\"\nmodules = [\"0x00010001\"]\n#",
    "AM01\"\nesi = \"acme.xml\"\nmodules = [\"0x00010002\"]\n#",
];

/// A device of the bus.
#[derive(Clone, Copy, Debug)]
struct Unit {
    kind: &'static str,
    alias: u16,
    serial: u32,
    has_clock: bool,
}

impl Unit {
    fn is_modular(&self) -> bool {
        self.kind.starts_with("AM01")
    }

    fn text(&self, at: usize) -> String {
        let Unit { kind, alias, serial, has_clock } = self;
        let clock = if *has_clock || self.is_modular() { "" } else { "clock_bits = 0\n" };
        format!("[[device]]\ntype = \"{kind}\"\nname = \"d{at}\"\nalias = {alias}\nserial = {serial}\n{clock}")
    }
}

fn scanned(units: &[Unit]) -> (MainDevice<SimulatedSegment>, Scan) {
    let text: String = units.iter().enumerate().map(|(at, unit)| unit.text(at)).collect();
    let segment = Segment::from_toml_with(&text, Path::new(FILES), &EsiDevices::default());
    let segment = segment.unwrap_or_else(|error| panic!("{error}\n{text}"));
    let links = SimulatedSegment::new(Network::from_description(segment).unwrap());
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().unwrap_or_else(|error| panic!("{units:?}: {error}"));
    (main_device, scan)
}

/// The modules that the SubDevices list.
fn listed(units: &[Unit]) -> Vec<Option<Vec<u32>>> {
    let (mut main_device, _) = scanned(units);
    let mut list = |at: usize| {
        let position = Position(at as u16);
        main_device.subdevice(position).request_state(AlState::PreOp).unwrap();
        let count: u8 = main_device.subdevice(position).sdo_read(0xF050, 0).unwrap();
        (1..=count).map(|slot| main_device.subdevice(position).sdo_read(0xF050, slot).unwrap()).collect()
    };
    units.iter().enumerate().map(|(at, unit)| unit.is_modular().then(|| list(at))).collect()
}

/// Commands that write a list with one module.
fn list_of(ident: u32) -> Vec<Startup> {
    let command = |sub, data: &[u8]| {
        let data = Bytes(data.to_vec());
        Startup { sdo: Some(Sdo { index: 0xF030, sub, data, complete: false }), ..Startup::default() }
    };
    vec![command(0, &[0]), command(1, &ident.to_le_bytes()), command(0, &[1])]
}

/// Whether the declared network reaches OP, or the reason.
fn reaches_op(main_device: MainDevice<SimulatedSegment>, declaration: Declaration) -> Result<(), String> {
    let mut application = main_device.activate(declaration).map_err(|error| error.to_string())?;
    application.wait_until_op(LIMIT).map_err(|error| error.to_string())
}

fn kind(dice: &mut Dice) -> &'static str {
    TYPES[dice.below(TYPES.len() as u64) as usize]
}

/// One to three changes; a new unit has a serial number of its own.
fn change(units: &mut Vec<Unit>, dice: &mut Dice) {
    for count in 0..1 + dice.below(3) {
        let new = Unit { kind: kind(dice), alias: 0, serial: 900 + count as u32, has_clock: dice.one_in(2) };
        let places = units.len() as u64;
        let (at, other) = (dice.below(places) as usize, dice.below(places) as usize);
        match dice.below(5) {
            0 if units.len() > 1 => drop(units.remove(at)),
            1 => units.insert(at, new),
            2 => units.swap(at, other),
            3 => units[at] = Unit { alias: units[at].alias, ..new },
            _ => units[at].has_clock = !units[at].has_clock,
        }
    }
}

/// Checks the marks of a file on a bus.
fn check(
    configuration: &Configuration,
    stated: &[StatedProperties],
    declaration: Declaration,
    bus: &[Unit],
) -> Result<(), String> {
    let (main_device, scan) = scanned(bus);
    let modules = listed(bus);
    let network = FoundNetwork::new(&scan.subdevices, &scan.topology).with_modules(&modules);
    let differences: Vec<Difference> = configuration.differences(network, stated);
    let is_prevented = differences.iter().any(|it| it.prevents_op);
    let required = declaration.required;
    let reached = reaches_op(main_device, declaration);
    if is_prevented != reached.is_ok() {
        return Ok(());
    }
    let texts: Vec<String> = differences.iter().map(|it| format!("{} {}", it.prevents_op, it.text)).collect();
    Err(format!("{bus:?}, {required:?}: {reached:?}, {texts:#?}"))
}

/// Gives SubDevices with a clock SYNC signals, one of them the reference, and modular ones a list of modules.
fn synchronize(file: &mut NetworkFile, (scan, units): (&Scan, &[Unit]), dice: &mut Dice) {
    let has_clock = |at: usize| scan.subdevices[at].controller.features.dc;
    let with_clock: Vec<usize> = (0..file.subdevice.len()).filter(|at| has_clock(*at)).collect();
    if !with_clock.is_empty() && dice.one_in(2) {
        let reference = dice.one_in(2).then(|| file.subdevice[*dice.pick(&with_clock)].name.clone());
        file.clocks = Some(Clocks { reference, ..Clocks::default() });
        for at in with_clock {
            let signals = SyncSignals::sync0(1_000_000, 0).with_assign_activate(0x0300);
            file.subdevice[at].sync = dice.one_in(3).then(|| signals.into());
        }
    }
    for (it, unit) in file.subdevice.iter_mut().zip(units) {
        // Without a list nothing shows that the modules differ.
        if unit.is_modular() {
            let own = if unit.kind.contains("0x00010001") { 0x1_0001 } else { 0x1_0002 };
            it.startup = list_of(own);
        }
    }
}

/// Leaves process data to the EEPROM, maps more, or writes the assignment with start-up commands.
fn vary(file: &mut NetworkFile, units: &[Unit], dice: &mut Dice) {
    let simple = |(_, unit): &(_, &Unit)| !unit.is_modular();
    for (it, _) in file.subdevice.iter_mut().zip(units).filter(simple) {
        match dice.below(12) {
            0 => it.sync_manager.clear(),
            1 => drop(it.sync_manager.pop()),
            // A SubDevice that permits other mappings may refuse this one.
            2 if it.mailbox.as_ref().is_none_or(|mailbox| !mailbox.pdo_config) => {
                let entries = it.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo).flat_map(|pdo| &mut pdo.entries);
                entries.flatten().take(1).for_each(|entry| entry.bits += 8);
            }
            _ => {}
        }
        if it.mailbox.is_some() && dice.one_in(4) {
            let assigned = it.sync_manager.iter().filter(|sm| !sm.pdo.is_empty());
            it.startup = assigned.flat_map(|sm| assignment(sm, dice.one_in(8))).collect();
        }
    }
}

/// Commands that assign the PDOs of a SyncManager, or none.
fn assignment(of: &SyncManager, is_cleared: bool) -> Vec<Startup> {
    let write = |sub: u8, data: &[u8]| {
        let sdo = Sdo { index: 0x1C10 + u16::from(of.number), sub, data: Bytes(data.to_vec()), complete: false };
        Startup { sdo: Some(sdo), ..Startup::default() }
    };
    let entries = (1..).zip(&of.pdo).map(|(sub, pdo)| write(sub, &pdo.index.to_le_bytes()));
    let count = if is_cleared { 0 } else { of.pdo.len() as u8 };
    std::iter::once(write(0, &[0])).chain(entries).chain([write(0, &[count])]).collect()
}

// covers: network-file, eni-run
#[test]
fn differences_are_marked_exactly_if_a_changed_bus_does_not_reach_op() {
    let mut failed = Vec::new();
    for seed in seeds::from_environment().unwrap_or(1..60) {
        let mut dice = Dice::new(seed);
        let (has_aliases, has_serials) = (dice.one_in(3), dice.one_in(3));
        let unit = |at: usize, dice: &mut Dice| {
            let alias = if has_aliases && dice.one_in(2) { 50 + at as u16 } else { 0 };
            Unit { kind: kind(dice), alias, serial: 100 + at as u32, has_clock: !dice.one_in(4) }
        };
        let count = 1 + dice.below(7);
        let mut units: Vec<Unit> = (0..count).map(|at| unit(at as usize, &mut dice)).collect();
        let (_, scan) = scanned(&units);
        let mut options = ScanOptions::new("machine", PERIOD);
        (options.by_alias, options.check_serial) = (has_aliases, has_serials);
        let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &options);
        synchronize(&mut file, (&scan, &units), &mut dice);
        let plain = file.clone();
        vary(&mut file, &units, &mut dice);
        let mut eni = file.to_eni(&ExportOptions::default()).ok();
        // Clocks without a reference and SYNC signals cannot be exported.
        assert!(eni.is_some() || has_aliases || file.clocks.is_some(), "seed {seed}");
        if eni.is_none() || dice.one_in(2) {
            eni = None;
            file.subdevice = plain.subdevice;
            file.subdevice.iter_mut().for_each(|it| it.optional = dice.one_in(4));
            file.required = *dice.pick(&[Required::All, Required::Mandatory]);
        }
        let before = units.clone();
        change(&mut units, &mut dice);
        let network = LoadedNetwork::new(file);
        let by_file = check(&network.configuration, &network.stated(), network.declaration(), &units);
        failed.extend(by_file.err().map(|text| format!("seed {seed}: {before:?}, {text}")));
        if let Some(eni) = eni {
            let eni = EniFile::from_bytes(eni.text.as_bytes()).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            let by_eni = check(&eni.configuration, &eni.stated(), eni.declaration(false), &units);
            failed.extend(by_eni.err().map(|text| format!("seed {seed}, ENI: {before:?}, {text}")));
        }
    }
    assert!(failed.is_empty(), "{} failed: {failed:#?}", failed.len());
}
