//! `ringcat compare`: the network that is there, compared with the one of a file.

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use ringcat::SubDeviceInfo;
use ringcat::config::{Configuration, FoundNetwork, ObjectNames, StatedProperties};
use ringcat::eni::EniFile;
use ringcat::network::LoadedNetwork;

use crate::bus::{Bus, BusArguments, Wanted};
use crate::descriptions::{Descriptions, EsiArgument, complete};
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::network::{Compare, Difference};
use crate::output::{counted, say, warn};
use crate::verdict::{Report, Verdict};

/// Columns of a line.
const WIDTH: usize = 80;
/// Columns of the kind of a difference, and the blanks before it.
const KIND: usize = 16;

/// Text at the end of the long help.
const ABOUT_COMPARE: &str = "\
A SubDevice that is missing or additional is one difference, not another
identity of all SubDevices behind it. Differences that prevent OP are marked
with an exclamation mark. All SubDevices are in INIT afterwards.

Exit status: 0 no difference, 1 at least one, 2 the network or the file could
not be read.";

/// Options of `ringcat compare`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_COMPARE, group(ArgGroup::new("file").required(true).args(["eni", "network"])))]
pub struct CompareArguments {
    #[command(flatten)]
    bus: BusArguments,
    /// The network of an ENI
    #[arg(long, value_name = "FILE", help_heading = "Segment")]
    eni: Option<PathBuf>,
    /// The network of a network file (see docs/network-file.md)
    #[arg(long, value_name = "FILE.toml", help_heading = "Segment")]
    network: Option<PathBuf>,
    #[command(flatten)]
    esi: EsiArgument,
}

/// What the file declares.
struct Declared {
    configuration: Configuration,
    stated: Vec<StatedProperties>,
    /// Names of objects, by SubDevice.
    names: Vec<ObjectNames>,
}

/// Scans and prints every difference.
pub fn run(arguments: &CompareArguments) -> Result<Report, Failure> {
    let Declared { configuration, mut stated, names: declared } = load(arguments)?;
    let mut descriptions = arguments.esi.open()?;
    let mut counterparts = Vec::new();
    let mut bus = arguments.bus.scan(Some(&configuration), |found| {
        counterparts = configuration.counterparts(found, &stated);
        let both = found.iter().zip(&counterparts);
        both.map(|(info, config)| wanted(&configuration, &stated, descriptions.as_mut(), (info, *config))).collect()
    })?;
    let unlisted = report_unlisted(&bus, &configuration, &counterparts);
    mark_modular(&mut stated, &bus, &counterparts, descriptions.as_mut());
    let described = complete(descriptions.as_mut(), &mut bus.scan.subdevices, &bus.modules)?;
    bus.warnings.print(&described);
    let found = &bus.scan.subdevices;
    let network = FoundNetwork::new(found, &bus.scan.topology)
        .with_firmware(&bus.firmware)
        .with_modules(&bus.lists)
        .with_redundant(bus.ring)
        .with_not_closed(bus.not_closed);
    let mut differences = configuration.differences(network, &stated);
    for difference in &mut differences {
        let of_file = difference.subdevice.and_then(|at| declared.get(at.0));
        let of_bus = difference.position.and_then(|at| described.get(usize::from(at.0)));
        for names in of_file.into_iter().chain(of_bus) {
            difference.text = names.annotate(&difference.text);
        }
    }
    print(&differences);
    let names = configuration.names();
    let json = |it: &ringcat::eni::Difference| Difference {
        kind: it.kind.word().to_owned(),
        subdevice: it.subdevice.map(|at| at.0),
        name: it.subdevice.and_then(|at| names.get(at.0).cloned()),
        position: it.position.map(|position| position.0),
        prevents_op: it.prevents_op,
        text: it.text.clone(),
    };
    let data = Data::Compare(Compare {
        declared: configuration.declaration.subdevices.len(),
        found: found.len(),
        differences: differences.iter().map(json).collect(),
        modules_not_compared: unlisted.clone(),
    });
    let subdevices = counted(found.len(), "SubDevice", "SubDevices");
    let verdict = if differences.is_empty() {
        let but = match unlisted.len() {
            0 => String::new(),
            count => format!("; the modules of {} are not compared", counted(count, "SubDevice", "SubDevices")),
        };
        Verdict::Held(format!("{subdevices}, as in the file{but}"))
    } else {
        let preventing = differences.iter().filter(|it| it.prevents_op).count();
        let count = counted(differences.len(), "difference", "differences");
        Verdict::Failed(format!("{count} from the file, {preventing} of them prevent OP"))
    };
    Ok(Report { verdict, data })
}

