//! The diagnosis history, object 0x10F3 (named in protocol 6.3; layout of ETG.1020).
//!
//! Subindex 1 is the maximum number of stored messages, 2 the subindex of the newest message, 3 the subindex of the
//! newest acknowledged message, 4 whether there are new messages, 5 flags. The messages start at subindex 6: octet
//! strings that [`DiagnosisMessage`] reads and writes.

use crate::mailbox::payload::{FieldWriter, PayloadError, split};

/// Index and subindices of object 0x10F3.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DiagnosisHistory;

impl DiagnosisHistory {
    /// Index of the object.
    pub const INDEX: u16 = 0x10F3;
    /// Subindex: maximum number of stored messages (u8).
    pub const MAXIMUM_MESSAGES: u8 = 1;
    /// Subindex: subindex of the newest message, 0 for none (u8).
    pub const NEWEST_MESSAGE: u8 = 2;
    /// Subindex: subindex of the newest acknowledged message; written by the MainDevice, 0 clears the history (u8).
    pub const NEWEST_ACKNOWLEDGED: u8 = 3;
    /// Subindex: whether there are unacknowledged messages (bool).
    pub const NEW_AVAILABLE: u8 = 4;
    /// Subindex: [`DiagnosisFlags`] (u16).
    pub const FLAGS: u8 = 5;
    /// Subindex of the first message.
    pub const FIRST_MESSAGE: u8 = 6;
}

/// Settings of the history.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DiagnosisFlags(pub u16);

impl DiagnosisFlags {
    /// Bit: each message is also sent as an emergency.
    pub const EMERGENCY: u16 = 1 << 0;
    /// Bit: information is not stored.
    pub const NO_INFORMATION: u16 = 1 << 1;
    /// Bit: warnings are not stored.
    pub const NO_WARNINGS: u16 = 1 << 2;
    /// Bit: errors are not stored.
    pub const NO_ERRORS: u16 = 1 << 3;
    /// Bit: a full history keeps unacknowledged messages; without it the oldest message is overwritten.
    pub const ACKNOWLEDGE: u16 = 1 << 4;
    /// Bit: a message was lost: overwritten before its acknowledgement, or not stored.
    pub const LOST: u16 = 1 << 5;

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }
}

/// Severity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DiagnosisKind {
    /// Code 0.
    Information,
    /// Code 1.
    Warning,
    /// Code 2.
    Error,
    /// Any other code.
    Other(u8),
}

impl DiagnosisKind {
    /// From bits 3:0 of the flags.
    pub const fn from_code(code: u8) -> DiagnosisKind {
        match code {
            0 => DiagnosisKind::Information,
            1 => DiagnosisKind::Warning,
            2 => DiagnosisKind::Error,
            code => DiagnosisKind::Other(code),
        }
    }

    /// Bits 3:0 of the flags.
    pub const fn code(self) -> u8 {
        match self {
            DiagnosisKind::Information => 0,
            DiagnosisKind::Warning => 1,
            DiagnosisKind::Error => 2,
            DiagnosisKind::Other(code) => code & 0x0F,
        }
    }
}

/// One message of the history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagnosisMessage<'a> {
    /// Diagnosis code: the lower half is 0xE800 if the upper half is a code of the vendor.
    pub code: u32,
    /// Severity.
    pub kind: DiagnosisKind,
    /// The time stamp is from the local clock of the SubDevice, not from a global clock.
    pub local_time: bool,
    /// Bits 7:5 of the flags, reserved.
    pub reserved: u8,
    /// Text id of the device description (ESI), 0 for none.
    pub text: u16,
    /// Time in nanoseconds, 0 if the SubDevice has no clock.
    pub time_ns: u64,
    /// Number of parameters.
    pub parameter_count: u8,
    /// The encoded parameters.
    pub parameters: &'a [u8],
}

impl<'a> DiagnosisMessage<'a> {
    /// Bytes before the parameters.
    pub const OVERHEAD: usize = 16;
    /// Lower half of a diagnosis code of the vendor.
    pub const VENDOR_CODE: u16 = 0xE800;

