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
    match wanted.revision {
        None => of_kind().max_by_key(|device| device.revision),
        Some(revision) => of_kind().find(|device| device.revision == revision),
    }
    .ok_or_else(|| {
        let revisions: Vec<String> = of_kind().map(|device| format!("{:#010x}", device.revision)).collect();
        let got = wanted.revision.unwrap_or_default();
        DescriptionFault::new("revision", format!("expected one of {}, got {got:#010x}", revisions.join(", ")))
    })
}
