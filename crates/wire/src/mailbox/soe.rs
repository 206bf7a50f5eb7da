//! SoE: reading and writing the elements of the IDNs of a drive (protocol 6.6).
//!
//! Converts the payload of a mailbox message of protocol SoE. Data that does not fit into one mailbox is sent in
//! fragments: all but the last are marked incomplete and contain the number of following fragments in place of the IDN.
//! The reader reassembles the fragments.

mod attribute;
mod error;
mod idn;

use super::payload::{FieldWriter, PayloadError, split};

pub use attribute::{IdnAttribute, IdnLength};
pub use error::SoeErrorCode;
pub use idn::Idn;

const INCOMPLETE: u8 = 1 << 3;
const ERROR: u8 = 1 << 4;
const DRIVE_SHIFT: u8 = 5;
const OPERATION: u8 = 0x07;

/// Operation of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SoeOperation {
    /// 1: reads elements.
    ReadRequest,
    /// 2: response to a read.
    ReadResponse,
    /// 3: writes an element.
    WriteRequest,
    /// 4: response to a write.
    WriteResponse,
    /// 5: a procedure command has ended or changed; sent without a request.
    Notification,
    /// 6: emergency; sent without a request.
    Emergency,
    /// 0 and 7 are not defined.
    Other(u8),
}

impl SoeOperation {
    /// From bits 2:0 of the first byte.
    pub const fn from_code(code: u8) -> SoeOperation {
        match code & OPERATION {
            1 => SoeOperation::ReadRequest,
            2 => SoeOperation::ReadResponse,
            3 => SoeOperation::WriteRequest,
            4 => SoeOperation::WriteResponse,
            5 => SoeOperation::Notification,
            6 => SoeOperation::Emergency,
            code => SoeOperation::Other(code),
        }
    }

    /// Bits 2:0 of the first byte.
    pub const fn code(self) -> u8 {
        match self {
            SoeOperation::ReadRequest => 1,
            SoeOperation::ReadResponse => 2,
            SoeOperation::WriteRequest => 3,
            SoeOperation::WriteResponse => 4,
            SoeOperation::Notification => 5,
            SoeOperation::Emergency => 6,
            SoeOperation::Other(code) => code & OPERATION,
        }
    }
}

/// Elements of an IDN; several elements are packed in the order of the bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SoeElements(pub u8);

impl SoeElements {
    /// Bit: data state, 16 bits.
    pub const DATA_STATE: SoeElements = SoeElements(1 << 0);
    /// Bit: name, a string after two length fields.
    pub const NAME: SoeElements = SoeElements(1 << 1);
    /// Bit: [`IdnAttribute`], 32 bits.
    pub const ATTRIBUTE: SoeElements = SoeElements(1 << 2);
    /// Bit: unit, a string after two length fields.
    pub const UNIT: SoeElements = SoeElements(1 << 3);
    /// Bit: smallest value.
    pub const MINIMUM: SoeElements = SoeElements(1 << 4);
    /// Bit: largest value.
    pub const MAXIMUM: SoeElements = SoeElements(1 << 5);
    /// Bit: the value.
    pub const VALUE: SoeElements = SoeElements(1 << 6);
    /// Bit: default value.
    pub const DEFAULT: SoeElements = SoeElements(1 << 7);

    /// Whether all of these bits are set.
    pub const fn has(self, elements: SoeElements) -> bool {
        self.0 & elements.0 == elements.0
    }

    /// The single elements, in the order of their data.
    pub fn iter(self) -> impl Iterator<Item = SoeElements> {
        (0..8).map(|bit| SoeElements(1 << bit)).filter(move |element| self.has(*element))
    }
}

/// One message, complete or a fragment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SoeMessage<'a> {
    /// Operation.
    pub operation: SoeOperation,
    /// Another fragment follows.
    pub incomplete: bool,
    /// The data is an error code.
    pub error: bool,
    /// Drive of the SubDevice, 0..=7.
    pub drive: u8,
    /// Elements.
    pub elements: SoeElements,
    /// The IDN, or the number of following fragments if the message is incomplete.
    pub number: u16,
    /// Data, or a part of it.
    pub data: &'a [u8],
}

impl<'a> SoeMessage<'a> {
    /// Bytes before the data.
    pub const OVERHEAD: usize = 4;

