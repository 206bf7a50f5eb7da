//! `ringcat sii`: EEPROM images from device descriptions (ESI), images compared with descriptions, descriptions from
//! images. No interface is needed.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use ringcat::config::esi::Esi;
use ringcat::config::esi::index::IndexedFile;
use ringcat::config::esi::sii::{Comparison, Likeness, SiiOptions, SiiProfile, Skeleton, build, most_alike, skeleton};
use ringcat::esi::EsiFolder;
use ringcat::regular_file::read_at_most;
use ringcat::wire::sii::{Sii, SiiHeader};

use crate::esi::device::{DeviceArguments, read};
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::sii::{ComparedImage, Difference, SiiBuilt, SiiCompared, SiiSkeleton};
use crate::numbers::{number_of_16_bits, number_of_32_bits};
use crate::out_file::Overwrite;
use crate::output::{counted, say, warn};
use crate::verdict::{Report, Verdict};

/// Options of `ringcat sii`.
#[derive(Args, Debug)]
pub struct SiiArguments {
    #[command(subcommand)]
    command: SiiCommand,
}

#[derive(Debug, Subcommand)]
enum SiiCommand {
    /// Writes the EEPROM image of a device of a description
    Build(BuildArguments),
    /// Compares EEPROM images with what descriptions give
    ///
    /// Tries the habits of each tool and each language, and lists the fields that differ with the fewest differences.
    Compare(CompareArguments),
    /// Writes a description made of an EEPROM image
    Skeleton(SkeletonArguments),
}

/// Habits of a tool.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Profile {
    /// TwinCAT, as in terminals of Beckhoff
    Twincat,
    /// siitool of the Open EtherCAT Society
    Siitool,
    /// The tool of rt-labs
    Rtlabs,
    /// All that the description says
    Plain,
}

#[derive(Args, Debug)]
struct BuildArguments {
    #[command(flatten)]
    device: DeviceArguments,
    /// Order of strings, padding and omissions of a tool
    #[arg(long, value_enum, default_value = "twincat", help_heading = "Image")]
    profile: Profile,
    /// Language of the strings
    #[arg(long, value_name = "LCID", default_value_t = crate::descriptions::ENGLISH, help_heading = "Image")]
    language: u32,
    /// Station alias
    #[arg(long, value_name = "ALIAS", value_parser = number_of_16_bits, help_heading = "Image")]
    alias: Option<u16>,
    /// Serial number
    #[arg(long, value_name = "SERIAL", value_parser = number_of_32_bits, help_heading = "Image")]
    serial: Option<u32>,
    /// Leave out PDOs, for an EEPROM that is too small
    #[arg(long, help_heading = "Image")]
    without_pdos: bool,
    /// File to write
    #[arg(long, value_name = "FILE.bin", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
}

#[derive(Args, Debug)]
struct CompareArguments {
    /// EEPROM images
    #[arg(required = true)]
    images: Vec<PathBuf>,
    /// A description, or a folder of descriptions
    #[arg(long, value_name = "PATH", required = true, help_heading = "Device")]
    esi: PathBuf,
}

#[derive(Args, Debug)]
struct SkeletonArguments {
    /// EEPROM image
    image: PathBuf,
    /// File to write
    #[arg(long, value_name = "FILE.xml", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl SiiArguments {
    /// As the command line has it.
    pub fn name(&self) -> &'static str {
        match self.command {
            SiiCommand::Build(_) => "sii build",
            SiiCommand::Compare(_) => "sii compare",
            SiiCommand::Skeleton(_) => "sii skeleton",
        }
    }
}

/// Runs one of the commands.
pub fn run(arguments: &SiiArguments) -> Result<Report, Failure> {
    match &arguments.command {
        SiiCommand::Build(arguments) => built(arguments),
        SiiCommand::Compare(arguments) => compared(arguments),
        SiiCommand::Skeleton(arguments) => described(arguments),
    }
}

