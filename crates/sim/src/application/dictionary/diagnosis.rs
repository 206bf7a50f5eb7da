//! Messages of the device in the diagnosis history of its dictionary, object 0x10F3 (protocol 6.3, ETG.1020).
//!
//! Input: messages, acknowledgements of the MainDevice. Output: the entries of the object. Without the flag
//! "acknowledge" a full history overwrites its oldest message, with the flag the new message is lost.

use ringcat_wire::mailbox::coe::{DiagnosisFlags, DiagnosisHistory, DiagnosisKind};

use super::Dictionary;

impl Dictionary {
    /// Stores a message; false if there is no history, its flags exclude such messages, or it is full.
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

    /// Flags of the history; `None` if there is no history.
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
            // The slots wrap around.
            let behind = if newest >= place { newest - place } else { room - (place - newest) };
            self.unacknowledged = self.unacknowledged.min(behind);
        }
        self.set_history(DiagnosisHistory::NEW_AVAILABLE, &[u8::from(self.unacknowledged > 0)]);
        // There is room for messages again: no further messages are lost.
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
