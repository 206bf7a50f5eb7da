//! FoE: reading and writing files (protocol 6.4).
//!
//! Converts the payload of mailbox messages of protocol FoE. Both ends handle the sequence of messages, packet numbers
//! and the repetition after BUSY.

mod error;

use super::payload::{FieldWriter, PayloadError, split};

pub use error::FoeErrorCode;

const READ: u8 = 1;
const WRITE: u8 = 2;
const DATA: u8 = 3;
const ACKNOWLEDGE: u8 = 4;
const ERROR: u8 = 5;
const BUSY: u8 = 6;

/// A message of the file transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FoeMessage<'a> {
    /// RRQ: requests a file.
    Read {
        /// Password, 0 for none.
        password: u32,
        /// Name of the file.
        name: &'a [u8],
    },
    /// WRQ: requests permission to send a file.
    Write {
        /// Password, 0 for none.
        password: u32,
        /// Name of the file.
        name: &'a [u8],
    },
    /// DATA: a packet of the file. A packet shorter than [`FoeMessage::max_data`] is the last one.
    Data {
        /// Number of the packet, the first is 1.
        packet: u32,
        /// The data of the packet.
        data: &'a [u8],
    },
    /// ACK: acknowledges a packet; packet 0 responds to [`FoeMessage::Write`].
    Acknowledge {
        /// Number of the packet.
        packet: u32,
    },
    /// ERR: the transfer has failed.
    Error {
        /// Error code.
        code: FoeErrorCode,
        /// Error text of the sender.
        text: &'a [u8],
    },
    /// BUSY, sent in place of an acknowledgement or of data: the receiver repeats its last message later.
    Busy {
        /// Progress.
        done: u16,
        /// Progress at the end of the operation.
        entire: u16,
        /// Description of the operation.
        text: &'a [u8],
    },
}

impl<'a> FoeMessage<'a> {
    /// Bytes before name, data or text.
    pub const OVERHEAD: usize = 6;

    /// Data bytes of each packet but the last for a mailbox of this size (header included).
    pub const fn max_data(mailbox_size: usize) -> usize {
        mailbox_size.saturating_sub(super::Header::LEN + Self::OVERHEAD)
    }

    /// Decodes a payload. NUL characters at the end of names and texts are removed.
    pub fn decode(payload: &'a [u8]) -> Result<FoeMessage<'a>, PayloadError> {
        let (&[opcode, _, a, b, c, d], rest) = split(payload, "FoE message")?;
        let number = u32::from_le_bytes([a, b, c, d]);
        Ok(match opcode {
            READ => FoeMessage::Read { password: number, name: text(rest) },
            WRITE => FoeMessage::Write { password: number, name: text(rest) },
            DATA => FoeMessage::Data { packet: number, data: rest },
            ACKNOWLEDGE => FoeMessage::Acknowledge { packet: number },
            ERROR => FoeMessage::Error { code: FoeErrorCode(number), text: text(rest) },
            BUSY => FoeMessage::Busy {
                done: u16::from_le_bytes([a, b]),
                entire: u16::from_le_bytes([c, d]),
                text: text(rest),
            },
            opcode => return Err(PayloadError::Code { what: "FoE opcode", got: opcode.into() }),
        })
    }

    /// Encodes a payload and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let (opcode, number, rest): (u8, u32, &[u8]) = match *self {
            FoeMessage::Read { password, name } => (READ, password, name),
            FoeMessage::Write { password, name } => (WRITE, password, name),
            FoeMessage::Data { packet, data } => (DATA, packet, data),
            FoeMessage::Acknowledge { packet } => (ACKNOWLEDGE, packet, &[]),
            FoeMessage::Error { code, text } => (ERROR, code.0, text),
            FoeMessage::Busy { done, entire, text } => (BUSY, u32::from(done) | u32::from(entire) << 16, text),
        };
        let mut writer = FieldWriter::new(out);
        writer.put(&[opcode, 0])?;
        writer.put_u32(number)?;
        writer.put(rest)?;
        Some(writer.length())
    }
}

/// Without the NUL characters at the end.
fn text(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    &bytes[..end]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    // covers: 6.3, 6.4, codec-mailbox
    #[test]
    fn one_vector_for_every_opcode() {
        let vectors: [(FoeMessage<'_>, &[u8]); 7] = [
            (FoeMessage::Read { password: 0x1234_5678, name: b"log.txt" }, b"\x01\x00\x78\x56\x34\x12log.txt"),
            (FoeMessage::Write { password: 0, name: b"fw.efw" }, b"\x02\x00\x00\x00\x00\x00fw.efw"),
            (FoeMessage::Data { packet: 258, data: &[0xAA, 0] }, b"\x03\x00\x02\x01\x00\x00\xAA\x00"),
            (FoeMessage::Data { packet: 3, data: &[] }, b"\x03\x00\x03\x00\x00\x00"),
            (FoeMessage::Acknowledge { packet: 7 }, b"\x04\x00\x07\x00\x00\x00"),
            (
                FoeMessage::Error { code: FoeErrorCode::NOT_FOUND, text: b"no such file" },
                b"\x05\x00\x01\x80\x00\x00no such file",
            ),
            (FoeMessage::Busy { done: 3, entire: 10, text: b"erasing" }, b"\x06\x00\x03\x00\x0A\x00erasing"),
        ];
        for (message, bytes) in vectors {
            let mut out = [0xEE; 32];
            let length = message.encode(&mut out).unwrap();
            assert_eq!(&out[..length], bytes, "{message:?}");
            assert_eq!(FoeMessage::decode(bytes), Ok(message));
            assert_eq!(message.encode(&mut out[..length - 1]), None);
        }
    }

    #[test]
    fn a_terminating_nul_is_not_part_of_a_name() {
        let name = FoeMessage::decode(b"\x01\x00\x00\x00\x00\x00a\x00b\x00\x00");
        assert_eq!(name, Ok(FoeMessage::Read { password: 0, name: b"a\x00b" }));
    }

    // covers: 6.4, codec-mailbox
    #[test]
    fn a_packet_has_the_mailbox_size_minus_twelve_bytes() {
        assert_eq!([128, 1024, 12, 4].map(FoeMessage::max_data), [116, 1012, 0, 0]);
    }

    #[test]
    fn an_invalid_message_is_refused_with_expected_and_received_value() {
        let error = FoeMessage::decode(&[4, 0, 1, 0, 0]).unwrap_err();
        assert_eq!(error.to_string(), "FoE message too short: expected at least 6 bytes, got 5");
        assert_eq!(FoeMessage::decode(&[7, 0, 0, 0, 0, 0]).unwrap_err().to_string(), "unknown FoE opcode 0x7");
    }

    proptest! {
        #[test]
        fn any_bytes_never_panic_and_decoded_messages_read_back(
            opcode in 0u8..9,
            rest in proptest::collection::vec(any::<u8>(), 0..40),
        ) {
            let mut bytes = std::vec![opcode];
            bytes.extend(rest);
            for length in 0..=bytes.len() {
                if let Ok(message) = FoeMessage::decode(&bytes[..length]) {
                    let mut out = [0; 64];
                    let written = message.encode(&mut out).unwrap();
                    prop_assert_eq!(FoeMessage::decode(&out[..written]), Ok(message));
                }
            }
        }
    }
}
