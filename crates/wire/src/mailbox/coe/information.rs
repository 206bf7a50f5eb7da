//! SDO information: the lists of objects of a SubDevice, one object, one entry, errors, in fragments (protocol 6.3).
//!
//! Converts the payload of a mailbox message of protocol CoE. Data that does not fit into one mailbox is sent in
//! fragments: all but the last are marked incomplete, and each contains the number of following fragments. Only the
//! first begins with list type or index. The reader reassembles the fragments. [`ListType`] and [`Indices`],
//! [`ObjectDescription`](super::ObjectDescription) and [`EntryDescription`](super::EntryDescription) read reassembled
//! data.

use core::fmt;

use super::{CoeHeader, CoeService};
use crate::bytes::{u16_at, u32_at};
use crate::mailbox::payload::{FieldWriter, PayloadError, split};
use crate::mailbox::sdo::AbortCode;

const INCOMPLETE: u8 = 0x80;

/// Opcode of an SDO information message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InformationOpcode {
    /// 1: list request; data is the [`ListType`].
    ListRequest,
    /// 2: list response; data is the [`ListType`], then [`Indices`] or five counts.
    ListResponse,
    /// 3: object request; data is the index.
    ObjectRequest,
    /// 4: [`ObjectDescription`](super::ObjectDescription).
    ObjectResponse,
    /// 5: entry request; data is index, subindex, [`ValueInfo`](super::ValueInfo).
    EntryRequest,
    /// 6: [`EntryDescription`](super::EntryDescription).
    EntryResponse,
    /// 7: [`AbortCode`].
    Error,
    /// Any other code.
    Other(u8),
}

impl InformationOpcode {
    /// From bits 6:0 of the opcode byte.
    pub const fn from_code(code: u8) -> InformationOpcode {
        match code & !INCOMPLETE {
            1 => InformationOpcode::ListRequest,
            2 => InformationOpcode::ListResponse,
            3 => InformationOpcode::ObjectRequest,
            4 => InformationOpcode::ObjectResponse,
            5 => InformationOpcode::EntryRequest,
            6 => InformationOpcode::EntryResponse,
            7 => InformationOpcode::Error,
            code => InformationOpcode::Other(code),
        }
    }

    /// Bits 6:0 of the opcode byte.
    pub const fn code(self) -> u8 {
        match self {
            InformationOpcode::ListRequest => 1,
            InformationOpcode::ListResponse => 2,
            InformationOpcode::ObjectRequest => 3,
            InformationOpcode::ObjectResponse => 4,
            InformationOpcode::EntryRequest => 5,
            InformationOpcode::EntryResponse => 6,
            InformationOpcode::Error => 7,
            InformationOpcode::Other(code) => code & !INCOMPLETE,
        }
    }
}

/// An object list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ListType {
    /// 0: no objects, but the lengths of the five lists, in the order of their codes.
    Lengths,
    /// 1: all objects.
    All,
    /// 2: objects that can be mapped to an RxPDO.
    RxMappable,
    /// 3: objects that can be mapped to a TxPDO.
    TxMappable,
    /// 4: objects that are stored for the replacement of a device.
    Backup,
    /// 5: start-up parameters.
    Settings,
    /// Any other code.
    Other(u16),
}

impl ListType {
    /// The five lists, in the order of their codes.
    pub const LISTS: [ListType; 5] =
        [ListType::All, ListType::RxMappable, ListType::TxMappable, ListType::Backup, ListType::Settings];

    /// From the code.
    pub const fn from_code(code: u16) -> ListType {
        match code {
            0 => ListType::Lengths,
            1 => ListType::All,
            2 => ListType::RxMappable,
            3 => ListType::TxMappable,
            4 => ListType::Backup,
            5 => ListType::Settings,
            code => ListType::Other(code),
        }
    }

    /// The code.
    pub const fn code(self) -> u16 {
        match self {
            ListType::Lengths => 0,
            ListType::All => 1,
            ListType::RxMappable => 2,
            ListType::TxMappable => 3,
            ListType::Backup => 4,
            ListType::Settings => 5,
            ListType::Other(code) => code,
        }
    }
}