fn built(arguments: &BuildArguments) -> Result<Report, Failure> {
    arguments.overwrite.check(&arguments.out)?;
    let failed = |text: String| Failure::new(text);
    let esi = read(&arguments.device.esi)?;
    let device = arguments.device.choose(&esi)?;
    let profile = match arguments.profile {
        Profile::Twincat => SiiProfile::TwinCat,
        Profile::Siitool => SiiProfile::Siitool,
        Profile::Rtlabs => SiiProfile::RtLabs,
        Profile::Plain => SiiProfile::Plain,
    };
    let mut options = SiiOptions::of(profile, arguments.language);
    options.alias = arguments.alias;
    options.serial = arguments.serial;
    options.without_pdos = arguments.without_pdos;
    let image = build(&esi, device, &options).map_err(|error| failed(error.to_string()))?;
    let out = &arguments.out;
    arguments.overwrite.write(out, &image.bytes)?;
    image.notices.iter().for_each(warn);
    let (kind, revision) = (device.kind.trim().to_owned(), device.revision);
    let bytes = image.bytes.len();
    let used_bytes = image.used;
    let held = format!("{kind} revision {revision:#010x}: {bytes} bytes, {used_bytes} used, in {}", out.display());
    let profile = profile.name().to_owned();
    let data = SiiBuilt { esi: esi.file, device: kind, revision, profile, bytes, used_bytes, notices: image.notices };
    Ok(Report { verdict: Verdict::Held(held), data: Data::SiiBuilt(data) })
}

/// Vendor and product code.
type Product = (u32, u32);

/// The descriptions of a file, or those of a folder that describe one of these products. A file of the folder that is
/// refused is left out with a warning.
fn descriptions(path: &Path, wanted: &[Product]) -> Result<Vec<Esi>, Failure> {
    if !path.is_dir() {
        return Ok(vec![read(path)?]);
    }
    let folder = EsiFolder::open(path, EsiFolder::default_index(path).as_deref());
    let folder = folder.map_err(|error| Failure::new(error.to_string()))?;
    folder.notices().iter().for_each(warn);
    let files = folder.index().files();
    let refused = files.iter().filter_map(|file| file.refused.as_deref());
    refused.for_each(|reason| warn(format!("left out: {reason}")));
    let describes = |file: &&IndexedFile| {
        file.devices.iter().any(|device| wanted.contains(&(device.vendor_id, device.product_code)))
    };
    files.iter().filter(describes).map(|file| read(&path.join(&file.path))).collect()
}

/// The product of an image; `None` if the image cannot be decoded.
fn product_of(image: &[u8]) -> Option<Product> {
    let identity = Sii::parse(image).ok()?.header().identity;
    Some((identity.vendor_id, identity.product_code))
}

/// The bytes of an image. The limit applies to the bytes that are read.
fn image_of(path: &Path) -> Result<Vec<u8>, Failure> {
    const LIMIT: usize = SiiHeader::MAX_EEPROM_BYTES;
    let read = read_at_most(path, LIMIT as u64 + 1);
    let bytes = read.map_err(|error| Failure::new(format!("{} cannot be read: {error}", path.display())))?;
    match bytes.len() > LIMIT {
        true => Err(Failure::new(format!("{} is longer than {LIMIT} bytes, the largest EEPROM", path.display()))),
        false => Ok(bytes),
    }
}

fn compared(arguments: &CompareArguments) -> Result<Report, Failure> {
    let read: Vec<Vec<u8>> = arguments.images.iter().map(|path| image_of(path)).collect::<Result<_, _>>()?;
    let products: Vec<Product> = read.iter().filter_map(|bytes| product_of(bytes)).collect();
    let all = descriptions(&arguments.esi, &products)?;
    let mut images = Vec::new();
    for (path, bytes) in arguments.images.iter().zip(&read) {
        let image = against(&all, path, bytes);
        lines(&image).iter().for_each(|line| say!("{line}"));
        images.push(image);
    }
    let is = |outcome: &str| images.iter().filter(|image| image.outcome == outcome).count();
    let (same, different) = (is("identical") + is("individual"), is("different"));
    let words = format!(
        "{} as described, {} with differences, {} not compared",
        counted(same, "image", "images"),
        different,
        images.len() - same - different
    );
    let invalid = images.iter().find(|image| image.outcome == "invalid");
    let verdict = match invalid {
        Some(image) => {
            let reason = image.reason.as_deref().unwrap_or_default();
            Verdict::Failed(format!("{words}; {} is invalid: {reason}", image.file))
        }
        None if different == 0 => Verdict::Held(words),
        None => Verdict::Failed(words),
    };
    Ok(Report { verdict, data: Data::SiiCompared(SiiCompared { images }) })
}

