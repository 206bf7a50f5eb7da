//! The PDOs that a device has with its modules (protocol ES-64, ES-67, ES-71).

use std::collections::HashMap;

use super::work::Work;
use crate::esi::error::EsiError;
use crate::esi::model::Pdo;

/// Entries of the PDOs of all modules, at most: a module is in up to 255 slots.
const MAX_ENTRIES: usize = 1 << 18;

/// A PDO that can be assigned.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// With the indices of its slot.
    pub pdo: Pdo,
    /// It has outputs of the MainDevice.
    pub outputs: bool,
    /// The file that describes it.
    pub file: String,
    /// Slot of its module.
    pub slot: Option<u16>,
}

impl Candidate {
    /// Index and name, for messages.
    pub fn label(&self) -> String {
        let name = self.pdo.name.english().trim();
        let name = if name.is_empty() { String::new() } else { format!(" \"{}\"", name.escape_debug()) };
        format!("PDO {:#06x}{name}", self.pdo.index.index)
    }

    /// An error about it, at its line.
    pub fn error(&self, work: &Work<'_>, reason: impl std::fmt::Display) -> EsiError {
        let reason = format!("{}: {reason}", self.label());
        EsiError::rule(&self.file, self.pdo.line, work.device.kind.trim(), reason)
    }
}

/// All PDOs: those of the device in document order, then those of its modules by slot. A module's PDO replaces one of
/// the device that is made for this; otherwise an index has one owner.
pub(super) fn candidates(work: &Work<'_>) -> Result<Vec<Candidate>, EsiError> {
    let mut all: Vec<Candidate> = Vec::new();
    let mut by_index: HashMap<u16, usize> = HashMap::new();
    let device = work.device;
    for (pdos, outputs) in [(&device.rx_pdos, true), (&device.tx_pdos, false)] {
        for pdo in pdos {
            by_index.entry(pdo.index.index).or_insert(all.len());
            all.push(Candidate { pdo: pdo.clone(), outputs, file: work.esi.file.clone(), slot: None });
        }
    }
    let mut replaced = Vec::new();
    let mut entries = 0;
    for placed in &work.modules {
        let module = placed.module;
        for (pdos, outputs) in [(&module.rx_pdos, true), (&module.tx_pdos, false)] {
            entries += pdos.iter().map(|pdo| pdo.entries.len().max(1)).sum::<usize>();
            if entries > MAX_ENTRIES {
                let reason = format!("the modules bring more than {MAX_ENTRIES} entries");
                return Err(work.error(device.line, reason));
            }
            for pdo in placed.pdos(pdos)? {
                let file = module.file.to_string();
                let new = Candidate { pdo, outputs, file, slot: Some(placed.slot) };
                if let Some(known) = by_index.insert(new.pdo.index.index, all.len()) {
                    let first = &all[known];
                    if first.slot.is_some() || !first.pdo.overwritten_by_module {
                        let owner = first.slot.map_or("the device".to_owned(), |slot| format!("slot {slot}"));
                        let reason = format!("slot {} brings it, and {owner} has it already", placed.slot);
                        return Err(new.error(work, reason));
                    }
                    replaced.push(known);
                }
                all.push(new);
            }
        }
    }
    replaced.sort_unstable();
    for known in replaced.into_iter().rev() {
        all.remove(known);
    }
    Ok(all)
}