/// Prints each difference in one or more lines.
fn print(differences: &[ringcat::eni::Difference]) {
    for difference in differences {
        let mark = if difference.prevents_op { '!' } else { ' ' };
        let first = format!("{mark} {:<width$}", difference.kind.word(), width = KIND - 2);
        for (number, line) in wrapped(&difference.text, WIDTH - KIND).iter().enumerate() {
            say!("{}{line}", if number == 0 { first.clone() } else { " ".repeat(KIND) });
        }
    }
}

/// What is to be read of a found SubDevice with this index in the file.
fn wanted(
    configuration: &Configuration,
    stated: &[StatedProperties],
    descriptions: Option<&mut Descriptions>,
    (info, config): (&SubDeviceInfo, Option<usize>),
) -> Wanted {
    let has_slots = descriptions.is_some_and(|it| it.has_modules(info));
    let is_declared = |config| configuration.has_unlisted_pdos(config, info) || configuration.declares_modules(config);
    Wanted {
        firmware: config.and_then(|config| stated.get(config)).is_some_and(|it| !it.firmware.is_empty()),
        modules: has_slots || config.is_some_and(is_declared),
    }
}

/// Warns of SubDevices whose modules are in the file, but that do not list their modules (0xF050), or whose list was
/// not read. Returns their positions.
fn report_unlisted(bus: &Bus, configuration: &Configuration, counterparts: &[Option<usize>]) -> Vec<u16> {
    let mut unlisted = Vec::new();
    for (at, (info, config)) in bus.scan.subdevices.iter().zip(counterparts).enumerate() {
        let is_declared = config.is_some_and(|config| configuration.declares_modules(config));
        if bus.lists[at].is_none() && is_declared {
            let SubDeviceInfo { position, name, .. } = info;
            let reason = match bus.unlisted[at] {
                true => "it does not list them (0xF050)",
                false => "their list (0xF050) was not read",
            };
            warn(format!("position {position} \"{name}\": its modules are not compared: {reason}"));
            unlisted.push(position.0);
        }
    }
    unlisted
}

/// Marks the declarations of SubDevices that have modules on the bus, or slots in their descriptions.
fn mark_modular(
    stated: &mut [StatedProperties],
    bus: &Bus,
    counterparts: &[Option<usize>],
    mut descriptions: Option<&mut Descriptions>,
) {
    for (at, (info, config)) in bus.scan.subdevices.iter().zip(counterparts).enumerate() {
        let has_modules = !bus.modules[at].is_empty() || descriptions.as_mut().is_some_and(|it| it.has_modules(info));
        if let Some(it) = config.and_then(|config| stated.get_mut(config)) {
            it.modular |= has_modules;
        }
    }
}

fn load(arguments: &CompareArguments) -> Result<Declared, Failure> {
    if let Some(path) = &arguments.network {
        let network = LoadedNetwork::load(path).map_err(|error| Failure::new(error.to_string()))?;
        let stated = network.stated();
        let names = network.file.subdevice.iter().map(|subdevice| {
            let mut names = ObjectNames::default();
            names.add_declared(subdevice);
            names
        });
        let names = names.collect();
        return Ok(Declared { configuration: network.configuration, stated, names });
    }
    let path = arguments.eni.as_deref().ok_or_else(|| Failure::new("expected --eni FILE or --network FILE"))?;
    let file = EniFile::load(path).map_err(|error| Failure::new(error.to_string()))?;
    let stated = file.stated();
    let names = file.eni.subdevices.iter().map(|subdevice| {
        let mut names = ObjectNames::default();
        names.add_eni(subdevice);
        names
    });
    let names = names.collect();
    Ok(Declared { configuration: file.configuration, stated, names })
}

/// A text in lines of at most this number of characters; longer words have lines of their own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let (length, own) = (lines.last().map_or(0, |line| line.chars().count()), word.chars().count());
        match lines.last_mut() {
            Some(line) if length == 0 => line.push_str(word),
            Some(line) if length + 1 + own <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
