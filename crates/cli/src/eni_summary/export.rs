//! `ringcat eni export`: an ENI of a network file, or of another ENI.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args, ValueEnum};
use ringcat::config::{self, Export, ExportDetails, ExportError, ExportOptions, LrwUse, SubDeviceFacts, export};
use ringcat::eni::EniFile;
use ringcat::network::LoadedNetwork;

use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::eni::{EniExport, LeftOut};
use crate::out_file::Overwrite;
use crate::output::{self, counted, say, warn};
use crate::verdict::{Report, Verdict};

/// The name of the standard output.
const STANDARD_OUTPUT: &str = "-";

/// SubDevices that a warning lists.
const LISTED: usize = 8;

/// Text at the end of the long help.
const ABOUT_EXPORT: &str = "\
The ENI has every command that a MainDevice sends to bring the network to OP.
It is read again before it is written: what an ENI cannot express is refused
with the SubDevice and the reason, or listed as a warning where the network
reaches OP without it. docs/eni.md has the list.

An ENI leaves no process data to the EEPROM. A warning names the SubDevices for
which the network file has no tables `sync_manager`: the ENI has no process data
of them, and one that has some does not reach SAFEOP with it.

  ringcat init --main eth1 --out machine.toml
  ringcat eni export --network machine.toml --out machine.eni.xml
  ringcat sim --main veth0 --eni machine.eni.xml";

/// Options of `ringcat eni export`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_EXPORT, group(ArgGroup::new("file").required(true).args(["eni", "network"])))]
pub struct ExportArguments {
    /// The network of a network file (see docs/network-file.md)
    #[arg(long, value_name = "FILE.toml", help_heading = "Network")]
    network: Option<PathBuf>,
    /// The network of another ENI, as RingCAT follows it
    #[arg(long, value_name = "FILE", help_heading = "Network")]
    eni: Option<PathBuf>,
    /// Use of LRW in the cyclic commands
    #[arg(long, value_enum, default_value = "as-declared", help_heading = "Network")]
    lrw: Lrw,
    /// File to write; without it, or with -, the standard output
    #[arg(long, value_name = "FILE.xml", default_value = STANDARD_OUTPUT, help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Use of LRW.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Lrw {
    /// Where the network file or the ENI has it
    AsDeclared,
    /// For all process data: not for a ring
    Always,
    /// For none: LRD and LWR, as a ring needs
    Never,
}

impl From<Lrw> for LrwUse {
    fn from(lrw: Lrw) -> LrwUse {
        match lrw {
            Lrw::AsDeclared => LrwUse::AsDeclared,
            Lrw::Always => LrwUse::Always,
            Lrw::Never => LrwUse::Never,
        }
    }
}

/// A line per setting and reason, in the order of their first SubDevices: hundreds of equal lines would hide the
/// others.
fn in_groups(left_out: &[config::LeftOut], subdevices: &[SubDeviceFacts]) -> Vec<String> {
    let named = |index: usize| match subdevices.get(index) {
        Some(facts) => format!("{index} \"{}\"", facts.name.escape_debug()),
        None => index.to_string(),
    };
    let mut groups: Vec<(&config::LeftOut, Vec<String>)> = Vec::new();
    let mut known: HashMap<(&str, &str), usize> = HashMap::new();
    for it in left_out {
        let group = *known.entry((&it.what, &it.reason)).or_insert_with(|| {
            groups.push((it, Vec::new()));
            groups.len() - 1
        });
        groups[group].1.extend(it.subdevice.map(named));
    }
    let line = |(first, subdevices): (&config::LeftOut, Vec<String>)| {
        if let [one] = &subdevices[..] {
            return format!("SubDevice {one}: {}: {}", first.what, first.reason);
        }
        if subdevices.is_empty() {
            return first.to_string();
        }
        let more = if subdevices.len() > LISTED { ", ..." } else { "" };
        let listed = subdevices.iter().take(LISTED).map(String::as_str).collect::<Vec<&str>>().join(", ");
        format!("{} SubDevices ({listed}{more}): {}: {}", subdevices.len(), first.what, first.reason)
    };
    groups.into_iter().map(line).collect()
}

/// Writes the file.
pub fn run(arguments: &ExportArguments) -> Result<Report, Failure> {
    let out = &arguments.out;
    let is_standard = out == Path::new(STANDARD_OUTPUT);
    if is_standard && output::is_json() {
        return Err(Failure::new("with --json the standard output is for JSON: name a file with --out"));
    }
    if !is_standard {
        arguments.overwrite.check(out)?;
    }
    let export = made(arguments)?;
    let subdevices = &export.configuration.subdevices;
    in_groups(&export.left_out, subdevices).iter().for_each(|line| warn(format!("not in the ENI: {line}")));
    if is_standard {
        output::write_file(&export.text);
    } else {
        arguments.overwrite.write(out, export.text.as_bytes())?;
    }
    let declaration = &export.configuration.declaration;
    let (subdevices, variables) = (declaration.subdevices.len(), export.configuration.image.variables.len());
    let left_out = export.left_out.len();
    if left_out > 0 {
        say!("{} not in the ENI", counted(left_out, "setting", "settings"));
    }
    let held = format!(
        "{} with {} in {}",
        counted(subdevices, "SubDevice", "SubDevices"),
        counted(variables, "variable", "variables"),
        if is_standard { "the standard output".to_owned() } else { out.display().to_string() }
    );
    let data = Data::EniExport(EniExport {
        subdevices,
        variables,
        lrw: !declaration.explicit_lrw.is_empty(),
        bytes: export.text.len(),
        left_out: export
            .left_out
            .iter()
            .map(|it| LeftOut { subdevice: it.subdevice, what: it.what.clone(), reason: it.reason.clone() })
            .collect(),
    });
    Ok(Report { verdict: Verdict::Held(held), data })
}

fn made(arguments: &ExportArguments) -> Result<Export, Failure> {
    let options = ExportOptions::default().with_lrw(arguments.lrw.into());
    let failed = |path: &Path, error: ExportError| Failure::new(format!("{}: {error}", path.display()));
    if let Some(path) = &arguments.network {
        let network = LoadedNetwork::load(path).map_err(|error| Failure::new(error.to_string()))?;
        return network.to_eni(&options).map_err(|error| Failure::new(error.to_string()));
    }
    let path = arguments.eni.as_deref().ok_or_else(|| Failure::new("expected --network FILE or --eni FILE"))?;
    let file = EniFile::load(path).map_err(|error| Failure::new(error.to_string()))?;
    export(&file.configuration, &ExportDetails::of(&file.eni), &options).map_err(|error| failed(path, error))
}
