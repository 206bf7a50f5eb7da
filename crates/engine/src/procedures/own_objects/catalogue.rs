//! The objects of the MainDevice itself (protocol 10.2, ETG.1510), and their entries.

use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::{DataType, DiagnosisHistory, DiagnosisMessage, ObjectCode};

use crate::event::history::MESSAGES;

/// SubDevices in one list of addresses.
pub(super) const LIST: usize = 255;
/// Lists of addresses.
const LISTS: u16 = 16;
/// SubDevices with objects: the lists have room for no more.
pub(super) const MAX_MODULES: usize = LIST * LISTS as usize;

/// Bytes of a text: a longer text is cut, and a shorter text is padded with zeros if a whole object is read.
pub(super) const TEXT_BYTES: usize = 64;

/// Bytes of the two parameters of each message of the diagnosis history: a station address (UNSIGNED16), a code
/// (UNSIGNED32).
pub(super) const PARAMETERS: usize = 2 + 2 + 2 + 4;

const CONFIGURATION: u16 = 0x8000;
const INFORMATION: u16 = 0x9000;
const DIAGNOSIS: u16 = 0xA000;
/// Bits of an index that belong to the SubDevice.
const MODULE: u16 = 0x0FFF;
const CONFIGURED: u16 = 0xF020;
const DETECTED: u16 = 0xF040;
/// Bits of an index that belong to the list.
const LIST_MASK: u16 = 0x000F;

/// An object of the MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Object {
    DeviceType,
    Name,
    HardwareVersion,
    SoftwareVersion,
    Identity,
    DiagnosisHistory,
    /// Declared data of a SubDevice.
    Configuration(usize),
    /// Data found by the scan.
    Information(usize),
    /// Present state of a SubDevice.
    Diagnosis(usize),
    ModularProfile,
    DetectModules,
    /// A list of declared station addresses.
    ConfiguredAddresses(usize),
    /// A list of station addresses that answer.
    DetectedAddresses(usize),
    MainDeviceDiagnosis,
    DiagnosisControl,
}

/// An entry of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub sub_index: u8,
    pub name: &'static str,
    pub data_type: DataType,
    pub bits: u16,
    pub writable: bool,
}

/// Subindices with their values, in ascending order, without subindex 0 of arrays and records.
pub(super) type Values = Vec<(u8, Vec<u8>)>;

const fn entry(sub_index: u8, data_type: DataType, name: &'static str) -> Entry {
    let bits = match data_type.bits() {
        Some(bits) => bits,
        None => TEXT_BYTES as u16 * 8,
    };
    Entry { sub_index, name, data_type, bits, writable: false }
}

const fn octets(sub_index: u8, bytes: u16, name: &'static str) -> Entry {
    Entry { bits: bytes * 8, ..entry(sub_index, DataType::OCTET_STRING, name) }
}

const fn writable(entry: Entry) -> Entry {
    Entry { writable: true, ..entry }
}

const BOOL: DataType = DataType::BOOLEAN;
const U8: DataType = DataType::UNSIGNED8;
const U16: DataType = DataType::UNSIGNED16;
const U32: DataType = DataType::UNSIGNED32;
const TEXT: DataType = DataType::VISIBLE_STRING;

