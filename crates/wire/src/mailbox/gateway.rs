//! The mailbox gateway: mailbox messages in UDP and TCP (protocol 10.1, ETG.8200).
//!
//! Converts the messages of a client: an EtherCAT header of type 5 and one mailbox message. In a stream, messages
//! follow one another; [`frame_length`] returns the length of a message. The gateway handles access rights.

use core::fmt;

use super::{Header, Message, MessageError};

/// Port of UDP and TCP.
pub const PORT: u16 = 0x88A4;
/// EtherCAT type of a mailbox message.
pub const ETHERCAT_TYPE: u8 = 5;
/// Bytes of the EtherCAT header.
pub const HEADER_LEN: usize = 2;
/// Maximum number of bytes after the EtherCAT header.
pub const MAX_LENGTH: usize = 0x07FF;

const TYPE_SHIFT: u16 = 12;

/// The reason for which bytes are no mailbox message for a gateway.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GatewayError {
    /// Shorter than the EtherCAT header.
    Short {
        /// Bytes available.
        got: usize,
    },
    /// The EtherCAT header has another type.
    Type {
        /// The type.
        got: u8,
    },
    /// The length in the EtherCAT header differs from the available bytes or from the length of the mailbox message.
    Length {
        /// Length in the EtherCAT header.
        announced: usize,
        /// Bytes after the header, or of the mailbox message.
        got: usize,
    },
    /// The mailbox message is malformed.
    Message(MessageError),
}

impl fmt::Display for GatewayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            GatewayError::Short { got } => write!(f, "gateway message too short: expected 2 bytes, got {got}"),
            GatewayError::Type { got } => write!(f, "expected EtherCAT type 5, got {got}"),
            GatewayError::Length { announced, got } => {
                write!(f, "EtherCAT header announces {announced} bytes, got {got}")
            }
            GatewayError::Message(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for GatewayError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            GatewayError::Message(error) => Some(error),
            _ => None,
        }
    }
}

/// Bytes of a whole message, including the EtherCAT header, from its first two bytes; an error if the type is not 5.
pub const fn frame_length(header: [u8; HEADER_LEN]) -> Result<usize, GatewayError> {
    let word = u16::from_le_bytes(header);
    let kind = (word >> TYPE_SHIFT) as u8;
    if kind != ETHERCAT_TYPE {
        return Err(GatewayError::Type { got: kind });
    }
    Ok(HEADER_LEN + (word as usize & MAX_LENGTH))
}

/// Reads a message. Bytes after the length in the EtherCAT header are padding.
pub fn decode(bytes: &[u8]) -> Result<Message<'_>, GatewayError> {
    let (header, rest) = bytes.split_first_chunk().ok_or(GatewayError::Short { got: bytes.len() })?;
    let announced = frame_length(*header)? - HEADER_LEN;
    let content = rest.get(..announced).ok_or(GatewayError::Length { announced, got: rest.len() })?;
    let message = Message::decode(content).map_err(GatewayError::Message)?;
    let got = Header::LEN + message.payload.len();
    if got == announced { Ok(message) } else { Err(GatewayError::Length { announced, got }) }
}

/// Writes a message and returns its length; `None` if it does not fit `out`, exceeds the length field, or differs from
/// the length in its own header.
pub fn encode(message: &Message<'_>, out: &mut [u8]) -> Option<usize> {
    let length = Header::LEN + message.payload.len();
    if length > MAX_LENGTH || usize::from(message.header.length) != message.payload.len() {
        return None;
    }
    let out = out.get_mut(..HEADER_LEN + length)?;
    let word = length as u16 | u16::from(ETHERCAT_TYPE) << TYPE_SHIFT;
    out[..HEADER_LEN].copy_from_slice(&word.to_le_bytes());
    out[HEADER_LEN..HEADER_LEN + Header::LEN].copy_from_slice(&message.header.encode());
    out[HEADER_LEN + Header::LEN..].copy_from_slice(message.payload);
    Some(HEADER_LEN + length)
}

#[cfg(test)]
mod tests {
    use super::super::Protocol;
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    const BYTES: &[u8] = &[0x08, 0x50, 0x02, 0x00, 0xE9, 0x03, 0x00, 0x23, 0xAA, 0xBB];

    // covers: 10.1, codec-mailbox
    #[test]
    fn a_message_has_an_ethercat_header_of_type_5() {
        let header = Header { address: 1001, ..Header::new(Protocol::Coe, 2, 2) };
        let message = Message { header, payload: &[0xAA, 0xBB] };
        let mut out = [0xEE; 16];
        assert_eq!(encode(&message, &mut out), Some(10));
        assert_eq!(&out[..10], BYTES);
        assert_eq!(decode(BYTES), Ok(message));
        assert_eq!(decode(&out), Ok(message), "padding of a short frame");
        assert_eq!(frame_length([0x08, 0x50]), Ok(10));
        assert_eq!(encode(&message, &mut out[..9]), None);
        assert_eq!(PORT, 34_980);
    }

    // covers: 10.1, codec-mailbox
    #[test]
    fn type_and_lengths_are_checked() {
        let text = |bytes: &[u8]| decode(bytes).unwrap_err().to_string();
        assert_eq!(text(&[8]), "gateway message too short: expected 2 bytes, got 1");
        assert_eq!(text(&[0x08, 0x10, 0, 0, 0, 0, 0, 0, 0, 0]), "expected EtherCAT type 5, got 1");
        assert_eq!(text(&BYTES[..9]), "EtherCAT header announces 8 bytes, got 7");
        let mut wrong = BYTES.to_vec();
        wrong[2] = 1;
        assert_eq!(text(&wrong), "EtherCAT header announces 8 bytes, got 7");
        wrong[2] = 3;
        assert_eq!(text(&wrong), "mailbox header announces 3 bytes, got 2");
        let header = Header::new(Protocol::Coe, 1, 3);
        assert_eq!(encode(&Message { header, payload: &[0; 2] }, &mut [0; 32]), None);
        let header = Header::new(Protocol::Coe, 1, 2042);
        assert_eq!(encode(&Message { header, payload: &[0; 2042] }, &mut [0; 4096]), None);
    }

    proptest! {
        #[test]
        fn any_bytes_never_panic_and_decoded_messages_encode_back(
            length in 0u8..32,
            mut bytes in proptest::collection::vec(any::<u8>(), 0..40),
        ) {
            if let Some(head) = bytes.get_mut(..4) {
                head.copy_from_slice(&[length, 0x50, length.wrapping_sub(6), 0]);
            }
            if let Ok(message) = decode(&bytes) {
                let mut out = [0; 64];
                let written = encode(&message, &mut out).unwrap();
                prop_assert_eq!(&out[..written], &bytes[..written]);
            }
        }
    }
}
