//! `ringcat esi`: device descriptions (ESI): what a folder describes, one device, a SubDevice of a network file from a
//! description and choices. No interface is needed.

mod choices;
mod declare;
pub mod device;
mod show;

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, Subcommand};
use ringcat::config::esi::index::{IndexedDevice, IndexedFile};
use ringcat::config::esi::{Choice, choose};
use ringcat::esi::EsiFolder;

use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::esi::{Device, EsiList, Refused};
use crate::numbers::number_of_32_bits;
use crate::output::{counted, say, warn};
use crate::verdict::{Report, Verdict};

/// Options of `ringcat esi`.
#[derive(Args, Debug)]
pub struct EsiArguments {
    #[command(subcommand)]
    command: EsiCommand,
}

#[derive(Debug, Subcommand)]
enum EsiCommand {
    /// Lists the devices that a folder of descriptions describes
    ///
    /// With --vendor, --product and --revision: the description that counts for this device on the bus, which is that
    /// of its revision or the next older one of the same variant.
    List(ListArguments),
    /// Shows a device of a description, and what can be chosen for it
    Show(show::ShowArguments),
    /// Writes a network file with a device of a description and choices
    ///
    /// The choices are checked against the rules of the description.
    Declare(Box<declare::DeclareArguments>),
}

#[derive(Args, Debug)]
struct ListArguments {
    /// Folder of descriptions
    folder: PathBuf,
    /// Types and names with this text
    #[arg(long, value_name = "TEXT", help_heading = "Devices")]
    find: Option<String>,
    /// Vendor id
    #[arg(long, value_name = "VENDOR", value_parser = number_of_32_bits, help_heading = "Devices")]
    vendor: Option<u32>,
    /// Product code
    #[arg(long, value_name = "PRODUCT", value_parser = number_of_32_bits, help_heading = "Devices")]
    product: Option<u32>,
    /// Revision of a device on the bus
    #[arg(
        long,
        value_name = "REVISION",
        value_parser = number_of_32_bits,
        requires = "vendor",
        requires = "product",
        help_heading = "Devices"
    )]
    revision: Option<u32>,
    /// With --revision: where all descriptions are newer than the device, the oldest
    #[arg(long, requires = "revision", help_heading = "Devices")]
    newer: bool,
    /// Also descriptions that others hide
    #[arg(long, help_heading = "Devices")]
    all: bool,
    /// Read all files, and keep no index for the next time
    #[arg(long, help_heading = "Index")]
    no_index: bool,
}

impl EsiArguments {
    /// As the command line has it.
    pub const fn name(&self) -> &'static str {
        match self.command {
            EsiCommand::List(_) => "esi list",
            EsiCommand::Show(_) => "esi show",
            EsiCommand::Declare(_) => "esi declare",
        }
    }
}

/// Runs one of the commands.
pub fn run(arguments: &EsiArguments) -> Result<Report, Failure> {
    match &arguments.command {
        EsiCommand::List(arguments) => list(arguments),
        EsiCommand::Show(arguments) => show::run(arguments),
        EsiCommand::Declare(arguments) => declare::run(arguments),
    }
}

fn list(arguments: &ListArguments) -> Result<Report, Failure> {
    let begin = Instant::now();
    let kept = EsiFolder::default_index(&arguments.folder).filter(|_| !arguments.no_index);
    let folder = EsiFolder::open(&arguments.folder, kept.as_deref());
    let folder = folder.map_err(|error| Failure::new(error.to_string()))?;
    let took_us = u64::try_from(begin.elapsed().as_micros()).unwrap_or(u64::MAX);
    if let (Some(error), Some(kept)) = (folder.not_kept(), &kept) {
        warn(format!("the index cannot be kept in {}: {error}", kept.display()));
    }
    folder.notices().iter().for_each(warn);
    let devices = chosen(&folder, arguments);
    table(&devices).iter().for_each(|line| say!("{line}"));
    let index = folder.index();
    let refused = index
        .files()
        .iter()
        .filter_map(|file| Some(Refused { file: file.path.clone(), reason: file.refused.clone()? }));
    let refused: Vec<Refused> = refused.collect();
    refused.iter().for_each(|it| warn(format!("left out: {}", it.reason)));
    let duplicates = index.duplicates().count();
    let is_whole = arguments.find.is_none() && arguments.vendor.is_none() && arguments.product.is_none();
    if duplicates > 0 && is_whole {
        say!("{duplicates} identities are in several files; the newest file counts");
    }
    let (files, read) = (index.files().len(), folder.files_read());
    say!("{}, {read} read, {:.1} ms", counted(files, "file", "files"), took_us as f64 / 1e3);
    let words = counted(devices.len(), "device", "devices");
    let verdict = match devices.is_empty() {
        true => Verdict::Failed(format!("no description fits{}", nearest(&folder, arguments))),
        false => Verdict::Held(words),
    };
    let data = EsiList { devices, files, files_read: read, duplicates, refused, open_us: took_us };
    Ok(Report { verdict, data: Data::EsiList(data) })
}

