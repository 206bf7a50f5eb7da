//! `compare` names several SubDevices with one alias, identification or data word, of which the activation takes none.
//! The same network is activated on the simulated bus, and has to reach OP exactly if no difference is marked.

use std::time::Duration;

use ringcat::config::network::model::{Required, SubDevice};
use ringcat::config::{Difference, DifferenceKind, FoundNetwork};
use ringcat::network::{LoadedNetwork, NetworkFailure, NetworkFile, ScanOptions};
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, Scan};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use scenarios::dice::Dice;
use scenarios::seeds::from_environment;
use scenarios::segments::{descriptions, line};

use DifferenceKind::{Additional, Ambiguous, Missing};

const LIMIT: Duration = Duration::from_secs(5);
const PERIOD: Duration = Duration::from_millis(1);
/// Address of a data word that no SII names.
const WORD: u16 = 0x1000;

/// Kind of identifier of a SubDevice.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Alias,
    Identification,
    DataWord,
}

const KINDS: [Kind; 3] = [Kind::Alias, Kind::Identification, Kind::DataWord];

impl Kind {
    fn give(self, device: &mut DeviceDescription, value: u16) {
        match self {
            Kind::Alias => device.alias = value,
            Kind::Identification => device.identification = Some(value),
            Kind::DataWord => (device.id_switch_address, device.data_word) = (None, Some((WORD, value))),
        }
    }

    fn declare(self, subdevice: &mut SubDevice, value: u16) {
        subdevice.position = None;
        match self {
            Kind::Alias => subdevice.alias = Some(value),
            Kind::Identification => subdevice.identification = Some(value),
            Kind::DataWord => {
                (subdevice.identification, subdevice.identification_word) = (Some(value), Some(WORD));
            }
        }
    }

    fn words(self) -> &'static str {
        match self {
            Kind::Alias => "alias 7",
            Kind::Identification => "identification 7",
            Kind::DataWord => "data word 7 at 0x1000",
        }
    }
}

/// Devices of these types; devices of a type with `=` behind it have this identifier.
fn devices(types: &[&str], kind: Kind) -> Vec<DeviceDescription> {
    let (names, values): (Vec<&str>, Vec<Option<u16>>) = types
        .iter()
        .map(|it| it.split_once('=').map_or((*it, None), |(name, value)| (name, value.parse().ok())))
        .unzip();
    let mut devices = descriptions(&names);
    for (device, value) in devices.iter_mut().zip(values) {
        if let Some(value) = value {
            kind.give(device, value);
        }
    }
    devices
}

fn scanned(types: &[&str], kind: Kind) -> (MainDevice<SimulatedSegment>, Scan) {
    let network = line(devices(types, kind), NetworkOptions::default());
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let scan = main_device.scan().expect("the scan succeeds");
    (main_device, scan)
}

/// The file of a bus, after a change.
fn file_of(types: &[&str], kind: Kind, change: impl FnOnce(&mut NetworkFile)) -> LoadedNetwork {
    read(types, kind, change).unwrap_or_else(|error| panic!("{error}"))
}

/// The same, which may be refused.
fn read(types: &[&str], kind: Kind, change: impl FnOnce(&mut NetworkFile)) -> Result<LoadedNetwork, NetworkFailure> {
    let (_, scan) = scanned(types, kind);
    let mut file = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &ScanOptions::new("machine", PERIOD));
    for subdevice in &mut file.subdevice {
        (subdevice.position, subdevice.plugged_into) = (None, None);
    }
    change(&mut file);
    LoadedNetwork::from_bytes("machine.toml", file.to_text().as_bytes())
}

/// The differences of a bus, whose marks are checked on the bus.
fn checked(network: &LoadedNetwork, types: &[&str], kind: Kind) -> Vec<Difference> {
    let (mut main_device, mut scan) = scanned(types, kind);
    main_device.read_data_words(&network.configuration.declaration.subdevices, &mut scan);
    let found = FoundNetwork::new(&scan.subdevices, &scan.topology);
    let differences = network.configuration.differences(found, &network.stated());
    let is_prevented = differences.iter().any(|it| it.prevents_op);
    let reached = main_device.activate(network.declaration()).map_err(|error| error.to_string());
    let reached = reached.and_then(|mut it| it.wait_until_op(LIMIT).map_err(|error| error.to_string()));
    assert_eq!(!is_prevented, reached.is_ok(), "{types:?} {kind:?}: {reached:?}: {differences:#?}");
    differences
}

fn short(differences: &[Difference]) -> Vec<(DifferenceKind, bool, Option<u16>)> {
    differences.iter().map(|it| (it.kind, it.prevents_op, it.position.map(|at| at.0))).collect()
}

const BUS: [&str; 3] = ["coupler", "servo=7", "digital-output-8"];

// covers: network-file
#[test]
fn duplicates_of_a_declared_subdevice_prevent_op_and_both_are_reported() {
    for kind in KINDS {
        let network = file_of(&BUS, kind, |file| kind.declare(&mut file.subdevice[1], 7));
        assert_eq!(short(&checked(&network, &BUS, kind)), [], "{kind:?}");
        let twins = ["coupler", "servo=7", "digital-output-8", "servo=7"];
        let found = checked(&network, &twins, kind);
        assert_eq!(short(&found), [(Additional, false, Some(3)), (Ambiguous, true, Some(1))], "{kind:?}: {found:#?}");
        let expected =
            format!("\"{}\": {} belongs to position 1 and to position 3", network.file.subdevice[1].name, kind.words());
        assert_eq!(found[1].text, expected);
        // The duplicate is another device, which is declared itself: no SubDevice is additional.
        let other = ["coupler", "servo=7", "digital-output-8=7"];
        assert_eq!(short(&checked(&network, &other, kind)), [(Ambiguous, true, Some(1))], "{kind:?}");
    }
}

