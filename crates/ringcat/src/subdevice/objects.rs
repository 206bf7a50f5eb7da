//! CoE: objects of a SubDevice and their descriptions.

use ringcat_engine::mail::coe::history::{self, History};
use ringcat_engine::mail::coe::information::{self, Entry as ObjectEntry, Object};
use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_engine::mail::stream::{Sink, Source};
use ringcat_wire::mailbox::coe::ListType;

use super::{SubDevice, SubDeviceError, SubDeviceFailure};
use crate::services::Services;
use crate::value::ObjectValue;

/// Numbers of objects in the lists of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListLengths([u16; ListType::LISTS.len()]);

impl ListLengths {
    /// Number of objects in a list; `None` for a list that has no length.
    pub fn of(&self, list: ListType) -> Option<u16> {
        let at = ListType::LISTS.iter().position(|other| *other == list)?;
        Some(self.0[at])
    }
}

impl<S: Services> SubDevice<S> {
    /// Reads one entry of an object: a number of exactly its size, bytes, or text.
    ///
    /// It fails if there is no such entry, or if its size differs from that of the type.
    pub fn sdo_read<T: ObjectValue>(self, index: u16, sub_index: u8) -> S::Outcome<T, SubDeviceError> {
        self.read_object(SdoAddress::new(index, sub_index))
    }

    /// Reads all entries of an object at once, from subindex 0 on (complete access).
    pub fn sdo_read_complete(self, index: u16) -> S::Outcome<Vec<u8>, SubDeviceError> {
        self.read_object(SdoAddress::complete(index, 0))
    }

    fn read_object<T: ObjectValue>(self, object: SdoAddress) -> S::Outcome<T, SubDeviceError> {
        let limits = self.limits;
        self.ask_mailbox(move |mailbox| async move {
            let bytes = coe::read(&mailbox, object, limits.of_message(), limits.bytes).await?;
            match T::BYTES.filter(|expected| *expected != bytes.len()) {
                Some(expected) => {
                    Err(SubDeviceFailure::Size { what: format!("SDO {object}"), expected, got: bytes.len() })
                }
                None => Ok(T::decode(bytes)),
            }
        })
    }

    /// Writes one entry of an object.
    pub fn sdo_write<T: ObjectValue>(self, index: u16, sub_index: u8, value: T) -> S::Outcome<(), SubDeviceError> {
        self.write_object(SdoAddress::new(index, sub_index), value.encode())
    }

    /// Writes all entries of an object at once, from subindex 0 on (complete access).
    pub fn sdo_write_complete(self, index: u16, data: Vec<u8>) -> S::Outcome<(), SubDeviceError> {
        self.write_object(SdoAddress::complete(index, 0), data)
    }

    fn write_object(self, object: SdoAddress, data: Vec<u8>) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { coe::write(&mailbox, object, &data, limits).await })
    }

    /// Reads an object of any size into `sink`, piece by piece, and returns the sink. It is called in the thread of the
    /// acyclic half.
    pub fn sdo_read_into<K: Sink + Send + 'static>(
        self,
        object: SdoAddress,
        mut sink: K,
    ) -> S::Outcome<K, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move {
            coe::upload(&mailbox, object, limits, &mut sink).await?;
            Ok::<_, coe::SdoError>(sink)
        })
    }

    /// Writes an object of any size from `source`, piece by piece. It is called in the thread of the acyclic half, and
    /// must have a known length.
    pub fn sdo_write_from(
        self,
        object: SdoAddress,
        mut source: impl Source + Send + 'static,
    ) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { coe::download(&mailbox, object, limits, &mut source).await })
    }

    /// Indices of all objects that the SubDevice has (SDO information), read from it.
    pub fn sdo_info(self) -> S::Outcome<Vec<u16>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_dictionary(move |dictionary| async move { dictionary.list(limits).await })
    }

    /// Indices of the objects in one of the SubDevice's lists.
    pub fn sdo_list(self, list: ListType) -> S::Outcome<Vec<u16>, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { information::list(&mailbox, list, limits).await })
    }

    /// Numbers of objects in the SubDevice's lists.
    pub fn sdo_list_lengths(self) -> S::Outcome<ListLengths, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { information::lengths(&mailbox, limits).await.map(ListLengths) })
    }

    /// The description of an object (SDO information): name, kind, largest subindex. It is read unless a SubDevice of
    /// the same type has returned it before.
    pub fn sdo_object(self, index: u16) -> S::Outcome<Object, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_dictionary(move |dictionary| async move { dictionary.object(index, limits).await })
    }

    /// The description of an entry (SDO information): name, type, access rights, unit, default and range. It is read
    /// unless a SubDevice of the same type has returned it before.
    pub fn sdo_entry(self, index: u16, sub_index: u8) -> S::Outcome<ObjectEntry, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_dictionary(move |dictionary| async move { dictionary.entry((index, sub_index), limits).await })
    }

    /// The diagnosis history (object 0x10F3) with all its messages.
    pub fn diagnosis(self) -> S::Outcome<History, SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { history::read_history(&mailbox, limits).await })
    }

    /// Acknowledges the messages of the diagnosis history up to the one at a subindex; 0 clears the history.
    pub fn acknowledge_diagnosis(self, sub_index: u8) -> S::Outcome<(), SubDeviceError> {
        let limits = self.limits.of_message();
        self.ask_mailbox(move |mailbox| async move { history::acknowledge(&mailbox, sub_index, limits).await })
    }
}