    /// Decodes one message.
    pub fn decode(bytes: &'a [u8]) -> Result<DiagnosisMessage<'a>, PayloadError> {
        let (b, parameters) = split::<16>(bytes, "diagnosis message")?;
        Ok(DiagnosisMessage {
            code: u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            kind: DiagnosisKind::from_code(b[4] & 0x0F),
            local_time: b[4] & 0x10 != 0,
            reserved: b[4] >> 5,
            parameter_count: b[5],
            text: u16::from_le_bytes([b[6], b[7]]),
            time_ns: u64::from_le_bytes([b[8], b[9], b[10], b[11], b[12], b[13], b[14], b[15]]),
            parameters,
        })
    }

    /// Encodes one message and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        writer.put_u32(self.code)?;
        let flags = self.kind.code() | u8::from(self.local_time) << 4 | self.reserved << 5;
        writer.put(&[flags, self.parameter_count])?;
        writer.put_u16(self.text)?;
        writer.put(&self.time_ns.to_le_bytes())?;
        writer.put(self.parameters)?;
        Some(writer.length())
    }

    /// The parameters one by one; ends at the first truncated parameter.
    pub const fn parameters(&self) -> DiagnosisParameters<'a> {
        DiagnosisParameters { rest: self.parameters, left: self.parameter_count }
    }
}

/// One parameter of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiagnosisParameter<'a> {
    /// A value of this CoE data type.
    Value(super::DataType, &'a [u8]),
    /// Bytes.
    Bytes(&'a [u8]),
    /// ASCII text.
    Ascii(&'a [u8]),
    /// UTF-16 text, little-endian.
    Unicode(&'a [u8]),
    /// Text id of the device description.
    Text(u16),
}

impl DiagnosisParameter<'_> {
    /// Encodes the parameter and returns its length; `None` if it does not fit `out`, is longer than 4,095 bytes, or is
    /// a value without the length of its type.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        let length = |data: &[u8]| u16::try_from(data.len()).ok().filter(|length| *length <= MAX_LENGTH);
        match *self {
            DiagnosisParameter::Value(data_type, data) => {
                if value_length(data_type)? != data.len() || data_type.0 > MAX_LENGTH {
                    return None;
                }
                writer.put_u16(data_type.0)?;
                writer.put(data)?;
            }
            DiagnosisParameter::Bytes(data) => {
                writer.put_u16(1 << KIND_SHIFT | length(data)?)?;
                writer.put(data)?;
            }
            DiagnosisParameter::Ascii(data) => {
                writer.put_u16(2 << KIND_SHIFT | length(data)?)?;
                writer.put(data)?;
            }
            DiagnosisParameter::Unicode(data) => {
                writer.put_u16(3 << KIND_SHIFT | length(data)?)?;
                writer.put(data)?;
            }
            DiagnosisParameter::Text(text) => {
                writer.put_u16(4 << KIND_SHIFT)?;
                writer.put_u16(text)?;
            }
        }
        Some(writer.length())
    }
}

const KIND_SHIFT: u16 = 12;
const MAX_LENGTH: u16 = 0x0FFF;

fn value_length(data_type: super::DataType) -> Option<usize> {
    data_type.bits().map(|bits| usize::from(bits).div_ceil(8))
}

/// Reads the parameters of a message one by one.
#[derive(Clone, Debug)]
pub struct DiagnosisParameters<'a> {
    rest: &'a [u8],
    left: u8,
}

