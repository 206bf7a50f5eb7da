//! Segment files with devices of description files (keys `esi`, `type`, `revision`, `modules`).

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use ringcat_config::esi::{Device, Esi};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::segment::{DescribedDevice, DescribedDevices, DescriptionFault, Segment, SegmentError};

use super::device::describe;
use super::file::load;

/// Maximum number of types that a message lists.
const NAMED: usize = 20;

/// Reads description files for segment files, each once.
#[derive(Debug, Default)]
pub struct EsiDevices {
    files: RefCell<HashMap<PathBuf, Rc<Esi>>>,
}

/// Reads a segment file; its devices may come from description files.
///
/// # Errors
/// [`SegmentError`] with file, line and device.
pub fn load_segment(path: &Path) -> Result<Segment, SegmentError> {
    Segment::load_with(path, &EsiDevices::default())
}

impl EsiDevices {
    fn file(&self, path: &Path) -> Result<Rc<Esi>, String> {
        if let Some(known) = self.files.borrow().get(path) {
            return Ok(Rc::clone(known));
        }
        let esi = Rc::new(load(path).map_err(|error| error.to_string())?);
        self.files.borrow_mut().insert(path.to_owned(), Rc::clone(&esi));
        Ok(esi)
    }
}

impl DescribedDevices for EsiDevices {
    fn device(&self, wanted: &DescribedDevice, name: &str) -> Result<DeviceDescription, DescriptionFault> {
        let fault = |key, message| DescriptionFault::new(key, message);
        let esi = self.file(&wanted.path).map_err(|message| fault("esi", message))?;
        let device = chosen(&esi, wanted)?;
        // An empty text or a dash is an empty slot.
        let modules: Vec<Option<String>> = wanted.modules.iter().cloned().map(Some).collect();
        let key = if modules.is_empty() { "esi" } else { "modules" };
        describe(&esi, device, &modules, name).map_err(|error| fault(key, error))
    }
}

/// The device of a type, with the wanted revision or the highest one.
fn chosen<'a>(esi: &'a Esi, wanted: &DescribedDevice) -> Result<&'a Device, DescriptionFault> {
    let fault = |key, message| Err(DescriptionFault::new(key, message));
    let devices = || esi.devices.iter().filter(|device| !device.is_invisible);
    let mut kinds: Vec<&str> = devices().map(|device| device.kind.trim()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let known = || {
        let more = if kinds.len() > NAMED { format!(" and {} more", kinds.len() - NAMED) } else { String::new() };
        format!("{}{more}", kinds.iter().take(NAMED).copied().collect::<Vec<_>>().join(", "))
    };
    let kind = match (&wanted.kind, &kinds[..]) {
        (Some(kind), _) => kind.trim(),
        (None, [only]) => only,
        (None, _) => return fault("esi", format!("expected a key type, one of {}", known())),
    };
    let of_kind = || devices().filter(|device| device.kind.trim() == kind);
    if of_kind().next().is_none() {
        let message = format!("expected one of {}, got \"{}\"", known(), kind.escape_debug());
        return fault("type", message);
    }
    let of_product = || of_kind().filter(|device| wanted.product.is_none_or(|product| device.product_code == product));
    let revision = wanted.revision.or(of_product().map(|device| device.revision).max()).unwrap_or_default();
    let found: Vec<&Device> = of_product().filter(|device| device.revision == revision).collect();
    let list = |value: fn(&Device) -> u32, of: &mut dyn Iterator<Item = &Device>| {
        of.map(|device| format!("{:#010x}", value(device))).collect::<Vec<_>>().join(", ")
    };
    match (&found[..], wanted.product) {
        ([only], _) => Ok(only),
        ([], None) => {
            let revisions = list(|device| device.revision, &mut of_kind());
            Err(DescriptionFault::new("revision", format!("expected one of {revisions}, got {revision:#010x}")))
        }
        ([], Some(product)) => {
            let products = list(|device| device.product_code, &mut of_kind());
            Err(DescriptionFault::new("product", format!("expected one of {products}, got {product:#010x}")))
        }
        (several, _) => {
            let products = list(|device| device.product_code, &mut several.iter().copied());
            Err(DescriptionFault::new("product", format!("expected a key product, one of {products}")))
        }
    }
}