/// The nearest description, where only newer ones of the variant are there (protocol ES-29).
fn nearest(folder: &EsiFolder, arguments: &ListArguments) -> String {
    let (Some(vendor), Some(product), Some(revision)) = (arguments.vendor, arguments.product, arguments.revision)
    else {
        return String::new();
    };
    let of_product = |it: &&IndexedDevice| (it.vendor_id, it.product_code) == (vendor, product);
    let described = folder.index().devices().map(|(_, it)| it).filter(of_product).map(|it| it.revision);
    match choose(described, revision, false) {
        Choice::None(Some(nearest)) => format!("; that of revision {nearest:#010x} is newer: --newer takes it"),
        _ => String::new(),
    }
}

/// The devices of the command line: one for a revision, otherwise all that fit, by type.
fn chosen(folder: &EsiFolder, arguments: &ListArguments) -> Vec<Device> {
    let index = folder.index();
    let row = |file: &IndexedFile, it: &IndexedDevice, choice: Option<&str>| Device {
        kind: it.kind.clone(),
        name: it.name.clone(),
        vendor_id: it.vendor_id,
        product_code: it.product_code,
        revision: it.revision,
        file: file.path.clone(),
        line: it.line,
        is_hidden: index.is_hidden(it),
        choice: choice.map(str::to_owned),
    };
    if let (Some(vendor), Some(product), Some(revision)) = (arguments.vendor, arguments.product, arguments.revision) {
        let found = index.find(vendor, product, revision, arguments.newer);
        return found.map(|it| row(it.file, it.device, Some(word(it.choice)))).into_iter().collect();
    }
    let text = arguments.find.as_deref().map(str::to_lowercase);
    let fits = |it: &IndexedDevice| {
        arguments.vendor.is_none_or(|vendor| vendor == it.vendor_id)
            && arguments.product.is_none_or(|product| product == it.product_code)
            && (arguments.all || !index.is_hidden(it))
            && text
                .as_ref()
                .is_none_or(|text| it.kind.to_lowercase().contains(text) || it.name.to_lowercase().contains(text))
    };
    let mut rows: Vec<Device> =
        index.devices().filter(|(_, it)| fits(it)).map(|(file, it)| row(file, it, None)).collect();
    rows.sort_by(|a, b| (&a.kind, a.vendor_id, a.revision).cmp(&(&b.kind, b.vendor_id, b.revision)));
    rows
}

const fn word(choice: Choice) -> &'static str {
    match choice {
        Choice::Exact(_) => "exact",
        Choice::Older(_) => "older",
        Choice::Newer(_) => "newer",
        Choice::None(_) => "none",
    }
}

/// A line each, within 80 columns for usual types and files.
fn table(devices: &[Device]) -> Vec<String> {
    let width = devices.iter().map(|it| it.kind.chars().count()).max().unwrap_or(0).clamp(4, 24);
    let heading = format!("{:width$}  vendor      product     revision    file", "type");
    let rows = devices.iter().map(|it| {
        let note = it.choice.as_deref().map(|choice| format!(" ({choice})")).unwrap_or_default();
        format!(
            "{:width$}  {:#010x}  {:#010x}  {:#010x}  {}:{}{note}",
            it.kind, it.vendor_id, it.product_code, it.revision, it.file, it.line
        )
    });
    let heading = Some(heading).filter(|_| !devices.is_empty());
    heading.into_iter().chain(rows).collect()
}