const DEVICE_TYPE: &[Entry] = &[entry(0, U32, "Device type")];
const NAME: &[Entry] = &[entry(0, TEXT, "Device name")];
const HARDWARE: &[Entry] = &[entry(0, TEXT, "Hardware version")];
const SOFTWARE: &[Entry] = &[entry(0, TEXT, "Software version")];
const IDENTITY: &[Entry] = &[
    entry(1, U32, "Vendor ID"),
    entry(2, U32, "Product code"),
    entry(3, U32, "Revision number"),
    entry(4, U32, "Serial number"),
];
/// Entries before the messages.
const HISTORY: &[Entry] = &[
    entry(DiagnosisHistory::MAXIMUM_MESSAGES, U8, "Maximum messages"),
    entry(DiagnosisHistory::NEWEST_MESSAGE, U8, "Newest message"),
    writable(entry(DiagnosisHistory::NEWEST_ACKNOWLEDGED, U8, "Newest acknowledged message")),
    entry(DiagnosisHistory::NEW_AVAILABLE, BOOL, "New messages available"),
    writable(entry(DiagnosisHistory::FLAGS, U16, "Flags")),
];
/// Subindex of the last message.
const LAST_MESSAGE: u8 = DiagnosisHistory::FIRST_MESSAGE + MESSAGES - 1;
const OF_CONFIGURATION: &[Entry] = &[
    entry(1, U16, "Fixed station address"),
    entry(2, TEXT, "Type"),
    entry(3, TEXT, "Name"),
    entry(4, U32, "Device type"),
    entry(5, U32, "Vendor ID"),
    entry(6, U32, "Product code"),
    entry(7, U32, "Revision number"),
    entry(8, U32, "Serial number"),
    entry(33, U16, "Mailbox out size"),
    entry(34, U16, "Mailbox in size"),
    entry(35, U8, "Link status"),
    entry(36, U8, "Link preset"),
    entry(37, U8, "Flags"),
    entry(38, U16, "Port physics"),
    entry(39, U16, "Mailbox protocols supported"),
    entry(40, BOOL, "Diagnosis history supported"),
];
const OF_INFORMATION: &[Entry] = &[
    entry(1, U16, "Fixed station address"),
    entry(5, U32, "Vendor ID"),
    entry(6, U32, "Product code"),
    entry(7, U32, "Revision number"),
    entry(8, U32, "Serial number"),
    entry(32, U16, "DL status"),
];
const OF_DIAGNOSIS: &[Entry] = &[
    entry(1, U16, "AL status"),
    entry(2, U16, "AL control"),
    entry(3, U16, "AL status code"),
    entry(4, U8, "Link connection status"),
    entry(5, U8, "Link control"),
    entry(6, U16, "Station address at port 0"),
    entry(7, U16, "Station address at port 1"),
    entry(8, U16, "Station address at port 2"),
    entry(9, U16, "Station address at port 3"),
    entry(10, U32, "Frame error counter port 0"),
    entry(11, U32, "Frame error counter port 1"),
    entry(12, U32, "Frame error counter port 2"),
    entry(13, U32, "Frame error counter port 3"),
    entry(14, U32, "Cyclic working counter errors"),
    entry(15, U32, "Not present counter"),
    entry(16, U32, "Abnormal state change counter"),
    entry(17, BOOL, "Automatic link control disabled"),
    entry(18, U32, "Last protocol error"),
    entry(19, BOOL, "New diagnosis message"),
];
const MODULAR: &[Entry] = &[entry(1, U16, "Index distance"), entry(2, U16, "Maximum number of modules")];
const DETECT: &[Entry] = &[writable(octets(1, 2, "Request")), entry(2, U8, "Status"), octets(3, 6, "Response")];
const ADDRESSES: &[Entry] = &[entry(1, U16, "Station address")];
const OF_MAIN_DEVICE: &[Entry] = &[
    entry(1, U32, "Lost cyclic frames"),
    entry(2, U32, "Lost acyclic frames"),
    entry(3, U32, "Cyclic frames per second"),
    entry(4, U32, "Acyclic frames per second"),
    entry(16, U16, "State"),
];
const CONTROL: &[Entry] = &[writable(entry(16, BOOL, "Reset diagnosis information"))];

impl Object {
    /// The object with an index, with this number of declared SubDevices.
    pub(super) fn at(index: u16, declared: usize) -> Option<Object> {
        let module = usize::from(index & MODULE);
        let is_module = module < declared.min(MAX_MODULES);
        let list = usize::from(index & LIST_MASK);
        Some(match index {
            0x1000 => Object::DeviceType,
            0x1008 => Object::Name,
            0x1009 => Object::HardwareVersion,
            0x100A => Object::SoftwareVersion,
            0x1018 => Object::Identity,
            DiagnosisHistory::INDEX => Object::DiagnosisHistory,
            0xF000 => Object::ModularProfile,
            0xF002 => Object::DetectModules,
            0xF120 => Object::MainDeviceDiagnosis,
            0xF200 => Object::DiagnosisControl,
            _ if index & !LIST_MASK == CONFIGURED => Object::ConfiguredAddresses(list),
            _ if index & !LIST_MASK == DETECTED => Object::DetectedAddresses(list),
            _ if is_module && index & !MODULE == CONFIGURATION => Object::Configuration(module),
            _ if is_module && index & !MODULE == INFORMATION => Object::Information(module),
            _ if is_module && index & !MODULE == DIAGNOSIS => Object::Diagnosis(module),
            _ => return None,
        })
    }

    /// The indices of all objects, with this number of declared SubDevices, in ascending order.
    pub(super) fn indices(declared: usize) -> impl Iterator<Item = u16> {
        let modules = declared.min(MAX_MODULES) as u16;
        let of_each = [CONFIGURATION, INFORMATION, DIAGNOSIS].into_iter().flat_map(move |first| first..first + modules);
        let lists = [CONFIGURED, DETECTED].into_iter().flat_map(|first| first..first + LISTS);
        [0x1000, 0x1008, 0x1009, 0x100A, 0x1018, DiagnosisHistory::INDEX]
            .into_iter()
            .chain(of_each)
            .chain([0xF000, 0xF002])
            .chain(lists)
            .chain([0xF120, 0xF200])
    }

