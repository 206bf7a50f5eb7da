//! The payload of mailbox protocol 0: a SubDevice refuses a message (protocol 6.1).

use core::fmt;

/// An error reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ErrorReply {
    /// Service type; [`ErrorReply::SERVICE`].
    pub service: u16,
    /// The error; one of the constants.
    pub detail: u16,
}

impl ErrorReply {
    /// Bytes of the reply.
    pub const LEN: usize = 4;
    /// The only service type.
    pub const SERVICE: u16 = 1;

    /// Syntax error in the header.
    pub const SYNTAX: u16 = 0x01;
    /// The protocol is not supported.
    pub const UNSUPPORTED_PROTOCOL: u16 = 0x02;
    /// Wrong channel.
    pub const INVALID_CHANNEL: u16 = 0x03;
    /// The service is not supported.
    pub const SERVICE_NOT_SUPPORTED: u16 = 0x04;
    /// Invalid header.
    pub const INVALID_HEADER: u16 = 0x05;
    /// Data too short.
    pub const SIZE_TOO_SHORT: u16 = 0x06;
    /// No memory.
    pub const NO_MORE_MEMORY: u16 = 0x07;
    /// Inconsistent size.
    pub const INVALID_SIZE: u16 = 0x08;
    /// Service in work.
    pub const SERVICE_IN_WORK: u16 = 0x09;

    /// A reply with the usual service type.
    pub const fn new(detail: u16) -> ErrorReply {
        ErrorReply { service: Self::SERVICE, detail }
    }

    /// Decodes four bytes.
    pub const fn decode(b: &[u8; Self::LEN]) -> ErrorReply {
        ErrorReply { service: u16::from_le_bytes([b[0], b[1]]), detail: u16::from_le_bytes([b[2], b[3]]) }
    }

    /// Encodes into four bytes.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let service = self.service.to_le_bytes();
        let detail = self.detail.to_le_bytes();
        [service[0], service[1], detail[0], detail[1]]
    }

    /// The meaning of the detail; `None` for a code that is not in the table.
    pub const fn detail_name(&self) -> Option<&'static str> {
        Some(match self.detail {
            Self::SYNTAX => "syntax of header",
            Self::UNSUPPORTED_PROTOCOL => "protocol not supported",
            Self::INVALID_CHANNEL => "wrong channel",
            Self::SERVICE_NOT_SUPPORTED => "service not supported",
            Self::INVALID_HEADER => "invalid header",
            Self::SIZE_TOO_SHORT => "data too short",
            Self::NO_MORE_MEMORY => "no memory",
            Self::INVALID_SIZE => "inconsistent size",
            Self::SERVICE_IN_WORK => "service in work",
            _ => return None,
        })
    }
}

impl fmt::Display for ErrorReply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x} {}", self.detail, self.detail_name().unwrap_or("unknown mailbox error"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    // covers: codec-mailbox
    #[test]
    fn an_unsupported_protocol_reply_has_the_expected_bytes() {
        let reply = ErrorReply::new(ErrorReply::UNSUPPORTED_PROTOCOL);
        assert_eq!(reply.encode(), [0x01, 0x00, 0x02, 0x00]);
        assert_eq!(reply.to_string(), "0x0002 protocol not supported");
    }

    #[test]
    fn details_1_to_9_have_names() {
        for detail in 1..=9 {
            assert!(ErrorReply::new(detail).detail_name().is_some(), "{detail}");
        }
        assert_eq!(ErrorReply::new(0).detail_name(), None);
        assert_eq!(ErrorReply::new(10).detail_name(), None);
    }

    proptest! {
        #[test]
        fn any_four_bytes_round_trip(bytes in any::<[u8; ErrorReply::LEN]>()) {
            prop_assert_eq!(ErrorReply::decode(&bytes).encode(), bytes);
        }
    }
}
