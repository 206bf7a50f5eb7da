//! The object dictionary of a simulated device from a description. PDO mappings, PDO assignments and the identity
//! follow from the rest of the device; the simulator creates them, with the names of the description.

use std::collections::BTreeMap;

use ringcat_config::esi::{
    Device, Dictionary, Esi, EsiError, EsiProblem, Object as EsiObject, Part, PartsRoom, PlacedModule, parts,
};
use ringcat_sim::application::dictionary::{Access, Entry, Object, ObjectRole};
use ringcat_sim::description::{PdoDescription, data_type};
use ringcat_wire::mailbox::coe::AccessRights;
use ringcat_wire::mailbox::coe::pdo_objects::is_of_pdos;
use ringcat_wire::sii::PdoDirection;

/// Objects that the simulator creates: identity, SyncManager types, PDO assignments, mappings.
fn is_derived(index: u16) -> bool {
    is_of_pdos(index) || matches!(index, 0x1018 | 0x1C00..=0x1C0F)
}

/// Configured and detected idents of modules.
const CONFIGURED_IDENTS: u16 = 0xF030;
const DETECTED_IDENTS: u16 = 0xF050;
/// Bytes of a number.
const NUMBER: usize = 8;

/// Objects of a description.
pub(super) struct Objects {
    /// Objects that the simulator takes as they are.
    pub(super) plain: Vec<Object>,
    /// Objects that the simulator derives from the rest of the device: it takes their names from here.
    pub(super) derived: Vec<Object>,
}

/// The objects of device and modules. The error is that of an object whose values do not fit beside the others.
pub(super) fn objects(
    esi: &Esi,
    device: &Device,
    placed: &[PlacedModule<'_>],
    pdos: &[PdoDescription],
) -> Result<Objects, String> {
    let mut objects: BTreeMap<u16, Object> = BTreeMap::new();
    let mut room = PartsRoom::default();
    let mut add = |dictionary: &Dictionary, object: &EsiObject, (file, kind): (&str, &str)| {
        let file = dictionary.file.as_deref().unwrap_or(file);
        let failed = |problem| EsiError::at_line(file, object.line, kind.trim(), problem).to_string();
        objects.insert(object.index.index, converted(dictionary, object, &mut room).map_err(failed)?);
        Ok::<_, String>(())
    };
    for dictionary in device.profiles.iter().filter_map(|profile| profile.dictionary.as_deref()) {
        for object in &dictionary.objects {
            add(dictionary, object, (&esi.file, &device.kind))?;
        }
    }
    for placed in placed {
        let module = placed.module;
        for dictionary in module.profiles.iter().filter_map(|profile| profile.dictionary.as_deref()) {
            for object in &dictionary.objects {
                let object = placed.object(object).map_err(|error| error.to_string())?;
                add(dictionary, &object, (&module.file, &module.kind))?;
            }
        }
    }
    if device.slots.as_ref().is_some_and(|slots| slots.download_idents) {
        for (index, name, access) in [
            (CONFIGURED_IDENTS, "Configured module idents", Access::ReadWrite),
            (DETECTED_IDENTS, "Detected module idents", Access::ReadOnly),
        ] {
            let mut idents = idents(index, name, access, placed);
            if let Some(described) = objects.get(&index) {
                idents.named_by(described);
            }
            objects.insert(index, idents);
        }
    }
    add_mapped(pdos, &mut objects);
    let (derived, plain) = objects.into_values().partition(|object| is_derived(object.index));
    Ok(Objects { plain, derived })
}

/// Detected modules by slot; the configured ones are zero until they are written.
fn idents(index: u16, name: &str, access: Access, placed: &[PlacedModule<'_>]) -> Object {
    let last = placed.iter().map(|module| module.slot + 1).max().unwrap_or(0);
    let ident = |slot: u16| {
        let module = placed.iter().find(|module| module.slot == slot && access == Access::ReadOnly);
        module.map_or(0, |module| module.module.ident)
    };
    let mut entries = vec![Entry::new(0, data_type::U8, access, &[last as u8])];
    for slot in 0..last {
        entries.push(Entry::new((slot + 1) as u8, data_type::U32, access, &ident(slot).to_le_bytes()));
    }
    Object { index, name: name.into(), role: ObjectRole::Plain, entries }
}

fn converted(dictionary: &Dictionary, object: &EsiObject, room: &mut PartsRoom) -> Result<Object, EsiProblem> {
    let parts = parts(dictionary, object, room)?;
    let is_single = parts.len() == 1;
    let entries = parts.iter().map(|part| entry(part, is_single)).collect();
    let name = object.name.english().into();
    Ok(Object { index: object.index.index, name, role: ObjectRole::Plain, entries })
}

/// The rights beside reading and writing.
const BESIDE_ACCESS: u16 =
    AccessRights::RX_MAPPABLE | AccessRights::TX_MAPPABLE | AccessRights::BACKUP | AccessRights::SETTING;

fn entry(part: &Part, is_single: bool) -> Entry {
    let rights = part.flags.access;
    let access = match (rights.read, rights.write) {
        (_, 0) => Access::ReadOnly,
        (0, _) => Access::WriteOnly,
        (_, 1) => Access::ReadWritePreOp,
        (_, _) => Access::ReadWrite,
    };
    let more = part.flags.access_word() & BESIDE_ACCESS;
    let code = u8::try_from(part.data_type).unwrap_or(data_type::OCTET_STRING);
    let bits = u16::try_from(part.bit_size).unwrap_or(0);
    let made = Entry::new(part.sub_index, code, access, &part.default).of_bits(bits).allow(more);
    let made = if is_single { made } else { made.named(&part.name) };
    match (&part.minimum, &part.maximum) {
        (Some(low), Some(high)) if is_unsigned(code) && low.len() <= NUMBER && part.default.len() < NUMBER => {
            made.within(number(low), number(high))
        }
        _ => made,
    }
}

/// Types of unsigned numbers: their limits can be compared directly.
fn is_unsigned(code: u8) -> bool {
    matches!(code, data_type::U8 | data_type::U16 | data_type::U32)
}

fn number(bytes: &[u8]) -> i64 {
    let mut value = [0; NUMBER];
    let length = bytes.len().min(NUMBER);
    value[..length].copy_from_slice(&bytes[..length]);
    i64::from_le_bytes(value)
}

/// Mapped entries that the file's dictionary lacks, in objects that it contains.
fn add_mapped(pdos: &[PdoDescription], objects: &mut BTreeMap<u16, Object>) {
    for pdo in pdos {
        let (access, right) = match pdo.direction {
            PdoDirection::Rx => (Access::ReadWrite, AccessRights::RX_MAPPABLE),
            PdoDirection::Tx => (Access::ReadOnly, AccessRights::TX_MAPPABLE),
        };
        for mapped in pdo.entries.iter().filter(|entry| entry.index != 0) {
            let Some(object) = objects.get_mut(&mapped.index) else { continue };
            if object.entries.iter().any(|entry| entry.sub_index == mapped.sub_index) {
                continue;
            }
            let zeros = vec![0; usize::from(mapped.bit_length).div_ceil(8)];
            let entry = Entry::new(mapped.sub_index, mapped.data_type, access, &zeros);
            let entry = entry.of_bits(mapped.bit_length.into());
            object.entries.push(entry.named(&mapped.name).allow(right));
            object.entries.sort_by_key(|entry| entry.sub_index);
        }
    }
}
