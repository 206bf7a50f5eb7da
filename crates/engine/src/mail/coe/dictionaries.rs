//! Object dictionaries that were read before, by type of SubDevice (protocol 6.3, decision 0155).
//!
//! Of one type are SubDevices with the same vendor, product, revision, software version (0x100A) and list of objects.
//! The list is read from a SubDevice once in each session of its mailbox; the descriptions follow from its type. Those
//! that no SubDevice of the type has returned yet are read. Modular SubDevices have no type: their objects depend on
//! the modules.

use alloc::collections::BTreeMap;
use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;

use ringcat_wire::address::StationAddress;
use ringcat_wire::mailbox::coe::{ListType, ValueInfo};
use ringcat_wire::mailbox::sdo::AbortCode;
use ringcat_wire::sii::Identity;

use super::information::{self, Entry, InformationError, Object};
use super::{SdoAddress, SdoFailure, read};
use crate::info::{KnownDictionary, MISSING_BYTES, bytes_of_entry, bytes_of_object};
use crate::mail::{Limits, Mailbox, MailboxError};
use crate::role::Function;
use crate::time::Instant;

/// Types, more than a segment has; beyond this the oldest one is removed.
pub(crate) const MOST_TYPES: usize = 64;
/// Memory of all descriptions. Beyond this further ones are read each time.
pub(crate) const MOST_BYTES: usize = 1 << 20;
/// Object with the software version.
const SOFTWARE_VERSION: u16 = 0x100A;
/// Longest software version.
const MOST_VERSION: usize = 256;
/// First index behind the communication area.
const PROFILE: u16 = 0x2000;
/// Objects with the configured and the detected modules.
const MODULES: [u16; 2] = [0xF030, 0xF050];
/// All optional parts of the description of an entry.
const ALL: ValueInfo = ValueInfo(ValueInfo::UNIT | ValueInfo::DEFAULT | ValueInfo::MINIMUM | ValueInfo::MAXIMUM);

type Shared = Rc<RefCell<KnownDictionary>>;

/// Object dictionaries that were read before; copies share them.
#[derive(Clone, Debug, Default)]
pub struct Dictionaries(Rc<RefCell<Kept>>);

#[derive(Debug, Default)]
struct Kept {
    /// Oldest first.
    all: Vec<Shared>,
    /// By station address: the session whose list was compared, and its dictionary; none if it has no type.
    sessions: BTreeMap<StationAddress, (Instant, Option<Shared>)>,
    bytes: usize,
}

impl Kept {
    /// The dictionary with the same type, or this one; `None` if there is no room.
    fn place(&mut self, dictionary: KnownDictionary) -> Option<Shared> {
        if let Some(known) = self.all.iter().find(|known| known.borrow().is_of_type(&dictionary)) {
            return Some(known.clone());
        }
        if self.bytes + dictionary.bytes() > MOST_BYTES {
            return None;
        }
        if self.all.len() >= MOST_TYPES {
            let oldest = self.all.remove(0);
            self.bytes = self.bytes.saturating_sub(oldest.borrow().bytes());
            self.sessions.retain(|_, (_, known)| known.as_ref().is_none_or(|known| !Rc::ptr_eq(known, &oldest)));
        }
        self.bytes += dictionary.bytes();
        let placed = Rc::new(RefCell::new(dictionary));
        self.all.push(placed.clone());
        Some(placed)
    }

    /// Keeps what `keep` adds, if there is room.
    fn add(&mut self, dictionary: &Shared, bytes: usize, keep: impl FnOnce(&mut KnownDictionary) -> bool) {
        let is_kept = self.all.iter().any(|known| Rc::ptr_eq(known, dictionary));
        if is_kept && self.bytes + bytes <= MOST_BYTES && keep(&mut dictionary.borrow_mut()) {
            self.bytes += bytes;
        }
    }
}

impl Dictionaries {
    /// The dictionary of a SubDevice, by its mailbox. Without its identity nothing is kept.
    pub fn of(&self, mailbox: &Mailbox, identity: Option<Identity>) -> ObjectDictionary {
        ObjectDictionary { kept: self.0.clone(), mailbox: mailbox.clone(), identity }
    }

    /// What another process may go on with.
    pub(crate) fn known(&self) -> Vec<KnownDictionary> {
        self.0.borrow().all.iter().map(|known| known.borrow().clone()).collect()
    }

