//! Names of PDOs and entries from descriptions, for a network file from a scan.

use std::fmt;

use ringcat::network::NetworkFile;

use crate::bus::Bus;
use crate::descriptions::Descriptions;
use crate::failure::Failure;
use crate::output::{counted, warn};

/// What the descriptions contributed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Named {
    /// SubDevices that a description describes.
    pub described: usize,
    /// Modules in their slots that it describes.
    pub modules: usize,
    /// Names that were filled in.
    pub names: usize,
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&counted(self.described, "SubDevice", "SubDevices"))?;
        if self.modules > 0 {
            write!(f, " with {}", counted(self.modules, "module", "modules"))?;
        }
        write!(f, " described, {} from descriptions", counted(self.names, "name", "names"))
    }
}

/// Fills in names from the description of each SubDevice, and reports where both disagree.
pub fn fill(file: &mut NetworkFile, bus: &Bus, descriptions: &mut Descriptions) -> Result<Named, Failure> {
    let mut named = Named::default();
    for ((info, idents), subdevice) in bus.scan.subdevices.iter().zip(&bus.modules).zip(&mut file.subdevice) {
        let (position, of) = (info.position, &info.identity);
        let Some(described) = descriptions.of(info)? else {
            warn(format!(
                "position {position} \"{}\": no description of product {:#010x} revision {:#010x}",
                subdevice.name, of.product_code, of.revision
            ));
            continue;
        };
        named.described += 1;
        let modules = described.modules(info, idents);
        for difference in subdevice.differences_to_esi(described.device(), info, &modules) {
            let (name, path) = (&subdevice.name, &described.path);
            warn(format!("position {position} \"{name}\": {difference} ({path}): the device has priority"));
        }
        named.modules += modules.len();
        named.names += subdevice.name_from_esi(described.device(), &modules, descriptions.language);
    }
    Ok(named)
}
