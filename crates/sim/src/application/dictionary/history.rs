//! The diagnosis history, object 0x10F3: messages kept in a ring (facts 6.3, ETG.1020).
//!
//! In: messages of the device, acknowledgements of the MainDevice. Out: the entries of the object. Without the flag
//! "acknowledge" a full history overwrites its oldest message, with it the new one is lost.

use ringcat_wire::mailbox::coe::{DiagnosisFlags, DiagnosisHistory, DiagnosisKind};
use ringcat_wire::mailbox::sdo::AbortCode;

use super::{Access, Dictionary, Entry, Object, ObjectRole};
use crate::description::data_type;

/// An empty history with room for so many messages, 1 to 250.
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

/// What sub index 3 takes: 0, or the place of a message.
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

impl Dictionary {
    /// Keeps a message; false where there is no history, its flags keep such messages out, or it is full.
    pub fn diagnose(&mut self, kind: DiagnosisKind, message: &[u8]) -> bool {
        let Some(flags) = self.diagnosis_flags() else {
            return false;
        };
        let unwanted = match kind {
            DiagnosisKind::Information => DiagnosisFlags::NO_INFORMATION,
            DiagnosisKind::Warning => DiagnosisFlags::NO_WARNINGS,
            DiagnosisKind::Error => DiagnosisFlags::NO_ERRORS,
            DiagnosisKind::Other(_) => 0,
        };
        if unwanted != 0 && flags.has(unwanted) {
            return false;
        }
        let room = self.history_value(DiagnosisHistory::MAXIMUM_MESSAGES);
        if self.unacknowledged >= room {
            self.set_history(DiagnosisHistory::FLAGS, &(flags.0 | DiagnosisFlags::LOST).to_le_bytes());
            if flags.has(DiagnosisFlags::ACKNOWLEDGE) {
                return false;
            }
        }
        self.unacknowledged = (self.unacknowledged + 1).min(room);
        let newest = self.history_value(DiagnosisHistory::NEWEST_MESSAGE);
        let last = DiagnosisHistory::FIRST_MESSAGE - 1 + room;
        let place = if newest == 0 || newest == last { DiagnosisHistory::FIRST_MESSAGE } else { newest + 1 };
        self.set_history(place, message);
        self.set_history(DiagnosisHistory::NEWEST_MESSAGE, &[place]);
        self.set_history(DiagnosisHistory::NEW_AVAILABLE, &[1]);
        true
    }

    /// Flags of the history; `None` where there is none.
    pub fn diagnosis_flags(&self) -> Option<DiagnosisFlags> {
        let flags = self.object(DiagnosisHistory::INDEX)?.entry(DiagnosisHistory::FLAGS)?;
        flags.value.first_chunk().map(|bytes| DiagnosisFlags(u16::from_le_bytes(*bytes)))
    }

    /// An entry of the history was written.
    pub(super) fn acknowledge(&mut self, sub_index: u8, data: &[u8]) {
        let &[place] = data else {
            return;
        };
        if sub_index != DiagnosisHistory::NEWEST_ACKNOWLEDGED {
            return;
        }
        let room = self.history_value(DiagnosisHistory::MAXIMUM_MESSAGES);
        if place == 0 {
            for sub_index in (DiagnosisHistory::FIRST_MESSAGE..=u8::MAX).take(room.into()) {
                self.set_history(sub_index, &[]);
            }
            self.set_history(DiagnosisHistory::NEWEST_MESSAGE, &[0]);
            self.unacknowledged = 0;
        } else {
            let newest = self.history_value(DiagnosisHistory::NEWEST_MESSAGE);
            // The ring goes on behind its end.
            let behind = if newest >= place { newest - place } else { room - (place - newest) };
            self.unacknowledged = self.unacknowledged.min(behind);
        }
        self.set_history(DiagnosisHistory::NEW_AVAILABLE, &[u8::from(self.unacknowledged > 0)]);
        // Room for messages again: nothing more is lost.
        let flags = self.diagnosis_flags().unwrap_or_default().0 & !DiagnosisFlags::LOST;
        self.set_history(DiagnosisHistory::FLAGS, &flags.to_le_bytes());
    }

    fn history_value(&self, sub_index: u8) -> u8 {
        let entry = self.object(DiagnosisHistory::INDEX).and_then(|object| object.entry(sub_index));
        entry.and_then(|entry| entry.value.first().copied()).unwrap_or(0)
    }

    fn set_history(&mut self, sub_index: u8, value: &[u8]) {
        let object = self.object_mut(DiagnosisHistory::INDEX);
        if let Some(entry) = object.and_then(|object| object.entry_mut(sub_index)) {
            entry.value = value.into();
        }
    }
}