    /// Dictionaries that another process has read; as many as there is room for.
    pub(crate) fn learn(&self, known: Vec<KnownDictionary>) {
        let mut kept = self.0.borrow_mut();
        for dictionary in known {
            if kept.all.len() < MOST_TYPES {
                kept.place(dictionary);
            }
        }
    }
}

/// The object dictionary of one SubDevice: what is known of its type, and its mailbox for the rest.
#[derive(Clone, Debug)]
pub struct ObjectDictionary {
    kept: Rc<RefCell<Kept>>,
    mailbox: Mailbox,
    identity: Option<Identity>,
}

impl ObjectDictionary {
    /// Indices of all objects, read from the SubDevice.
    ///
    /// # Errors
    /// The mailbox fails, or the SubDevice refuses.
    pub async fn list(&self, limits: Limits) -> Result<Vec<u16>, InformationError> {
        let session = self.mailbox.session();
        let indices = information::list(&self.mailbox, ListType::All, limits).await?;
        if let (Some(session), Some(identity)) = (session, self.identity) {
            self.compare(session, identity, &indices, limits).await;
        }
        Ok(indices)
    }

    /// Description of an object, of its type if it is known.
    ///
    /// # Errors
    /// As [`ObjectDictionary::list`].
    pub async fn object(&self, index: u16, limits: Limits) -> Result<Object, InformationError> {
        let known = self.type_of_session(limits).await?;
        if let Some(object) = known.as_ref().and_then(|known| known.borrow().object(index)) {
            return Ok(object);
        }
        let object = information::object(&self.mailbox, index, limits).await?;
        if let Some(known) = known {
            let bytes = bytes_of_object(&object);
            self.kept.borrow_mut().add(&known, bytes, |known| known.keep_object(object.clone()));
        }
        Ok(object)
    }

    /// Description of an entry with all optional parts that the SubDevice returns, of its type if it is known.
    ///
    /// # Errors
    /// As [`ObjectDictionary::list`].
    pub async fn entry(&self, address: (u16, u8), limits: Limits) -> Result<Entry, InformationError> {
        let known = self.type_of_session(limits).await?;
        if let Some(answer) = known.as_ref().and_then(|known| known.borrow().entry(address)) {
            return answer.ok_or(InformationError::Refused(AbortCode::SUB_INDEX_DOES_NOT_EXIST));
        }
        let answer = information::entry(&self.mailbox, address, ALL, limits).await;
        if let Some(known) = known {
            let mut kept = self.kept.borrow_mut();
            match &answer {
                Ok(entry) => {
                    kept.add(&known, bytes_of_entry(entry), |known| known.keep_entry(entry.clone()));
                }
                // Not for PDO objects: which of their entries exist depends on the current mapping.
                Err(InformationError::Refused(AbortCode::SUB_INDEX_DOES_NOT_EXIST)) if address.0 >= PROFILE => {
                    kept.add(&known, MISSING_BYTES, |known| known.keep_missing(address));
                }
                Err(_) => {}
            }
        }
        answer
    }

    /// Reads what is not known yet of the type of the SubDevice.
    ///
    /// # Errors
    /// As [`ObjectDictionary::list`].
    pub(crate) async fn complete(&self, limits: Limits) -> Result<(), InformationError> {
        let indices = self.list(limits).await?;
        let session = self.mailbox.session();
        let Some(known) = self.compared() else { return Ok(()) };
        if known.borrow().is_complete {
            return Ok(());
        }
        for index in indices {
            let object = match self.object(index, limits).await {
                Ok(object) => object,
                Err(InformationError::Refused(_)) => continue,
                Err(error) => return Err(error),
            };
            for sub_index in 0..=object.max_sub_index {
                match self.entry((index, sub_index), limits).await {
                    Ok(_) | Err(InformationError::Refused(_)) => {}
                    Err(error) => return Err(error),
                }
            }
        }
        if session.is_some() && self.mailbox.session() == session {
            known.borrow_mut().is_complete = true;
        }
        Ok(())
    }

    /// The dictionary of its type, if its list was compared in this session.
    fn compared(&self) -> Option<Shared> {
        let (station, since) = self.mailbox.session()?;
        let kept = self.kept.borrow();
        let (compared, known) = kept.sessions.get(&station)?;
        known.clone().filter(|_| *compared == since)
    }

