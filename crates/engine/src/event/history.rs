//! Diagnosis history: events of SubDevices and cables, the content of object 0x10F3 of the MainDevice (protocol 6.3,
//! 10.2).
//!
//! Input: the events of the acyclic half. Output: messages in slots; a new message overwrites the oldest one. As in the
//! history of a SubDevice, a flag shows that messages were lost.

use alloc::vec::Vec;

use ringcat_wire::mailbox::coe::{DiagnosisFlags, DiagnosisHistory, DiagnosisKind};
use ringcat_wire::mailbox::sdo::AbortCode;

use super::Event;
use crate::declared::{Address, SubDeviceId};
use crate::time::Instant;

/// Number of messages kept: one incident causes about five.
pub const MESSAGES: u8 = 50;
/// Flags that may be set. The MainDevice sends no emergencies.
const SETTINGS: u16 = DiagnosisFlags::NO_INFORMATION
    | DiagnosisFlags::NO_WARNINGS
    | DiagnosisFlags::NO_ERRORS
    | DiagnosisFlags::ACKNOWLEDGE;

/// One message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Incident {
    /// Time.
    pub at: Instant,
    /// Severity.
    pub kind: DiagnosisKind,
    /// Number of the text (docs/mailbox-gateway.md).
    pub number: u16,
    /// Index in the declaration of the SubDevice concerned.
    pub subdevice: Option<SubDeviceId>,
    /// Additional code; 0 if there is none.
    pub detail: u32,
}

impl Incident {
    /// The message for an event; `None` for an event that is not kept.
    fn new(at: Instant, event: &Event) -> Option<Incident> {
        use DiagnosisKind::{Error, Information, Warning};
        let (number, kind, subdevice, detail) = match *event {
            Event::Lost { subdevice } => (1, Error, Some(subdevice), 0),
            Event::Returned { subdevice } => (2, Information, Some(subdevice), 0),
            Event::StateError { subdevice, code, .. } => (3, Error, Some(subdevice), u32::from(code.0)),
            Event::ConfigurationFailed { subdevice, .. } => (4, Error, Some(subdevice), 0),
            Event::Mismatch { subdevice, got, .. } => (5, Error, Some(subdevice), got),
            Event::Missing { subdevice, optional } => {
                (6, if optional { Information } else { Error }, Some(subdevice), 0)
            }
            Event::RingOpened { .. } => (7, Warning, None, 0),
            Event::RingClosed { .. } => (8, Information, None, 0),
            Event::LinkDown { link } => (9, Warning, None, link.index() as u32),
            Event::LinkUp { link } => (10, Information, None, link.index() as u32),
            Event::CableErrors { .. } => (11, Warning, None, 0),
            Event::Emergency { subdevice, emergency } => {
                (12, Warning, declared(subdevice), u32::from(emergency.error_code))
            }
            Event::JunctionChanged { broken, declared: [_, subdevice], .. } => {
                (13, if broken { Warning } else { Information }, subdevice, broken.into())
            }
            _ => return None,
        };
        Some(Incident { at, kind, number, subdevice, detail })
    }
}

/// The declared SubDevice; a position before activation says nothing about the declaration.
const fn declared(subdevice: Address) -> Option<SubDeviceId> {
    match subdevice {
        Address::Declared(subdevice) => Some(subdevice),
        Address::Scanned(_) => None,
    }
}

/// The messages, the next slot, and the acknowledgement.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Messages by slot; grows up to [`MESSAGES`].
    incidents: Vec<Incident>,
    /// Slot of the newest message.
    newest: Option<u8>,
    /// Last acknowledged subindex; 0 for none.
    acknowledged: u8,
    /// Number of the newest messages that were not acknowledged.
    unacknowledged: u8,
    flags: u16,
}

impl History {
    /// Adds the message for an event, if there is one.
    pub(super) fn note(&mut self, at: Instant, event: &Event) {
        if let Some(incident) = Incident::new(at, event) {
            self.keep(incident);
        }
    }

    fn keep(&mut self, incident: Incident) {
        let unwanted = match incident.kind {
            DiagnosisKind::Information => DiagnosisFlags::NO_INFORMATION,
            DiagnosisKind::Warning => DiagnosisFlags::NO_WARNINGS,
            DiagnosisKind::Error | DiagnosisKind::Other(_) => DiagnosisFlags::NO_ERRORS,
        };
        if self.flags & unwanted != 0 {
            return;
        }
        if self.unacknowledged >= MESSAGES {
            self.flags |= DiagnosisFlags::LOST;
            if self.flags & DiagnosisFlags::ACKNOWLEDGE != 0 {
                return;
            }
        }
        let place = self.newest.map_or(0, |newest| (newest + 1) % MESSAGES);
        match self.incidents.get_mut(usize::from(place)) {
            Some(oldest) => *oldest = incident,
            None => self.incidents.push(incident),
        }
        if self.acknowledged == place + DiagnosisHistory::FIRST_MESSAGE {
            // The acknowledged message is overwritten.
            self.acknowledged = 0;
        }
        self.newest = Some(place);
        self.unacknowledged = (self.unacknowledged + 1).min(MESSAGES);
    }

