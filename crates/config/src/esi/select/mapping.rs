//! Entries of a PDO that were chosen (protocol ES-47, ES-50).

use super::candidates::Candidate;
use super::work::Work;
use crate::esi::choices::EntryChoice;
use crate::esi::error::EsiError;
use crate::esi::model::{Names, Pdo, PdoEntry, SlotIndex};
use crate::esi::sii::name_of;

/// Entries of a PDO: subindices of its object.
const MAX_ENTRIES: usize = 255;

/// The PDO with the entries that were chosen, else as it is.
pub(super) fn mapped(work: &Work<'_>, of: &Candidate) -> Result<Pdo, EsiError> {
    let mut pdo = of.pdo.clone();
    let Some(choice) = work.choices.mappings.iter().find(|it| it.index == pdo.index.index) else { return Ok(pdo) };
    if pdo.is_fixed {
        return Err(of.error(work, "its entries are fixed (Fixed): they cannot be chosen"));
    }
    let coe = work.device.mailbox.as_ref().and_then(|mailbox| mailbox.coe.as_ref());
    if !coe.is_some_and(|coe| coe.pdo_config) {
        return Err(of.error(work, "its entries cannot be chosen: CoE has no PdoConfig"));
    }
    if choice.entries.len() > MAX_ENTRIES {
        return Err(of.error(work, format!("{} entries, at most {MAX_ENTRIES} are possible", choice.entries.len())));
    }
    pdo.entries = choice.entries.iter().map(|entry| chosen(work, of, *entry)).collect::<Result<_, _>>()?;
    let is_there = |fixed: &PdoEntry| {
        let same =
            |it: &PdoEntry| (it.index, it.sub_index, it.bit_length) == (fixed.index, fixed.sub_index, fixed.bit_length);
        pdo.entries.iter().any(same)
    };
    if let Some(gone) = of.pdo.entries.iter().find(|entry| entry.is_fixed && !is_there(entry)) {
        let reason = format!("its entry {:#06x}:{:02x} is fixed: it has to stay", gone.index.index, gone.sub_index);
        return Err(of.error(work, reason));
    }
    Ok(pdo)
}

/// An entry with the name and type of its object.
fn chosen(work: &Work<'_>, of: &Candidate, entry: EntryChoice) -> Result<PdoEntry, EsiError> {
    let EntryChoice { index, sub_index, bits } = entry;
    let slot_index = SlotIndex { index, by_slot: false, by_group: false };
    if index == 0 {
        let bits = bits.ok_or_else(|| of.error(work, "a gap needs its number of bits"))?;
        return Ok(PdoEntry { bit_length: bits.into(), ..PdoEntry::default() });
    }
    let same = |it: &&PdoEntry| (it.index.index, it.sub_index) == (index, sub_index);
    let described = of.pdo.entries.iter().find(same);
    let what = format!("entry {index:#06x}:{sub_index:02x}");
    let Some(found) = work.find(index, sub_index) else {
        if work.has_objects() && described.is_none() {
            return Err(of.error(work, format!("{what}: the dictionary of the device has no such object")));
        }
        let known = described.map(|it| it.bit_length);
        let bit_length = bits.map(u16::from).or(known).ok_or_else(|| {
            of.error(work, format!("{what}: its number of bits is not known: there is no dictionary"))
        })?;
        let described = described.cloned().unwrap_or_default();
        return Ok(PdoEntry { index: slot_index, sub_index, bit_length, is_fixed: false, ..described });
    };
    let flags = found.part.flags;
    let (is_mappable, direction) =
        if of.outputs { (flags.rx_mappable, "an RxPdo") } else { (flags.tx_mappable, "a TxPdo") };
    if !is_mappable {
        let line = found.line;
        return Err(of.error(work, format!("{what} (line {line}) cannot be mapped to {direction} (PdoMapping)")));
    }
    if let Some(bits) = bits.filter(|bits| u32::from(*bits) != found.part.bit_size) {
        return Err(of.error(work, format!("{what}: expected {} bits, got {bits}", found.part.bit_size)));
    }
    let bit_length = u16::try_from(found.part.bit_size).ok().filter(|bits| *bits > 0);
    let bit_length = bit_length.ok_or_else(|| of.error(work, format!("{what} has {} bits", found.part.bit_size)))?;
    let name = Names::new(vec![(work.choices.language, found.part.name.clone())]);
    let data_type = name_of(found.part.data_type);
    Ok(PdoEntry { index: slot_index, sub_index, bit_length, name, data_type, is_fixed: false })
}
