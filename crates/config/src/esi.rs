//! Device descriptions (ESI, ETG.2000; protocol 12): input is the bytes of a file, output an [`Esi`] or an error with
//! file, line, device and element. No files are opened here; [`References`] provides the files to which a file refers.
//!
//! The reader is lenient where the files of vendors differ (order of elements, `0x` numbers, encodings, unknown
//! elements and attributes, which are notices) and strict where a wrong guess would result in a wrong device: numbers
//! beyond their range, two devices of one identity, data with half a byte.

mod choices;
mod detected;
mod element;
mod error;
pub mod index;
mod limits;
mod model;
mod modules;
mod number;
mod parse;
mod references;
mod rules;
mod schema;
mod select;
mod selection;
pub mod sii;
mod values;

pub use choices::{Choices, EntryChoice, MappingChoice, Parameter, PdoChoice, SamplesChoice};
pub use detected::detected_modules;
pub use error::{EsiError, EsiProblem, Notice};
pub use limits::{
    MAX_ATTRIBUTE_BYTES, MAX_DEVICES, MAX_DICTIONARIES, MAX_ELEMENTS, MAX_PARTS, MAX_PARTS_BYTES, MAX_REFERENCED_BYTES,
    MAX_REFERENCES, MAX_TEXT_BYTES,
};
pub use model::{
    Access, AllowedModule, AoeSettings, ArrayBounds, Check, ClockSettings, CoeCommand, CoeSettings, Controller,
    DataType, Device, Dictionary, Eeprom, EepromCategory, EepromContent, EoeSettings, Esi, Flags, Fmmu, FmmuRole,
    Group, Info, Mailbox, Module, ModuleClass, Names, Object, ObjectInfo, OpMode, OpModeSyncManager, OtherIdentity,
    Pdo, PdoEntry, PortKind, PortSettings, Profile, RawCommand, Reference, RevisionCheck, ScaledTime, Slot,
    SlotDistances, SlotGroupData, SlotIndex, Slots, SoeCommand, StateTimes, SubDeviceOf, SubItem, SubItemInfo,
    SyncManager, SyncManagerRole, SyncUnit, Transition, Vendor,
};
pub use modules::{PlacedModule, place_modules};
pub use references::{NoReferences, References, read_with};
pub use rules::{Choice, choose};
pub use select::select;
pub use selection::{SelectedCommand, SelectedMessage, SelectedSyncManager, Selection};
pub use values::{Part, PartsRoom, parts};

use crate::xml;

/// Reads a file with devices or modules; `name` is the file in messages.
///
/// # Errors
/// [`EsiError`]: bytes that are not XML, files of another kind, values out of range, duplicates.
pub fn read(name: &str, bytes: &[u8]) -> Result<Esi, EsiError> {
    let (text, differs) = xml::decode_utf8_first(bytes).map_err(|error| EsiError::of_xml(name, error, bytes))?;
    let mut esi = parse::parse(name, &text)?;
    if differs {
        let text = "the declared encoding is not that of the bytes, which are UTF-8".to_owned();
        esi.notices.insert(0, Notice { line: 1, text, times: 1 });
    }
    Ok(esi)
}