    /// The message at a subindex.
    pub fn incident(&self, sub_index: u8) -> Option<Incident> {
        let place = sub_index.checked_sub(DiagnosisHistory::FIRST_MESSAGE)?;
        self.incidents.get(usize::from(place)).copied()
    }

    /// Subindex of the newest message; 0 if there is none.
    pub fn newest(&self) -> u8 {
        self.newest.map_or(0, |place| place + DiagnosisHistory::FIRST_MESSAGE)
    }

    /// Subindex of the last acknowledged message; 0 if there is none or it was overwritten.
    pub fn acknowledged(&self) -> u8 {
        self.acknowledged
    }

    /// Whether there are messages that were not acknowledged.
    pub fn has_unacknowledged(&self) -> bool {
        self.unacknowledged > 0
    }

    /// Settings, and whether messages were lost.
    pub fn flags(&self) -> DiagnosisFlags {
        DiagnosisFlags(self.flags)
    }

    /// Acknowledges the message at a subindex and the earlier ones; 0 deletes all.
    pub fn acknowledge(&mut self, sub_index: u8) -> Result<(), AbortCode> {
        if sub_index == 0 {
            *self = History { flags: self.flags & SETTINGS, ..History::default() };
            return Ok(());
        }
        let place = sub_index.checked_sub(DiagnosisHistory::FIRST_MESSAGE).ok_or(AbortCode::VALUE_TOO_LOW)?;
        let newest = self.newest.filter(|_| usize::from(place) < self.incidents.len());
        let newest = newest.ok_or(AbortCode::VALUE_TOO_HIGH)?;
        // The slots wrap around.
        let behind = (newest + MESSAGES - place) % MESSAGES;
        self.unacknowledged = self.unacknowledged.min(behind);
        self.acknowledged = sub_index;
        self.flags &= SETTINGS;
        Ok(())
    }

    /// Sets the flags that may be set.
    pub fn set_flags(&mut self, flags: u16) -> Result<(), AbortCode> {
        if flags & !(SETTINGS | DiagnosisFlags::LOST) != 0 {
            return Err(AbortCode::VALUE_RANGE);
        }
        self.flags = flags & SETTINGS | self.flags & DiagnosisFlags::LOST;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(incidents: usize) -> History {
        let mut history = History::default();
        (0..incidents).for_each(|subdevice| {
            history.note(Instant(subdevice as u64), &Event::Lost { subdevice: SubDeviceId(subdevice) })
        });
        history
    }

    // covers: 6.3, own-objects
    #[test]
    fn a_full_history_overwrites_the_oldest_message_and_sets_the_lost_flag() {
        let mut history = history(50);
        assert_eq!((history.newest(), history.flags().0, history.has_unacknowledged()), (55, 0, true));
        history.note(Instant(50), &Event::Returned { subdevice: SubDeviceId(50) });
        assert_eq!((history.newest(), history.flags().0), (6, DiagnosisFlags::LOST));
        assert_eq!(history.incident(6).map(|incident| incident.subdevice), Some(Some(SubDeviceId(50))));
        assert_eq!(history.incident(7).map(|incident| incident.subdevice), Some(Some(SubDeviceId(1))), "the oldest");
        assert_eq!((history.incident(5), history.incident(56)), (None, None));
    }

    // covers: 6.3
    #[test]
    fn messages_are_acknowledged_by_subindex_and_zero_deletes_all() {
        let mut history = history(10);
        assert_eq!(history.acknowledge(16), Err(AbortCode::VALUE_TOO_HIGH), "no such message");
        assert_eq!(history.acknowledge(5), Err(AbortCode::VALUE_TOO_LOW));
        assert_eq!((history.acknowledge(14), history.acknowledged(), history.has_unacknowledged()), (Ok(()), 14, true));
        assert_eq!((history.acknowledge(15), history.has_unacknowledged()), (Ok(()), false));
        assert_eq!((history.acknowledge(0), history.newest(), history.incident(6)), (Ok(()), 0, None));
    }

    // covers: 6.3
    #[test]
    fn flags_exclude_severities_and_protect_unacknowledged_messages() {
        let mut history = History::default();
        assert_eq!(history.set_flags(DiagnosisFlags::EMERGENCY), Err(AbortCode::VALUE_RANGE));
        assert_eq!(history.set_flags(DiagnosisFlags::NO_INFORMATION | DiagnosisFlags::ACKNOWLEDGE), Ok(()));
        history.note(Instant(0), &Event::Returned { subdevice: SubDeviceId(0) });
        assert_eq!(history.newest(), 0);
        (0..60).for_each(|subdevice| history.note(Instant(1), &Event::Lost { subdevice: SubDeviceId(subdevice) }));
        assert_eq!(
            history.incident(6).map(|incident| incident.subdevice),
            Some(Some(SubDeviceId(0))),
            "not overwritten"
        );
        assert!(history.flags().has(DiagnosisFlags::LOST | DiagnosisFlags::ACKNOWLEDGE));
        assert_eq!((history.acknowledge(55), history.flags().has(DiagnosisFlags::LOST)), (Ok(()), false));
        history.note(Instant(2), &Event::Lost { subdevice: SubDeviceId(99) });
        assert_eq!(history.incident(6).map(|incident| incident.subdevice), Some(Some(SubDeviceId(99))));
    }
}
