//! The content of a device description as written in the file (protocol ES-05 to ES-24): numbers are validated, nothing
//! is interpreted yet. Lines start at 1.

mod device;
mod dictionary;
mod mailbox;
mod names;
mod pdo;
mod reference;
mod slots;

pub use device::{
    Check, ClockSettings, Controller, Device, Eeprom, EepromCategory, EepromContent, Fmmu, FmmuRole, Info, OpMode,
    OpModeSyncManager, OtherIdentity, PortKind, PortSettings, RevisionCheck, ScaledTime, StateTimes, SubDeviceOf,
    SyncManager, SyncManagerRole, SyncUnit,
};
pub use dictionary::{
    Access, ArrayBounds, DataType, Dictionary, Flags, Object, ObjectInfo, Profile, SubItem, SubItemInfo,
};
pub use mailbox::{AoeSettings, CoeCommand, CoeSettings, EoeSettings, Mailbox, RawCommand, SoeCommand, Transition};
pub use names::Names;
pub use pdo::{Pdo, PdoEntry, SlotIndex};
pub use reference::Reference;
pub use slots::{AllowedModule, Module, ModuleClass, Slot, SlotDistances, SlotGroupData, Slots};

use super::error::Notice;

/// A file: descriptions of a vendor's devices, or modules of such devices.
#[derive(Clone, Debug, Default)]
pub struct Esi {
    /// The file, as the caller named it.
    pub file: String,
    /// Version of the schema as the file claims; tools do not keep it up to date.
    pub version: Option<String>,
    /// The vendor.
    pub vendor: Vendor,
    /// Groups of devices.
    pub groups: Vec<Group>,
    /// Devices in document order.
    pub devices: Vec<Device>,
    /// Modules in document order.
    pub modules: Vec<Module>,
    /// `InfoReference`: further files with modules, as written.
    pub references: Vec<Reference>,
    /// Those of them that are not there, after [`read_with`](super::read_with).
    pub missing: Vec<Reference>,
    /// What is not used, or in another way than written.
    pub notices: Vec<Notice>,
}

/// The vendor of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Vendor {
    /// Vendor id as assigned by ETG.
    pub id: u32,
    /// Name.
    pub name: Names,
    /// The vendor's own count of editions of the file.
    pub file_version: Option<i32>,
}

/// A group of devices.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Group {
    /// Line in the file.
    pub line: u32,
    /// Key that devices name.
    pub key: String,
    /// Name.
    pub name: Names,
    /// Key of the group above.
    pub parent: Option<String>,
    /// Place in a list.
    pub sort_order: Option<i32>,
}

impl Esi {
    /// The group of a device.
    pub fn group_of(&self, device: &Device) -> Option<&Group> {
        self.groups.iter().find(|group| group.key.trim() == device.group.trim())
    }
}
