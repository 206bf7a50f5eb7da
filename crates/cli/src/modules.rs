//! The modules that a device has detected, from the list in its dictionary: they are read within a time limit, and
//! slots that were not read are reported.

use std::ops::RangeInclusive;
use std::time::Duration;

use ringcat::wire::mailbox::sdo::AbortCode;
use ringcat::{Error, SdoFailure, SubDeviceFailure, SubDeviceInfo};

use crate::output::warn;

/// Object with the idents (protocol ES-69): their number, then one for each slot.
pub const DETECTED: u16 = 0xF050;
/// Longest time of all reads of a device: 255 slots at 40 ms, or a few at the limit of one read.
const LIMIT: Duration = Duration::from_secs(10);

/// The modules that a device detects.
#[derive(Debug, Default)]
pub struct Detected {
    /// Their idents by slot, up to the first that was not read.
    pub idents: Vec<u32>,
    /// What was read.
    pub list: List,
}

/// How much of the list was read.
#[derive(Debug, Default, PartialEq, Eq)]
pub enum List {
    /// Nothing: reading was not requested, or the device did not reach PREOP, which is reported.
    #[default]
    Unread,
    /// The device has no such object.
    Missing,
    /// A part of it.
    Partly {
        /// The slots that were not read; `None` if their number is not known.
        unread: Option<RangeInclusive<u8>>,
        /// Reason why they were not read.
        reason: String,
    },
    /// The whole list.
    Whole,
}

/// Why a read failed.
#[derive(Debug)]
pub enum Failed {
    /// The device has answered that the object does not exist.
    NoObject,
    /// No answer, another abort code, or another fault.
    Otherwise(String),
}

impl From<Error> for Failed {
    fn from(error: Error) -> Failed {
        let Error::SubDevice(error) = error else { return Failed::Otherwise(error.to_string()) };
        let is_absent = |code: AbortCode| code == AbortCode::OBJECT_DOES_NOT_EXIST;
        match &error.failure {
            SubDeviceFailure::Sdo(it) if matches!(it.cause, SdoFailure::Aborted(code) if is_absent(code)) => {
                Failed::NoObject
            }
            failure => Failed::Otherwise(failure.to_string()),
        }
    }
}

/// Reads the list. `elapsed` is the time since the reads began; `count` and `ident` read subindex 0 and the ident of a
/// slot within a limit. After the first read that fails no further slot is read.
pub fn detected(
    elapsed: impl Fn() -> Duration,
    count: impl FnOnce(Duration) -> Result<u8, Failed>,
    mut ident: impl FnMut(u8, Duration) -> Result<u32, Failed>,
) -> Detected {
    let count = match count(LIMIT) {
        Ok(count) => count,
        Err(Failed::NoObject) => return Detected { idents: Vec::new(), list: List::Missing },
        Err(Failed::Otherwise(reason)) => return partly(Vec::new(), None, reason),
    };
    let mut idents = Vec::new();
    for slot in 1..=count {
        let left = LIMIT.saturating_sub(elapsed());
        if left.is_zero() {
            let reason = format!("the time limit of {} s has passed", LIMIT.as_secs());
            return partly(idents, Some(slot..=count), reason);
        }
        match ident(slot, left) {
            Ok(ident) => idents.push(ident),
            Err(Failed::Otherwise(reason)) => return partly(idents, Some(slot..=count), reason),
            Err(Failed::NoObject) => {
                let reason = AbortCode::OBJECT_DOES_NOT_EXIST.to_string();
                return partly(idents, Some(slot..=count), reason);
            }
        }
    }
    Detected { idents, list: List::Whole }
}

fn partly(idents: Vec<u32>, unread: Option<RangeInclusive<u8>>, reason: String) -> Detected {
    Detected { idents, list: List::Partly { unread, reason } }
}

impl Detected {
    /// The idents of a list that was read completely.
    pub fn whole(&self) -> Option<&[u32]> {
        (self.list == List::Whole).then_some(&self.idents[..])
    }

    /// Reports the slots that were not read.
    pub fn warn_of(&self, info: &SubDeviceInfo) {
        if let Some(text) = self.unread() {
            let SubDeviceInfo { position, name, .. } = info;
            warn(format!("position {position} \"{name}\": not read: {text}"));
        }
    }

    /// What was not read, and why.
    fn unread(&self) -> Option<String> {
        let List::Partly { unread, reason } = &self.list else { return None };
        let what = match unread.as_ref().map(|slots| (slots.start(), slots.end())) {
            None => "its list of modules (0xF050)".to_owned(),
            Some((first, last)) if first == last => format!("the module in slot {first} (0xF050)"),
            Some((first, last)) => format!("the modules in slots {first} to {last} (0xF050)"),
        };
        Some(format!("{what}: {reason}"))
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// The list of a device whose answers take this time.
    fn read(count: Result<u8, Failed>, answer: Duration) -> (Detected, Duration) {
        let time = Cell::new(Duration::ZERO);
        // As with a mailbox: at its limit a read ends without an answer.
        let wait = |limit: Duration| {
            time.set(time.get() + answer.min(limit));
            if answer < limit { Ok(()) } else { Err(Failed::Otherwise("no answer".to_owned())) }
        };
        let of = |slot: u8, limit| wait(limit).map(|()| u32::from(slot));
        let detected = detected(|| time.get(), |limit| wait(limit).and(count), of);
        (detected, time.get())
    }

    // covers: ES-69
    #[test]
    fn the_reads_of_a_module_list_have_one_limit_and_unread_slots_are_reported() {
        let (all, _) = read(Ok(255), Duration::from_millis(20));
        assert_eq!((all.whole().map(<[u32]>::len), all.unread()), (Some(255), None));
        let (some, time) = read(Ok(255), Duration::from_secs(3));
        assert_eq!((some.idents.clone(), some.whole(), time), (vec![1, 2], None, LIMIT));
        assert_eq!(some.unread().as_deref(), Some("the modules in slots 3 to 255 (0xF050): no answer"));
        let (some, time) = read(Ok(2), Duration::from_secs(5));
        assert_eq!((some.idents.len(), time), (0, LIMIT));
        let (some, time) = read(Ok(255), Duration::from_millis(2_500));
        assert_eq!((some.idents.len(), time), (2, LIMIT));
        let (none, _) = read(Err(Failed::Otherwise("no mailbox".to_owned())), Duration::ZERO);
        assert_eq!(none.unread().as_deref(), Some("its list of modules (0xF050): no mailbox"));
        let (missing, _) = read(Err(Failed::NoObject), Duration::ZERO);
        assert_eq!((missing.list, missing.idents.len()), (List::Missing, 0));
        let (empty, _) = read(Ok(0), Duration::ZERO);
        assert_eq!((empty.whole(), empty.unread()), (Some(&[][..]), None));
    }
}
