//! A device of a description, by type and revision, for commands about one device.

use std::path::{Path, PathBuf};

use clap::Args;
use ringcat::config::esi::{Device, Esi};
use ringcat::esi::load;

use crate::failure::Failure;
use crate::numbers::number_of_32_bits;
use crate::output::warn;

/// Types that a message names.
const NAMED: usize = 30;

/// Which device of which description.
#[derive(Args, Clone, Debug)]
pub struct DeviceArguments {
    /// The description (ESI)
    pub esi: PathBuf,
    /// Type of the device in it
    #[arg(long = "type", value_name = "TYPE", help_heading = "Device")]
    pub kind: Option<String>,
    /// Revision of the device; by default the highest
    #[arg(long, value_name = "REVISION", value_parser = number_of_32_bits, help_heading = "Device")]
    pub revision: Option<u32>,
    /// Product code, where several devices have one type and revision
    #[arg(long, value_name = "PRODUCT", value_parser = number_of_32_bits, help_heading = "Device")]
    pub product: Option<u32>,
}

/// A description; what is not used of it is reported.
pub fn read(path: &Path) -> Result<Esi, Failure> {
    let esi = load(path).map_err(|error| Failure::new(error.to_string()))?;
    esi.notices.iter().for_each(|notice| warn(format!("{}: {notice}", esi.file)));
    Ok(esi)
}

impl DeviceArguments {
    /// The options that were given.
    fn wanted(&self) -> String {
        let kind = self.kind.as_ref().map(|kind| format!(" type \"{}\"", kind.trim().escape_debug()));
        let revision = self.revision.map(|revision| format!(" revision {revision:#010x}"));
        let product = self.product.map(|product| format!(" product {product:#010x}"));
        [kind, revision, product].into_iter().flatten().collect()
    }

    /// The device in its description.
    pub fn choose<'a>(&self, esi: &'a Esi) -> Result<&'a Device, Failure> {
        let wanted = |device: &&Device| {
            self.kind.as_ref().is_none_or(|kind| device.kind.trim() == kind.trim())
                && self.revision.is_none_or(|revision| device.revision == revision)
                && self.product.is_none_or(|product| device.product_code == product)
        };
        let mut found: Vec<&Device> = esi.devices.iter().filter(wanted).collect();
        let is_one_type = found.iter().all(|device| device.kind.trim() == found[0].kind.trim());
        let newest = found.iter().map(|device| device.revision).max();
        found.retain(|device| !is_one_type || Some(device.revision) == newest);
        match found[..] {
            [device] => Ok(device),
            _ => {
                let kind = |it: &&Device| {
                    format!("{} {:#010x} product {:#010x}", it.kind.trim(), it.revision, it.product_code)
                };
                let kinds: Vec<String> = esi.devices.iter().map(|it| kind(&it)).collect();
                let what = match (found.is_empty(), is_one_type) {
                    (true, _) => format!("there is no such device:{}", self.wanted()),
                    (false, true) => "give --product".to_owned(),
                    (false, false) => "give --type".to_owned(),
                };
                let more =
                    if kinds.len() > NAMED { format!(" and {} more", kinds.len() - NAMED) } else { String::new() };
                let named = kinds[..kinds.len().min(NAMED)].join(", ");
                Err(Failure::new(format!("{}: {what}\nIt has {named}{more}", esi.file)))
            }
        }
    }
}
