//! The diagnosis history, object 0x10F3: a ring buffer of messages (protocol 6.3, ETG.1020).
//!
//! Creates the object and checks acknowledgements; [`super::diagnosis`] stores messages.

use ringcat_wire::mailbox::coe::DiagnosisHistory;
use ringcat_wire::mailbox::sdo::AbortCode;

use super::entry::{Access, Entry};
use super::object::{Object, ObjectRole};
use crate::data_type;

/// An empty history for this number of messages, 1 to 250.
pub fn history(messages: u8) -> Object {
    let messages = messages.clamp(1, u8::MAX - DiagnosisHistory::FIRST_MESSAGE + 1);
    let last = DiagnosisHistory::FIRST_MESSAGE - 1 + messages;
    let number =
        |sub_index, access, value, name: &str| Entry::new(sub_index, data_type::U8, access, &[value]).named(name);
    let mut entries = vec![
        number(0, Access::ReadOnly, last, ""),
        number(DiagnosisHistory::MAXIMUM_MESSAGES, Access::ReadOnly, messages, "Maximum messages"),
        number(DiagnosisHistory::NEWEST_MESSAGE, Access::ReadOnly, 0, "Newest message"),
        number(DiagnosisHistory::NEWEST_ACKNOWLEDGED, Access::ReadWrite, 0, "Newest acknowledged message"),
        Entry::new(DiagnosisHistory::NEW_AVAILABLE, data_type::BOOL, Access::ReadOnly, &[0]).named("New messages"),
        Entry::new(DiagnosisHistory::FLAGS, data_type::U16, Access::ReadWrite, &[0, 0]).named("Flags"),
    ];
    let message = |sub_index| Entry::new(sub_index, data_type::OCTET_STRING, Access::ReadOnly, &[]).named("Message");
    entries.extend((DiagnosisHistory::FIRST_MESSAGE..=last).map(message));
    Object { index: DiagnosisHistory::INDEX, name: "Diagnosis history".into(), role: ObjectRole::History, entries }
}

/// Checks a value for subindex 3: 0, or the position of a message.
pub(super) fn check_acknowledge(object: &Object, sub_index: u8, data: &[u8]) -> Result<(), AbortCode> {
    let value = match (sub_index, data) {
        (DiagnosisHistory::NEWEST_ACKNOWLEDGED, [value]) if *value != 0 => *value,
        _ => return Ok(()),
    };
    if value < DiagnosisHistory::FIRST_MESSAGE {
        return Err(AbortCode::VALUE_TOO_LOW);
    }
    let there = object.entry(value).is_some_and(|entry| !entry.value.is_empty());
    if there { Ok(()) } else { Err(AbortCode::VALUE_TOO_HIGH) }
}