    /// Its entries without subindex 0 of arrays and records, and without the messages of the history. For lists of
    /// addresses, only the first entry.
    pub(super) const fn entries(self) -> &'static [Entry] {
        match self {
            Object::DeviceType => DEVICE_TYPE,
            Object::Name => NAME,
            Object::HardwareVersion => HARDWARE,
            Object::SoftwareVersion => SOFTWARE,
            Object::Identity => IDENTITY,
            Object::DiagnosisHistory => HISTORY,
            Object::Configuration(_) => OF_CONFIGURATION,
            Object::Information(_) => OF_INFORMATION,
            Object::Diagnosis(_) => OF_DIAGNOSIS,
            Object::ModularProfile => MODULAR,
            Object::DetectModules => DETECT,
            Object::ConfiguredAddresses(_) | Object::DetectedAddresses(_) => ADDRESSES,
            Object::MainDeviceDiagnosis => OF_MAIN_DEVICE,
            Object::DiagnosisControl => CONTROL,
        }
    }

    /// The entry with a subindex.
    pub(super) fn entry(self, sub_index: u8) -> Option<Entry> {
        let entries = self.entries();
        if sub_index == 0 && self.code() != ObjectCode::Variable {
            return Some(entry(0, U8, "Number of entries"));
        }
        if self == Object::DiagnosisHistory && (DiagnosisHistory::FIRST_MESSAGE..=LAST_MESSAGE).contains(&sub_index) {
            return Some(octets(sub_index, (DiagnosisMessage::OVERHEAD + PARAMETERS) as u16, "Diagnosis message"));
        }
        if self.code() == ObjectCode::Array {
            return entries.first().map(|first| Entry { sub_index, ..*first });
        }
        entries.iter().find(|entry| entry.sub_index == sub_index).copied()
    }

    /// Its largest subindex.
    pub(super) fn max_sub_index(self) -> u8 {
        match (self, self.code()) {
            (Object::DiagnosisHistory, _) => LAST_MESSAGE,
            (_, ObjectCode::Array) => LIST as u8,
            _ => self.entries().last().map_or(0, |last| last.sub_index),
        }
    }

    /// Its object code.
    pub(super) const fn code(self) -> ObjectCode {
        match self {
            Object::DeviceType | Object::Name | Object::HardwareVersion | Object::SoftwareVersion => {
                ObjectCode::Variable
            }
            Object::ConfiguredAddresses(_) | Object::DetectedAddresses(_) => ObjectCode::Array,
            Object::Identity
            | Object::DiagnosisHistory
            | Object::Configuration(_)
            | Object::Information(_)
            | Object::Diagnosis(_)
            | Object::ModularProfile
            | Object::DetectModules
            | Object::MainDeviceDiagnosis
            | Object::DiagnosisControl => ObjectCode::Record,
        }
    }

    /// Data type of its value or of its entries; a record has none.
    pub(super) fn data_type(self) -> DataType {
        let first = self.entries().first().filter(|_| self.code() != ObjectCode::Record);
        first.map_or(DataType(0), |first| first.data_type)
    }

    /// Its name.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Object::DeviceType => "Device type",
            Object::Name => "Device name",
            Object::HardwareVersion => "Hardware version",
            Object::SoftwareVersion => "Software version",
            Object::Identity => "Identity",
            Object::DiagnosisHistory => "Diagnosis history",
            Object::Configuration(_) => "Configuration data",
            Object::Information(_) => "Information data",
            Object::Diagnosis(_) => "Diagnosis data",
            Object::ModularProfile => "Modular device profile",
            Object::DetectModules => "Detect modules command",
            Object::ConfiguredAddresses(_) => "Configured address list",
            Object::DetectedAddresses(_) => "Detected address list",
            Object::MainDeviceDiagnosis => "MainDevice diagnosis data",
            Object::DiagnosisControl => "Diagnosis control",
        }
    }

    /// Whether all entries may be read at once.
    pub(super) const fn has_complete_access(self) -> bool {
        !matches!(self, Object::DiagnosisHistory) && !matches!(self.code(), ObjectCode::Variable)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 10.2, own-objects
    #[test]
    fn exactly_the_listed_indices_are_objects() {
        for declared in [0, 3, MAX_MODULES + 100] {
            let listed: Vec<u16> = Object::indices(declared).collect();
            assert!(listed.is_sorted_by(|one, next| one < next));
            let there: Vec<u16> = (0..=u16::MAX).filter(|index| Object::at(*index, declared).is_some()).collect();
            assert_eq!(listed, there, "{declared} declared");
        }
        assert_eq!(Object::indices(3).count(), 6 + 9 + 2 + 32 + 2);
    }

    // covers: 10.2
    #[test]
    fn subindices_ascend_and_only_four_entries_are_written() {
        let mut written = Vec::new();
        for index in Object::indices(1) {
            let object = Object::at(index, 1).unwrap();
            assert!(object.entries().is_sorted_by(|one, next| one.sub_index < next.sub_index), "{object:?}");
            assert!(object.entry(0).is_some());
            let writable = object.entries().iter().filter(|entry| entry.writable);
            written.extend(writable.map(|entry| (index, entry.sub_index)));
        }
        assert_eq!(written, [(0x10F3, 3), (0x10F3, 5), (0xF002, 1), (0xF200, 16)]);
        assert!(Object::Diagnosis(0).entry(20).is_none());
        assert!(Object::DiagnosisHistory.entry(55).is_some() && Object::DiagnosisHistory.entry(56).is_none());
        assert_eq!(Object::ConfiguredAddresses(0).entry(200).map(|entry| entry.sub_index), Some(200));
    }
}
