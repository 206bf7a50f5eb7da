//! `ringcat esi declare`: a SubDevice of a network file from a description and choices.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use ringcat::config::esi::{Notice, select};
use ringcat::config::network::model::{PluggedInto, SubDevice};
use ringcat::network::{LoadedNetwork, NetworkFile};

use super::choices::ChoiceArguments;
use super::device::{DeviceArguments, read};
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::esi::EsiDeclared;
use crate::output::{counted, say, warn};
use crate::verdict::{Report, Verdict};

/// Text at the end of the long help.
const ABOUT_DECLARE: &str = "\
All choices are checked against the rules of the description: mandatory, fixed
and exclusive PDOs, SyncManagers, modules of slots, limits of objects. What does
not fit is refused with file, line and device. `ringcat esi show` lists what can
be chosen.

  ringcat esi declare el.xml --type EL3102 --with 0x1A01 --without 0x1A00 \\
      --set 0x8000:6=01 --out machine.toml
  ringcat esi declare drive.xml --mode DC --map 0x1600=0x6040:0,0x60FF:0 \\
      --out machine.toml --append";

/// Options of `ringcat esi declare`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_DECLARE)]
pub struct DeclareArguments {
    #[command(flatten)]
    device: DeviceArguments,
    #[command(flatten)]
    choices: ChoiceArguments,
    /// Name of the SubDevice; by default its type
    #[arg(long, value_name = "NAME", help_heading = "Network")]
    name: Option<String>,
    /// The SubDevice and the port that its port 0 is plugged into: Coupler:1
    #[arg(long, value_name = "NAME:PORT", value_parser = plugged_into, help_heading = "Network")]
    plugged_into: Option<PluggedInto>,
    /// File to write
    #[arg(long, value_name = "FILE.toml", help_heading = "Output")]
    out: PathBuf,
    /// Put the SubDevice behind those of the file
    #[arg(long, help_heading = "Output", conflicts_with = "overwrite")]
    append: bool,
    /// Replace the file if it exists
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
}

fn plugged_into(text: &str) -> Result<PluggedInto, String> {
    let wrong = || format!("expected the name of a SubDevice and a port from 0 to 3, as in Coupler:1, got {text}");
    let (name, port) = text.rsplit_once(':').ok_or_else(wrong)?;
    let port = port.parse().ok().filter(|port| *port < 4).ok_or_else(wrong)?;
    let mut into = PluggedInto::default();
    (into.subdevice, into.port) = (name.to_owned(), port);
    Ok(into)
}

/// Writes the file.
pub fn run(arguments: &DeclareArguments) -> Result<Report, Failure> {
    let out = &arguments.out;
    let mut file = match fs::symlink_metadata(out).is_ok() {
        true if arguments.append => LoadedNetwork::load(out).map_err(|error| Failure::new(error.to_string()))?.file,
        true if !arguments.overwrite => {
            let advice = "name another file, or add --append or --overwrite";
            return Err(Failure::new(format!("{} exists: {advice}", out.display())));
        }
        _ => NetworkFile::empty("machine", arguments.choices.cycle),
    };
    let esi = read(&arguments.device.esi)?;
    let device = arguments.device.choose(&esi)?;
    let choices = arguments.choices.choices();
    let cycle = file.domain.first().map_or(arguments.choices.cycle, |domain| domain.period.0);
    let failed = |error: ringcat::config::esi::EsiError| Failure::new(error.to_string());
    let selection = select(&esi, device, &choices).map_err(failed)?;
    let mut from = SubDevice::from_esi(&selection, cycle, choices.language).map_err(failed)?;
    report(&esi.file, &from.notices);
    from.subdevice.plugged_into.clone_from(&arguments.plugged_into);
    if let Some(name) = &arguments.name {
        from.subdevice.name.clone_from(name);
    }
    file.push(from.subdevice);
    let bytes = write(out, &file)?;
    let subdevice = file.subdevice.last().cloned().unwrap_or_default();
    let pdos: usize = subdevice.sync_manager.iter().map(|sm| sm.pdo.len()).sum();
    let (image, own) = (file.configuration().image, Some(file.subdevice.len() - 1));
    let variables = image.variables.iter().filter(|it| it.subdevice == own).count();
    let held = format!(
        "\"{}\", {} with {} and {} in {}",
        subdevice.name,
        counted(pdos, "PDO", "PDOs"),
        counted(variables, "variable", "variables"),
        counted(subdevice.startup.len(), "start-up command", "start-up commands"),
        out.display()
    );
    let data = EsiDeclared {
        esi: esi.file.clone(),
        device: device.kind.trim().to_owned(),
        revision: device.revision,
        name: subdevice.name.clone(),
        mode: selection.mode.map(|mode| mode.name.trim().to_owned()),
        pdos,
        variables,
        startup_commands: subdevice.startup.len(),
        bytes,
        digest: file.digest().to_string(),
        notices: from.notices.iter().map(|notice| format!("{}: {notice}", esi.file)).collect(),
    };
    Ok(Report { verdict: Verdict::Held(held), data: Data::EsiDeclared(data) })
}

fn report(file: &str, notices: &[Notice]) {
    notices.iter().for_each(|notice| warn(format!("{file}: {notice}")));
}

/// Writes a network file that is valid. Returns its bytes.
fn write(out: &Path, file: &NetworkFile) -> Result<usize, Failure> {
    let text = file.to_text();
    NetworkFile::read(&out.display().to_string(), text.as_bytes()).map_err(|error| Failure::new(error.to_string()))?;
    let opened = OpenOptions::new().write(true).truncate(true).create(true).open(out);
    let written = opened.and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|error| Failure::new(format!("{} cannot be written: {error}", out.display())))?;
    say!("digest {}", file.digest());
    Ok(text.len())
}