// covers: network-file
#[test]
fn the_declared_device_is_compared_and_not_its_duplicate() {
    let bus = ["coupler", "digital-output-8", "servo=7"];
    for kind in KINDS {
        let network = file_of(&bus, kind, |file| kind.declare(&mut file.subdevice[2], 7));
        let before = ["coupler", "digital-output-8=7", "servo=7"];
        assert_eq!(short(&checked(&network, &before, kind)), [(Ambiguous, true, Some(1))], "{kind:?}");
    }
}

// covers: network-file, hot-connect
#[test]
fn duplicates_of_a_group_head_leave_the_group_absent_and_are_reported_once() {
    let bus = ["coupler", "digital-output-8", "servo=7", "digital-input-8"];
    let grouped = |kind: Kind, required: Required| {
        file_of(&bus, kind, move |file| {
            for subdevice in &mut file.subdevice[2..] {
                subdevice.group = Some("tool".to_owned());
            }
            kind.declare(&mut file.subdevice[2], 7);
            file.required = required;
        })
    };
    for kind in KINDS {
        let network = grouped(kind, Required::Mandatory);
        assert_eq!(short(&checked(&network, &bus, kind)), [], "{kind:?}");
        let behind = ["coupler", "digital-output-8", "servo=7", "digital-input-8", "servo=7"];
        let found = checked(&network, &behind, kind);
        assert_eq!(short(&found), [(Additional, false, Some(4)), (Ambiguous, false, Some(2))], "{kind:?}: {found:#?}");
        // Positions count the members of an ambiguous group.
        let before = ["coupler", "servo=7", "digital-input-8", "digital-output-8", "servo=7"];
        let found = checked(&network, &before, kind);
        assert!(short(&found).contains(&(Ambiguous, true, Some(1))), "{kind:?}: {found:#?}");
        let found = checked(&grouped(kind, Required::All), &behind, kind);
        assert_eq!(short(&found), [(Additional, false, Some(4)), (Ambiguous, true, Some(2))], "{kind:?}: {found:#?}");
        let found = checked(&network, &bus[..2], kind);
        assert_eq!(short(&found), [(Missing, false, None); 2], "{kind:?}: {found:#?}");
    }
}

/// A bus of up to six devices, some of which have an identifier of 1 or 2.
fn random_bus(dice: &mut Dice) -> Vec<String> {
    const TYPES: [&str; 3] = ["digital-output-8", "digital-input-8", "servo"];
    let device = |dice: &mut Dice| {
        let kind = *dice.pick(&TYPES);
        match dice.below(2) {
            0 => kind.to_owned(),
            _ => format!("{kind}={}", 1 + dice.below(2)),
        }
    };
    std::iter::once("coupler".to_owned()).chain((0..=dice.below(5)).map(|_| device(dice))).collect()
}

/// Declares SubDevices with an identifier by it, some as heads of groups, some as optional.
fn random_file(file: &mut NetworkFile, bus: &[String], kind: Kind, dice: &mut Dice) {
    let mut group: Option<String> = None;
    for (at, (subdevice, device)) in file.subdevice.iter_mut().zip(bus).enumerate() {
        let mark = device.split_once('=').and_then(|(_, value)| value.parse().ok());
        group = group.filter(|_| mark.is_none() && dice.below(2) == 0);
        match mark {
            Some(mark) if dice.below(3) > 0 => {
                kind.declare(subdevice, mark);
                group = (dice.below(2) == 0).then(|| format!("group {at}"));
            }
            _ => {}
        }
        subdevice.group.clone_from(&group);
        subdevice.optional = dice.below(4) == 0;
    }
    file.required = if dice.below(4) == 0 { Required::All } else { Required::Mandatory };
}

// covers: network-file, hot-connect
#[test]
fn random_duplicates_are_marked_as_the_activation_decides() {
    let (seeds, mut with_twins) = (from_environment().unwrap_or(0..60), 0);
    for seed in seeds.clone() {
        let mut dice = Dice::new(seed);
        let kind = *dice.pick(&KINDS);
        let declared = random_bus(&mut dice);
        let mut bus = declared.clone();
        for _ in 0..dice.below(3) {
            let (one, other) = (dice.below(bus.len() as u64) as usize, dice.below(bus.len() as u64) as usize);
            match dice.below(3) {
                0 if one > 0 => bus.insert(one, bus[other].clone()),
                1 if one > 0 && bus.len() > 2 => drop(bus.remove(one)),
                _ => bus.swap(one, other),
            }
        }
        let types: Vec<&str> = declared.iter().map(String::as_str).collect();
        let change = |file: &mut NetworkFile| random_file(file, &declared, kind, &mut dice);
        // Files that declare an identifier twice are refused.
        let Ok(network) = read(&types, kind, change) else { continue };
        println!("seed {seed}: file {declared:?}, bus {bus:?}, {kind:?}\n{}", network.file.to_text());
        let differences = checked(&network, &bus.iter().map(String::as_str).collect::<Vec<&str>>(), kind);
        with_twins += usize::from(differences.iter().any(|it| it.kind == Ambiguous));
    }
    assert!(with_twins > 0 || seeds.count() < 60, "no bus had twins of a declared SubDevice");
}