    /// The same; the list is compared now if it was not yet, and dictionaries of such a SubDevice are known.
    async fn type_of_session(&self, limits: Limits) -> Result<Option<Shared>, InformationError> {
        // An answer without mail is refused in the same roles.
        self.mailbox.bus().permit(Function::ObjectDictionary).map_err(MailboxError::from)?;
        let (Some((station, since)), Some(identity)) = (self.mailbox.session(), self.identity) else { return Ok(None) };
        let is_open = {
            let kept = self.kept.borrow();
            let is_compared = kept.sessions.get(&station).is_some_and(|(compared, _)| *compared == since);
            !is_compared && kept.all.iter().any(|known| known.borrow().is_of(&identity))
        };
        if is_open {
            // Without a list the description itself is read.
            let _ = self.list(limits).await;
        }
        Ok(self.compared())
    }

    /// Finds the type of the SubDevice by its list.
    async fn compare(&self, session: (StationAddress, Instant), identity: Identity, indices: &[u16], limits: Limits) {
        let (station, since) = session;
        if self.compared().is_some_and(|known| known.borrow().indices == indices) {
            return;
        }
        let has_own = !identity.names_a_type() || MODULES.iter().any(|index| indices.contains(index));
        let dictionary = if has_own {
            None
        } else {
            let Ok(version) = self.version(indices, limits).await else { return };
            Some(KnownDictionary::new(&identity, version, indices))
        };
        // It may have restarted meanwhile.
        if self.mailbox.session() == Some(session) {
            let mut kept = self.kept.borrow_mut();
            let known = dictionary.and_then(|dictionary| kept.place(dictionary));
            kept.sessions.insert(station, (since, known));
        }
    }

    /// The software version; `Ok(None)` if the SubDevice has none.
    async fn version(&self, indices: &[u16], limits: Limits) -> Result<Option<Vec<u8>>, ()> {
        if !indices.contains(&SOFTWARE_VERSION) {
            return Ok(None);
        }
        let before = self.mailbox.last_protocol_error();
        match read(&self.mailbox, SdoAddress::new(SOFTWARE_VERSION, 0), limits, MOST_VERSION).await {
            Ok(version) => Ok(Some(version)),
            Err(error) if matches!(error.cause, SdoFailure::Aborted(_)) => {
                // This read is not one of the application, whose last error must stay.
                self.mailbox.forget_protocol_error(before);
                Ok(None)
            }
            Err(_) => Err(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::String;
    use alloc::vec;

    use ringcat_wire::mailbox::coe::{DataType, ObjectCode};

    use super::*;

    fn of_type(number: u32) -> KnownDictionary {
        KnownDictionary::new(&Identity { product_code: number, ..Identity::default() }, None, &[0x1000])
    }

    fn object(index: u16, name: usize) -> Object {
        let name: String = vec!['x'; name].into_iter().collect();
        Object { index, data_type: DataType(7), max_sub_index: 0, code: ObjectCode::Variable, name }
    }

    #[test]
    fn the_oldest_type_makes_room_for_another_one() {
        let mut kept = Kept::default();
        for number in 0..2 * MOST_TYPES as u32 {
            let placed = kept.place(of_type(number));
            assert!(placed.is_some());
            kept.sessions.insert(StationAddress(number as u16), (Instant(0), placed));
        }
        assert_eq!((kept.all.len(), kept.sessions.len()), (MOST_TYPES, MOST_TYPES));
        assert_eq!(kept.bytes, kept.all.iter().map(|known| known.borrow().bytes()).sum::<usize>());
        let before = kept.bytes;
        kept.place(of_type(MOST_TYPES as u32));
        assert_eq!((kept.all.len(), kept.bytes), (MOST_TYPES, before), "it is there");
    }

    #[test]
    fn memory_is_bounded_and_counted_once() {
        let mut kept = Kept::default();
        let known = kept.place(of_type(1)).expect("there is room");
        for index in 0..2_000u16 {
            let object = object(index, 1_000);
            let bytes = bytes_of_object(&object);
            for _ in 0..2 {
                kept.add(&known, bytes, |known| known.keep_object(object.clone()));
            }
        }
        assert!(kept.bytes <= MOST_BYTES && kept.bytes > MOST_BYTES - 2_000, "{}", kept.bytes);
        assert_eq!(kept.bytes, known.borrow().bytes());
        assert!(kept.place(of_type(1)).is_some(), "it is there");
        let dictionaries = Dictionaries::default();
        let [first, second] = [1, 2].map(|number| {
            let full = known.borrow().clone();
            KnownDictionary { product_code: number, ..full }
        });
        dictionaries.learn(vec![first, second]);
        assert_eq!(dictionaries.known().len(), 1, "there is no room for the second");
    }
}
