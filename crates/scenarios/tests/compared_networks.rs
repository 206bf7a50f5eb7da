//! Networks of files on buses that were changed at random: `compare` marks a difference that prevents OP exactly if the
//! network does not reach OP there, by the network file and by its ENI.

use std::time::Duration;

use ringcat::config::network::model::Required;
use ringcat::config::{Configuration, Difference, ExportOptions, FoundNetwork, Stated};
use ringcat::eni::EniFile;
use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
use ringcat::simulated::SimulatedSegment;
use ringcat::{Declaration, MainDevice, Options, Scan};
use scenarios::dice::Dice;
use scenarios::seeds;

const PERIOD: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(5);
const TYPES: [&str; 5] = ["coupler", "digital-output-8", "digital-input-8", "analog-input-4", "servo"];

/// A type, an alias, a serial number.
type Unit = (&'static str, u16, u32);

fn scanned(units: &[Unit]) -> (MainDevice<SimulatedSegment>, Scan) {
    let device = |(at, (kind, alias, serial)): (usize, &Unit)| {
        format!("[[device]]\ntype = \"{kind}\"\nname = \"d{at}\"\nalias = {alias}\nserial = {serial}\n")
    };
    let text: String = units.iter().enumerate().map(device).collect();
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(&text).unwrap(), &Options::default());
    let scan = main_device.scan().unwrap_or_else(|error| panic!("{units:?}: {error}"));
    (main_device, scan)
}

fn found(scan: &Scan) -> FoundNetwork<'_> {
    FoundNetwork { subdevices: &scan.subdevices, topology: &scan.topology, firmware: &[] }
}

/// Whether the declared network reaches OP, or the reason.
fn reaches_op(main_device: MainDevice<SimulatedSegment>, declaration: Declaration) -> Result<(), String> {
    let mut application = main_device.activate(declaration).map_err(|error| error.to_string())?;
    application.wait_until_op(LIMIT).map_err(|error| error.to_string())
}

/// One to three changes; a new unit has a serial number of its own.
fn change(units: &mut Vec<Unit>, dice: &mut Dice) {
    for count in 0..1 + dice.below(3) {
        let new = (*dice.pick(&TYPES), 0, 900 + count as u32);
        let places = units.len() as u64;
        let (at, other) = (dice.below(places) as usize, dice.below(places) as usize);
        match dice.below(4) {
            0 if units.len() > 1 => drop(units.remove(at)),
            1 => units.insert(at, new),
            2 => units.swap(at, other),
            _ => units[at] = (new.0, units[at].1, new.2),
        }
    }
}

/// Checks the marks of a file on a bus.
fn check(
    configuration: &Configuration,
    stated: &[Stated],
    declaration: Declaration,
    bus: &[Unit],
) -> Result<(), String> {
    let (main_device, scan) = scanned(bus);
    let differences: Vec<Difference> = configuration.differences(found(&scan), stated);
    let is_prevented = differences.iter().any(|it| it.prevents_op);
    let required = declaration.required;
    let reached = reaches_op(main_device, declaration);
    if is_prevented != reached.is_ok() {
        return Ok(());
    }
    let texts: Vec<String> = differences.iter().map(|it| format!("{} {}", it.prevents_op, it.text)).collect();
    Err(format!("{bus:?}, {required:?}: {reached:?}, {texts:#?}"))
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
            (*dice.pick(&TYPES), alias, 100 + at as u32)
        };
        let count = 1 + dice.below(7);
        let mut units: Vec<Unit> = (0..count).map(|at| unit(at as usize, &mut dice)).collect();
        let (_, scan) = scanned(&units);
        let mut options = ScanOptions::new("machine", PERIOD);
        (options.by_alias, options.check_serial) = (has_aliases, has_serials);
        let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &options);
        let mut eni = file.to_eni(&ExportOptions::default()).ok();
        assert!(eni.is_some() || has_aliases, "seed {seed}");
        if eni.is_none() || dice.one_in(2) {
            eni = None;
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