    /// A complete message without an error.
    pub const fn whole(
        operation: SoeOperation,
        drive: u8,
        elements: SoeElements,
        idn: Idn,
        data: &'a [u8],
    ) -> SoeMessage<'a> {
        SoeMessage { operation, incomplete: false, error: false, drive, elements, number: idn.0, data }
    }

    /// Data bytes of each fragment for a mailbox of this size (header included).
    pub const fn max_data(mailbox_size: usize) -> usize {
        mailbox_size.saturating_sub(super::Header::LEN + Self::OVERHEAD)
    }

    /// Decodes a payload; every pattern of the first four bytes is valid.
    pub fn decode(payload: &'a [u8]) -> Result<SoeMessage<'a>, PayloadError> {
        let (&[head, elements, low, high], data) = split(payload, "SoE message")?;
        Ok(SoeMessage {
            operation: SoeOperation::from_code(head),
            incomplete: head & INCOMPLETE != 0,
            error: head & ERROR != 0,
            drive: head >> DRIVE_SHIFT,
            elements: SoeElements(elements),
            number: u16::from_le_bytes([low, high]),
            data,
        })
    }

    /// Encodes a payload and returns its length; `None` if it does not fit `out`. A drive above 7 loses its upper bits.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut head = self.operation.code() | self.drive << DRIVE_SHIFT;
        if self.incomplete {
            head |= INCOMPLETE;
        }
        if self.error {
            head |= ERROR;
        }
        let mut writer = FieldWriter::new(out);
        writer.put(&[head, self.elements.0])?;
        writer.put_u16(self.number)?;
        writer.put(self.data)?;
        Some(writer.length())
    }

    /// The IDN; `None` in a fragment that is not the last one.
    pub const fn idn(&self) -> Option<Idn> {
        if self.incomplete { None } else { Some(Idn(self.number)) }
    }

    /// Number of following fragments.
    pub const fn fragments_left(&self) -> u16 {
        if self.incomplete { self.number } else { 0 }
    }

    /// The error code of a failed request. An error without a code is a general error.
    pub fn error_code(&self) -> Option<SoeErrorCode> {
        let code =
            self.data.first_chunk().map_or(SoeErrorCode::GENERAL, |code| SoeErrorCode(u16::from_le_bytes(*code)));
        self.error.then_some(code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    // covers: 6.6, codec-mailbox
    #[test]
    fn one_vector_for_every_operation() {
        use SoeOperation::*;
        let idn = Idn::standard(0, 15);
        let whole = |operation, drive, elements, data| SoeMessage::whole(operation, drive, elements, idn, data);
        let value = SoeElements::VALUE;
        let vectors: [(SoeMessage<'_>, &[u8]); 8] = [
            (whole(ReadRequest, 1, value, &[]), &[0x21, 0x40, 0x0F, 0x00]),
            (whole(ReadResponse, 0, value, &[7, 0]), &[0x02, 0x40, 0x0F, 0x00, 7, 0]),
            (
                SoeMessage { incomplete: true, number: 2, ..whole(ReadResponse, 7, SoeElements::NAME, b"abc") },
                &[0xEA, 0x02, 0x02, 0x00, b'a', b'b', b'c'],
            ),
            (whole(WriteRequest, 2, value, &[1]), &[0x43, 0x40, 0x0F, 0x00, 1]),
            (whole(WriteResponse, 2, value, &[]), &[0x44, 0x40, 0x0F, 0x00]),
            (
                SoeMessage { error: true, ..whole(WriteResponse, 0, value, &[0x07, 0x70]) },
                &[0x14, 0x40, 0x0F, 0x00, 0x07, 0x70],
            ),
            (whole(Notification, 0, SoeElements(0), &[]), &[0x05, 0x00, 0x0F, 0x00]),
            (whole(Emergency, 0, SoeElements(0), &[1, 2]), &[0x06, 0x00, 0x0F, 0x00, 1, 2]),
        ];
        for (message, bytes) in vectors {
            let mut out = [0xEE; 16];
            let length = message.encode(&mut out).unwrap();
            assert_eq!(&out[..length], bytes, "{message:?}");
            assert_eq!(SoeMessage::decode(bytes), Ok(message));
            assert_eq!(message.encode(&mut out[..length - 1]), None);
        }
    }

    // covers: 6.6, codec-mailbox
    #[test]
    fn a_fragment_has_a_count_in_place_of_the_idn() {
        let last = SoeMessage::decode(&[0x02, 0x40, 0x0F, 0x80]).unwrap();
        assert_eq!((last.idn(), last.fragments_left(), last.error_code()), (Some(Idn(0x800F)), 0, None));
        let more = SoeMessage::decode(&[0x0A, 0x40, 3, 0]).unwrap();
        assert_eq!((more.idn(), more.fragments_left()), (None, 3));
    }

    // covers: 6.6
    #[test]
    fn an_error_has_its_code() {
        let error = SoeMessage::decode(&[0x12, 0x40, 1, 0, 0x01, 0x10]).unwrap();
        assert_eq!(error.error_code(), Some(SoeErrorCode::NO_IDN));
        assert_eq!(SoeMessage::decode(&[0x12, 0x40, 1, 0]).unwrap().error_code(), Some(SoeErrorCode::GENERAL));
    }

    #[test]
    fn elements_follow_each_other_in_the_order_of_their_bits() {
        let elements: Vec<_> = SoeElements(0xC5).iter().collect();
        let expected = [SoeElements::DATA_STATE, SoeElements::ATTRIBUTE, SoeElements::VALUE, SoeElements::DEFAULT];
        assert_eq!(elements, expected);
    }

    #[test]
    fn a_fragment_has_the_mailbox_size_minus_ten_bytes() {
        assert_eq!([128, 10, 3].map(SoeMessage::max_data), [118, 0, 0]);
    }

    proptest! {
        #[test]
        fn any_bytes_never_panic_and_decoded_messages_encode_back(
            bytes in proptest::collection::vec(any::<u8>(), 0..40)
        ) {
            if let Ok(message) = SoeMessage::decode(&bytes) {
                let _ = (message.error_code(), message.idn());
                let mut out = [0; 64];
                let length = message.encode(&mut out).unwrap();
                prop_assert_eq!(&out[..length], &bytes[..]);
            }
        }
    }
}
