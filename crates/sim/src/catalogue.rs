//! Predefined devices, by name.
//!
//! Input: a name as in segment files. Output: a [`DeviceDescription`], which may be changed before a device is created.
//! Vendor and product numbers belong to the simulator; SyncManager settings are like those of real terminals (protocol
//! 3.11). Terminals are in `terminals`, the servo drive in `drive`, block and junctions in `machines`, devices for
//! mailbox tests in `protocols`.

mod drive;
mod machines;
pub(crate) mod parts;
mod protocols;
mod terminals;

use crate::description::DeviceDescription;

pub use parts::VENDOR_ID;
pub use protocols::LARGE_OBJECT_BYTES;

/// Creates a description.
type Maker = fn(&str) -> DeviceDescription;

/// All devices, in the order of lists for users.
const DEVICES: &[(&str, Maker)] = &[
    ("coupler", machines::coupler),
    ("junction", machines::junction),
    ("digital-input-4", |name| terminals::digital_input(name, 4)),
    ("digital-input-8", |name| terminals::digital_input(name, 8)),
    ("digital-input-16", |name| terminals::digital_input(name, 16)),
    ("digital-output-4", |name| terminals::digital_output(name, 4)),
    ("digital-output-8", |name| terminals::digital_output(name, 8)),
    ("digital-output-16", |name| terminals::digital_output(name, 16)),
    ("emulated-input-8", |name| terminals::emulated(terminals::digital_input(name, 8))),
    ("emulated-output-8", |name| terminals::emulated(terminals::digital_output(name, 8))),
    ("analog-input-4", |name| terminals::analog_input(name, 4)),
    ("analog-output-4", |name| terminals::analog_output(name, 4)),
    ("servo", drive::servo),
    ("block", machines::block),
    ("all-protocols", protocols::all_protocols),
    ("ethernet-terminal", protocols::ethernet_terminal),
    ("soe-drive", protocols::soe_drive),
];

/// The device with this name.
pub fn by_name(name: &str) -> Option<DeviceDescription> {
    DEVICES.iter().find(|(known, _)| *known == name).map(|(known, make)| make(known))
}

/// The names of all devices.
pub fn names() -> impl ExactSizeIterator<Item = &'static str> {
    DEVICES.iter().map(|(name, _)| *name)
}

#[cfg(test)]
mod tests;