impl<'a> DiagnosisParameters<'a> {
    fn read(&mut self) -> Option<DiagnosisParameter<'a>> {
        let (head, rest) = self.rest.split_first_chunk()?;
        let head = u16::from_le_bytes(*head);
        let detail = head & MAX_LENGTH;
        let (kind, length) = (head >> KIND_SHIFT, usize::from(detail));
        let data_type = super::DataType(detail);
        let (data, rest) = rest.split_at_checked(match kind {
            0 => value_length(data_type)?,
            1..=3 => length,
            4 => 2,
            _ => return None,
        })?;
        self.rest = rest;
        Some(match kind {
            0 => DiagnosisParameter::Value(data_type, data),
            1 => DiagnosisParameter::Bytes(data),
            2 => DiagnosisParameter::Ascii(data),
            3 => DiagnosisParameter::Unicode(data),
            _ => DiagnosisParameter::Text(u16::from_le_bytes(*data.first_chunk()?)),
        })
    }
}

impl<'a> Iterator for DiagnosisParameters<'a> {
    type Item = DiagnosisParameter<'a>;

    fn next(&mut self) -> Option<DiagnosisParameter<'a>> {
        self.left = self.left.checked_sub(1)?;
        let parameter = self.read();
        if parameter.is_none() {
            self.left = 0;
        }
        parameter
    }
}

#[cfg(test)]
mod tests {
    use super::super::DataType;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const MESSAGE: &[u8] = b"\x00\xE8\x34\x12\x12\x03\x07\x00\x08\x07\x06\x05\x04\x03\x02\x01\
        \x06\x00\xAD\xDE\x02\x20Ok\x00\x40\x09\x00";

    // covers: 6.3, codec-mailbox
    #[test]
    fn a_message_with_parameters_has_the_expected_bytes() {
        let message = DiagnosisMessage::decode(MESSAGE).unwrap();
        assert_eq!(message.code, 0x1234_0000 | u32::from(DiagnosisMessage::VENDOR_CODE));
        assert_eq!((message.kind, message.local_time, message.text), (DiagnosisKind::Error, true, 7));
        assert_eq!(message.time_ns, 0x0102_0304_0506_0708);
        let expected = [
            DiagnosisParameter::Value(DataType::UNSIGNED16, &[0xAD, 0xDE]),
            DiagnosisParameter::Ascii(b"Ok"),
            DiagnosisParameter::Text(9),
        ];
        assert_eq!(message.parameters().collect::<Vec<_>>(), expected);
        let (mut written, mut out) = (Vec::new(), [0; 16]);
        for parameter in expected {
            let length = parameter.encode(&mut out).unwrap();
            written.extend_from_slice(&out[..length]);
        }
        assert_eq!(written, message.parameters);
    }

    // covers: codec-mailbox
    #[test]
    fn parameters_end_at_a_truncated_parameter() {
        let message = DiagnosisMessage::decode(&MESSAGE[..23]).unwrap();
        assert_eq!(message.parameters().count(), 1);
        let short = PayloadError::Short { what: "diagnosis message", expected: 16, got: 15 };
        assert_eq!(DiagnosisMessage::decode(&MESSAGE[..15]), Err(short));
        let mut out = [0; 8];
        assert_eq!(DiagnosisParameter::Value(DataType::UNSIGNED16, &[1]).encode(&mut out), None);
        assert_eq!(DiagnosisParameter::Value(DataType::VISIBLE_STRING, &[1]).encode(&mut out), None);
    }

    proptest! {
        #[test]
        fn any_bytes_never_panic_and_decoded_messages_encode_back(
            bytes in proptest::collection::vec(any::<u8>(), 0..64)
        ) {
            if let Ok(message) = DiagnosisMessage::decode(&bytes) {
                let mut out = [0; 64];
                let length = message.encode(&mut out).unwrap();
                prop_assert_eq!(&out[..length], &bytes[..]);
                let mut at = 0;
                for parameter in message.parameters() {
                    let length = parameter.encode(&mut out).unwrap();
                    if let DiagnosisParameter::Text(_) = parameter {
                        prop_assert_eq!(out[2..4].as_ref(), &message.parameters[at + 2..at + 4]);
                    } else {
                        prop_assert_eq!(&out[..length], &message.parameters[at..at + length]);
                    }
                    at += length;
                }
            }
        }
    }
}
