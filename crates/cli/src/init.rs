//! `ringcat init`: a network file from a scan.

mod names;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use ringcat::SubDeviceInfo;
use ringcat::config::network::model::{CheckRevision, Sync as SyncTable};
use ringcat::network::{NetworkFile, ScanOptions};

use crate::bus::{Bus, BusArguments, Wanted};
use crate::clock_options::sync::{Sync, choose, sync};
use crate::clock_options::{SYNC_HELP, SYNC_LONG_HELP};
use crate::descriptions::{Descriptions, EsiArgument, objects};
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::network::Init;
use crate::out_file::Overwrite;
use crate::output::{counted, say, warn};
use crate::times::{cycle, in_words};
use crate::verdict::{Report, Verdict};

/// Text at the end of the long help.
const ABOUT_INIT: &str = "\
The file has the SubDevices in their order with vendor, product, PDOs, names of
variables, mailboxes and cables, as found. `ringcat run --network FILE` brings
exactly this network to OP; `ringcat compare --network FILE` names what differs
later. docs/network-file.md explains every key. All SubDevices are in INIT
afterwards.";

/// Options of `ringcat init`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_INIT)]
pub struct InitArguments {
    #[command(flatten)]
    bus: BusArguments,
    /// Name of the network
    #[arg(long, value_name = "NAME", default_value = "machine", help_heading = "Network")]
    name: String,
    /// Cycle time, with its unit: 250us, 1ms; 10us to 1s
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = cycle, help_heading = "Network")]
    cycle: Duration,
    /// Use the distributed clocks
    #[arg(long, help_heading = "Network")]
    clocks: bool,
    #[arg(
        long,
        value_name = "SIGNALS",
        value_parser = sync,
        help = SYNC_HELP,
        long_help = SYNC_LONG_HELP,
        help_heading = "Network"
    )]
    sync: Vec<Sync>,
    /// Find SubDevices with an alias of their own by it, not by position
    #[arg(long, help_heading = "Network")]
    by_alias: bool,
    /// How revisions are compared
    #[arg(long, value_enum, default_value = "none", help_heading = "Network")]
    revisions: Revisions,
    /// Accept only SubDevices with the serial numbers found
    #[arg(long, help_heading = "Network")]
    serials: bool,
    /// Read the versions of the firmware too, for `ringcat compare`
    #[arg(long, help_heading = "Network")]
    firmware: bool,
    #[command(flatten)]
    esi: EsiArgument,
    /// File to write
    #[arg(long, value_name = "FILE.toml", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Comparison of revisions.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Revisions {
    /// Any revision is accepted
    None,
    /// Equal
    Equal,
    /// Equal or greater
    EqualOrGreater,
}

impl From<Revisions> for CheckRevision {
    fn from(revisions: Revisions) -> CheckRevision {
        match revisions {
            Revisions::None => CheckRevision::None,
            Revisions::Equal => CheckRevision::Equal,
            Revisions::EqualOrGreater => CheckRevision::EqualOrGreater,
        }
    }
}

/// Scans and writes the file.
pub fn run(arguments: &InitArguments) -> Result<Report, Failure> {
    let out = &arguments.out;
    arguments.overwrite.check(out)?;
    let mut descriptions = arguments.esi.open()?;
    let begin = Instant::now();
    let mut wanted = |info: &SubDeviceInfo| Wanted {
        firmware: arguments.firmware,
        modules: descriptions.as_mut().is_some_and(|it| it.has_modules(info)),
    };
    let mut bus = arguments.bus.scan(None, |found| found.iter().map(&mut wanted).collect())?;
    let scanned = Instant::now();
    let objects = objects(descriptions.as_mut(), &mut bus.scan.subdevices, &bus.modules)?;
    bus.warnings.print(&objects);
    let mut options = ScanOptions::new(&arguments.name, arguments.cycle);
    options.ring = bus.ring;
    options.clocks = arguments.clocks || !arguments.sync.is_empty();
    options.by_alias = arguments.by_alias;
    options.check_revision = arguments.revisions.into();
    options.check_serial = arguments.serials;
    let mut file = NetworkFile::from_scan(&bus.scan.subdevices, &bus.scan.topology, &options);
    if arguments.clocks && file.clocks.is_none() {
        warn("no SubDevice has a distributed clock: the file has no table [clocks]");
    }
    let named = complete(arguments, &bus, &mut file, descriptions.as_mut())?;
    let text = file.to_text();
    // What is written must be what `run` reads.
    NetworkFile::read(&out.display().to_string(), text.as_bytes()).map_err(|error| Failure::new(error.to_string()))?;
    arguments.overwrite.write(out, text.as_bytes())?;
    let us = |time: Duration| u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
    let (scan_us, file_us) = (us(scanned - begin), us(scanned.elapsed()));
    let digest = file.digest().to_string();
    let variables = file.configuration().image.variables.len();
    let subdevices = file.subdevice.len();
    say!("scan {:.1} ms, file {:.1} ms", scan_us as f64 / 1e3, file_us as f64 / 1e3);
    if let Some(named) = named {
        say!("{named}");
    }
    say!("digest {digest}");
    let held = format!(
        "{} with {} at {} in {}",
        counted(subdevices, "SubDevice", "SubDevices"),
        counted(variables, "variable", "variables"),
        in_words(arguments.cycle),
        out.display()
    );
    let data = Data::Init(Init {
        subdevices,
        variables,
        described: named.map(|named| named.described),
        modules: named.map(|named| named.modules),
        named: named.map_or(0, |named| named.names),
        bytes: text.len(),
        scan_us,
        file_us,
        digest,
    });
    Ok(Report { verdict: Verdict::Held(held), data })
}

/// What a scan does not give: chosen signals, versions of the firmware, names from descriptions.
fn complete(
    arguments: &InitArguments,
    bus: &Bus,
    file: &mut NetworkFile,
    descriptions: Option<&mut Descriptions>,
) -> Result<Option<names::Named>, Failure> {
    let found = &bus.scan.subdevices;
    let signals = choose(&arguments.sync, found, arguments.cycle).map_err(Failure::new)?;
    for (subdevice, signals) in file.subdevice.iter_mut().zip(signals) {
        subdevice.sync = signals.map(SyncTable::from);
    }
    for (subdevice, firmware) in file.subdevice.iter_mut().zip(&bus.firmware) {
        subdevice.firmware = firmware.clone().unwrap_or_default();
    }
    for (subdevice, info) in file.subdevice.iter().zip(found) {
        if subdevice.sync_manager.is_empty() && !info.sync_managers.is_empty() && !info.pdos.is_empty() {
            let (position, name) = (info.position, &subdevice.name);
            warn(format!("position {position} \"{name}\": its EEPROM contradicts itself: without process data"));
        }
    }
    descriptions.map(|descriptions| names::fill(file, bus, descriptions)).transpose()
}