/// An image against the description of its identity: the same revision, else the nearest of the same variant.
fn against(all: &[Esi], path: &Path, bytes: &[u8]) -> ComparedImage {
    let file = path.display().to_string();
    let mut image = ComparedImage {
        file,
        outcome: "invalid".to_owned(),
        esi: None,
        device: None,
        revision: None,
        profile: None,
        language: None,
        differences: Vec::new(),
        reason: None,
    };
    let identity = match Sii::parse(bytes) {
        Ok(sii) => sii.header().identity,
        Err(error) => return ComparedImage { reason: Some(error.to_string()), ..image },
    };
    let devices = all.iter().flat_map(|esi| esi.devices.iter().map(move |device| (esi, device)));
    let same = devices.filter(|(_, it)| {
        (it.vendor_id, it.product_code) == (identity.vendor_id, identity.product_code)
            && it.revision as u16 == identity.revision as u16
    });
    let Some((esi, device)) = same.min_by_key(|(_, it)| it.revision.abs_diff(identity.revision)) else {
        let reason = format!(
            "no description of vendor {:#010x}, product {:#010x}, revision {:#010x}",
            identity.vendor_id, identity.product_code, identity.revision
        );
        return ComparedImage { outcome: "without-description".to_owned(), reason: Some(reason), ..image };
    };
    image.esi = Some(esi.file.clone());
    image.device = Some(device.kind.trim().to_owned());
    image.revision = Some(device.revision);
    match most_alike(esi, device, bytes) {
        Ok((options, Comparison { likeness, differences })) => {
            image.outcome = outcome(likeness).to_owned();
            image.profile = Some(options.profile.name().to_owned());
            image.language = Some(options.language);
            image.differences = differences
                .into_iter()
                .map(|it| Difference {
                    field: it.field,
                    image: it.expected,
                    built: it.got,
                    is_individual: it.is_individual,
                })
                .collect();
        }
        Err(error) => image.reason = Some(error.to_string()),
    }
    image
}

const fn outcome(likeness: Likeness) -> &'static str {
    match likeness {
        Likeness::Identical => "identical",
        Likeness::Individual => "individual",
        Likeness::Different => "different",
    }
}

/// An image and its differences.
fn lines(image: &ComparedImage) -> Vec<String> {
    let mut lines = Vec::new();
    let from = match (&image.esi, &image.device, image.revision, &image.profile, image.language) {
        (Some(esi), Some(device), Some(revision), Some(profile), Some(language)) => {
            format!(" {device} {revision:#010x} of {esi}, {profile}, language {language}")
        }
        _ => format!(" {}", image.reason.as_deref().unwrap_or_default()),
    };
    lines.push(format!("{}: {}:{from}", image.file, image.outcome));
    for it in &image.differences {
        let value = |text: &str| if text.is_empty() { "missing".to_owned() } else { text.to_owned() };
        let note = if it.is_individual { " (individual)" } else { "" };
        lines.push(format!("    {}: image {}, built {}{note}", it.field, value(&it.image), value(&it.built)));
    }
    lines
}

fn described(arguments: &SkeletonArguments) -> Result<Report, Failure> {
    arguments.overwrite.check(&arguments.out)?;
    let path = &arguments.image;
    let failed = |text: String| Failure::new(format!("{}: {text}", path.display()));
    let bytes = image_of(path)?;
    let Skeleton { text: xml, notices } = skeleton(&bytes).map_err(|error| failed(error.to_string()))?;
    let out = &arguments.out;
    arguments.overwrite.write(out, xml.as_bytes())?;
    let held = format!("a description of {} bytes in {}", xml.len(), out.display());
    notices.iter().for_each(warn);
    Ok(Report { verdict: Verdict::Held(held), data: Data::SiiSkeleton(SiiSkeleton { bytes: xml.len(), notices }) })
}