impl fmt::Display for ListType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            ListType::Lengths => "lengths of the lists",
            ListType::All => "all objects",
            ListType::RxMappable => "objects for RxPDOs",
            ListType::TxMappable => "objects for TxPDOs",
            ListType::Backup => "objects to be stored",
            ListType::Settings => "start-up parameters",
            ListType::Other(code) => return write!(f, "object list {code}"),
        })
    }
}

/// The 16-bit numbers of a list; a trailing odd byte is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Indices<'a>(pub &'a [u8]);

impl Indices<'_> {
    /// The numbers.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = u16> + '_ {
        self.0.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
    }
}

/// One message, complete or a fragment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoInformation<'a> {
    /// Opcode.
    pub opcode: InformationOpcode,
    /// Number of following fragments; 0 in the last fragment and in a complete message.
    pub fragments_left: u16,
    /// The data, or a part of it.
    pub data: &'a [u8],
    /// Another fragment follows.
    pub incomplete: bool,
}

impl<'a> SdoInformation<'a> {
    /// Bytes before the data, including the CoE header.
    pub const OVERHEAD: usize = 6;

    /// A complete message.
    pub const fn whole(opcode: InformationOpcode, data: &'a [u8]) -> SdoInformation<'a> {
        SdoInformation { opcode, fragments_left: 0, data, incomplete: false }
    }

    /// Decodes the payload of a CoE message.
    pub fn decode(payload: &'a [u8]) -> Result<SdoInformation<'a>, PayloadError> {
        let (head, data) = split::<6>(payload, "SDO information message")?;
        let [low, high, opcode, _, left_low, left_high] = *head;
        let service = CoeHeader::decode(&[low, high]).service;
        if service != CoeService::SdoInformation {
            return Err(PayloadError::Service { expected: CoeService::SdoInformation, got: service });
        }
        Ok(SdoInformation {
            opcode: InformationOpcode::from_code(opcode),
            fragments_left: u16::from_le_bytes([left_low, left_high]),
            data,
            incomplete: opcode & INCOMPLETE != 0,
        })
    }

    /// Encodes the payload of a CoE message and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        writer.put(&CoeHeader::new(CoeService::SdoInformation).encode())?;
        writer.put(&[self.opcode.code() | if self.incomplete { INCOMPLETE } else { 0 }, 0])?;
        writer.put_u16(self.fragments_left)?;
        writer.put(self.data)?;
        Some(writer.length())
    }

    /// The list type at the start of reassembled data or of a first fragment, and the numbers that follow.
    pub fn list(&self) -> Result<(ListType, Indices<'a>), PayloadError> {
        let (code, rest) = split::<2>(self.data, "object list")?;
        Ok((ListType::from_code(u16::from_le_bytes(*code)), Indices(rest)))
    }

    /// The index in an object request.
    pub fn object(&self) -> Result<u16, PayloadError> {
        u16_at(self.data, 0).ok_or(PayloadError::Short { what: "object request", expected: 2, got: self.data.len() })
    }

    /// The reason for which the request failed.
    pub fn abort_code(&self) -> Result<AbortCode, PayloadError> {
        let short = PayloadError::Short { what: "SDO information error", expected: 4, got: self.data.len() };
        u32_at(self.data, 0).map(AbortCode).ok_or(short)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;
    use std::vec::Vec;

    // covers: 6.3, 6.4, codec-mailbox
    #[test]
    fn one_vector_for_every_opcode() {
        use InformationOpcode::*;
        let vectors: [(SdoInformation<'_>, &[u8]); 8] = [
            (SdoInformation::whole(ListRequest, &[1, 0]), &[0, 0x80, 1, 0, 0, 0, 1, 0]),
            (
                SdoInformation {
                    opcode: ListResponse,
                    fragments_left: 3,
                    data: &[1, 0, 0x00, 0x10, 0x18, 0x10],
                    incomplete: true,
                },
                &[0, 0x80, 0x82, 0, 3, 0, 1, 0, 0x00, 0x10, 0x18, 0x10],
            ),
            (SdoInformation::whole(ObjectRequest, &[0x18, 0x10]), &[0, 0x80, 3, 0, 0, 0, 0x18, 0x10]),
            (SdoInformation::whole(ObjectResponse, &[0x18, 0x10]), &[0, 0x80, 4, 0, 0, 0, 0x18, 0x10]),
            (SdoInformation::whole(EntryRequest, &[0x18, 0x10, 1, 7]), &[0, 0x80, 5, 0, 0, 0, 0x18, 0x10, 1, 7]),
            (SdoInformation::whole(EntryResponse, &[]), &[0, 0x80, 6, 0, 0, 0]),
            (SdoInformation::whole(Error, &[0, 0, 2, 6]), &[0, 0x80, 7, 0, 0, 0, 0, 0, 2, 6]),
            (SdoInformation::whole(Other(0x7F), &[9]), &[0, 0x80, 0x7F, 0, 0, 0, 9]),
        ];
        for (message, bytes) in vectors {
            let mut out = [0xEE; 32];
            let length = message.encode(&mut out).unwrap();
            assert_eq!(&out[..length], bytes);
            assert_eq!(SdoInformation::decode(bytes), Ok(message));
            assert_eq!(message.encode(&mut out[..length - 1]), None);
        }
    }

    #[test]
    fn the_data_of_each_opcode_is_decoded() {
        use InformationOpcode::*;
        let (list, indices) = SdoInformation::whole(ListResponse, &[2, 0, 0x10, 0x60, 0x20, 0x60, 9]).list().unwrap();
        assert_eq!((list, indices.iter().collect::<Vec<_>>()), (ListType::RxMappable, std::vec![0x6010, 0x6020]));
        assert_eq!(SdoInformation::whole(ObjectRequest, &[0x18, 0x10]).object(), Ok(0x1018));
        let error = SdoInformation::whole(Error, &[0, 0, 2, 6]);
        assert_eq!(error.abort_code(), Ok(AbortCode::OBJECT_DOES_NOT_EXIST));
        let short = SdoInformation::whole(Error, &[0]);
        let text = short.abort_code().unwrap_err().to_string();
        assert_eq!(text, "SDO information error too short: expected at least 4 bytes, got 1");
        assert!(short.list().is_err() && short.object().is_err());
    }

    #[test]
    fn another_service_is_refused_with_expected_and_received_service() {
        let error = SdoInformation::decode(&[0, 0x20, 1, 0, 0, 0]).unwrap_err();
        assert_eq!(error.to_string(), "expected SDO information, got SDO request");
        let short = PayloadError::Short { what: "SDO information message", expected: 6, got: 5 };
        assert_eq!(SdoInformation::decode(&[0, 0x80, 1, 0, 0]), Err(short));
    }

    // covers: 6.3
    #[test]
    fn list_types_have_their_codes() {
        for code in 0..=5 {
            assert_eq!(ListType::from_code(code).code(), code);
            assert_ne!(ListType::from_code(code), ListType::Other(code));
        }
        assert_eq!(ListType::LISTS.map(ListType::code), [1, 2, 3, 4, 5]);
        assert_eq!(ListType::Other(9).to_string(), "object list 9");
    }

    proptest! {
        #[test]
        fn any_bytes_never_panic_and_decoded_messages_read_back(
            rest in proptest::collection::vec(any::<u8>(), 0..40),
        ) {
            let mut bytes = std::vec![0, 0x80];
            bytes.extend(rest);
            for length in 0..=bytes.len() {
                if let Ok(message) = SdoInformation::decode(&bytes[..length]) {
                    let _ = (message.list(), message.object(), message.abort_code());
                    let mut out = [0; 64];
                    let written = message.encode(&mut out).unwrap();
                    prop_assert_eq!(SdoInformation::decode(&out[..written]), Ok(message));
                }
            }
        }
    }
}
