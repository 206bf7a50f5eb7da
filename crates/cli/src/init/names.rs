//! Names of PDOs and entries from a folder of descriptions, for a network file from a scan.

use std::collections::BTreeMap;
use std::path::Path;

use ringcat::SubDeviceInfo;
use ringcat::config::esi::index::Described;
use ringcat::esi::EsiFolder;
use ringcat::network::NetworkFile;

use crate::failure::Failure;
use crate::output::warn;

/// Language of the names: English.
const LANGUAGE: u32 = 1033;

/// What came from the descriptions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Named {
    /// SubDevices that a description describes.
    pub described: usize,
    /// Names that were filled in.
    pub names: usize,
}

/// Fills in names from the description that counts for each SubDevice, and reports where both disagree. Each file is
/// read once.
pub fn fill(file: &mut NetworkFile, found: &[SubDeviceInfo], folder: &Path) -> Result<Named, Failure> {
    let kept = EsiFolder::default_index(folder);
    let folder = EsiFolder::open(folder, kept.as_deref()).map_err(|error| Failure::new(error.to_string()))?;
    let mut by_file: BTreeMap<&str, Vec<(usize, Described<'_>)>> = BTreeMap::new();
    for (at, info) in found.iter().enumerate() {
        let of = &info.identity;
        match folder.index().find(of.vendor_id, of.product_code, of.revision, true) {
            Some(described) => by_file.entry(&described.file.path).or_default().push((at, described)),
            None => warn(format!(
                "position {} \"{}\": no description of product {:#010x} revision {:#010x}",
                info.position, file.subdevice[at].name, of.product_code, of.revision
            )),
        }
    }
    let mut named = Named::default();
    for subdevices in by_file.into_values() {
        let Some((_, first)) = subdevices.first() else { continue };
        let esi = folder.load(first).map_err(|error| Failure::new(error.to_string()))?;
        for (at, described) in &subdevices {
            let wanted = (described.device.product_code, described.device.revision);
            let device = esi.devices.iter().find(|it| (it.product_code, it.revision) == wanted);
            if let Some(device) = device {
                named.described += 1;
                let subdevice = &file.subdevice[*at];
                for difference in subdevice.differences_to_esi(device) {
                    let (position, name, path) = (found[*at].position, &subdevice.name, &described.file.path);
                    warn(format!("position {position} \"{name}\": {difference} ({path}): the device counts"));
                }
                named.names += file.subdevice[*at].name_from_esi(device, LANGUAGE);
            }
        }
    }
    Ok(named)
}
