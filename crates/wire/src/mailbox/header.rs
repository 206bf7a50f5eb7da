//! The six bytes before every mailbox message (protocol 6.1).

use core::fmt;

/// Protocol of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// 0: [`super::ErrorReply`].
    Error,
    /// 1: ADS over EtherCAT, or the gateway.
    Aoe,
    /// 2: Ethernet over EtherCAT.
    Eoe,
    /// 3: CAN application protocol over EtherCAT.
    Coe,
    /// 4: file access over EtherCAT.
    Foe,
    /// 5: servo drive profile over EtherCAT.
    Soe,
    /// 15: vendor protocol over EtherCAT.
    Voe,
    /// Any other code.
    Other(u8),
}

impl Protocol {
    /// From the lower four bits of the type byte.
    pub const fn from_code(code: u8) -> Protocol {
        match code {
            0 => Protocol::Error,
            1 => Protocol::Aoe,
            2 => Protocol::Eoe,
            3 => Protocol::Coe,
            4 => Protocol::Foe,
            5 => Protocol::Soe,
            15 => Protocol::Voe,
            code => Protocol::Other(code),
        }
    }

    /// The lower four bits of the type byte.
    pub const fn code(self) -> u8 {
        match self {
            Protocol::Error => 0,
            Protocol::Aoe => 1,
            Protocol::Eoe => 2,
            Protocol::Coe => 3,
            Protocol::Foe => 4,
            Protocol::Soe => 5,
            Protocol::Voe => 15,
            Protocol::Other(code) => code & 0x0F,
        }
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Protocol::Error => "error reply",
            Protocol::Aoe => "AoE",
            Protocol::Eoe => "EoE",
            Protocol::Coe => "CoE",
            Protocol::Foe => "FoE",
            Protocol::Soe => "SoE",
            Protocol::Voe => "VoE",
            Protocol::Other(code) => return write!(f, "protocol {code}"),
        })
    }
}

/// The largest counter value; 0 means that the sender uses no counter.
pub const MAX_COUNTER: u8 = 7;

/// The counter that follows this counter: 1..=7, then 1 again.
pub const fn next_counter(counter: u8) -> u8 {
    if counter < MAX_COUNTER { counter + 1 } else { 1 }
}

/// The header of a message with all bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Header {
    /// Bytes after the header.
    pub length: u16,
    /// Station address of the destination or the source; 0 is the MainDevice.
    pub address: u16,
    /// Channel, 0..=63.
    pub channel: u8,
    /// Priority, 0..=3.
    pub priority: u8,
    /// Protocol.
    pub protocol: Protocol,
    /// Counter, 0..=7.
    pub counter: u8,
    /// Bit 7 of the type byte.
    pub reserved: bool,
}

impl Header {
    /// Bytes of the header.
    pub const LEN: usize = 6;

    /// A header with address, channel and priority 0.
    pub const fn new(protocol: Protocol, counter: u8, length: u16) -> Header {
        Header { length, address: 0, channel: 0, priority: 0, protocol, counter, reserved: false }
    }

    /// Decodes six bytes; every pattern is valid.
    pub const fn decode(b: &[u8; Self::LEN]) -> Header {
        Header {
            length: u16::from_le_bytes([b[0], b[1]]),
            address: u16::from_le_bytes([b[2], b[3]]),
            channel: b[4] & 0x3F,
            priority: b[4] >> 6,
            protocol: Protocol::from_code(b[5] & 0x0F),
            counter: b[5] >> 4 & 0x07,
            reserved: b[5] & 0x80 != 0,
        }
    }

    /// Encodes into six bytes. Values above their range lose their upper bits.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let length = self.length.to_le_bytes();
        let address = self.address.to_le_bytes();
        let channel = (self.channel & 0x3F) | self.priority << 6;
        let kind = self.protocol.code() | (self.counter & 0x07) << 4 | (self.reserved as u8) << 7;
        [length[0], length[1], address[0], address[1], channel, kind]
    }
}

/// The reason for which the bytes of a mailbox are no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageError {
    /// Shorter than a header.
    Short {
        /// Bytes available.
        got: usize,
    },
    /// The length in the header exceeds the available bytes.
    Length {
        /// Length in the header.
        announced: usize,
        /// Bytes after the header.
        got: usize,
    },
}

impl fmt::Display for MessageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            MessageError::Short { got } => write!(f, "mailbox message too short: expected 6 bytes, got {got}"),
            MessageError::Length { announced, got } => {
                write!(f, "mailbox header announces {announced} bytes, got {got}")
            }
        }
    }
}

impl core::error::Error for MessageError {}

/// A message inside a mailbox, borrowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message<'a> {
    /// The header.
    pub header: Header,
    /// The payload, with the length in the header.
    pub payload: &'a [u8],
}

impl<'a> Message<'a> {
    /// Reads the content of a mailbox; bytes after the length in the header are ignored.
    pub fn decode(mailbox: &'a [u8]) -> Result<Message<'a>, MessageError> {
        let short = MessageError::Short { got: mailbox.len() };
        let (header, rest) = mailbox.split_first_chunk().ok_or(short)?;
        let header = Header::decode(header);
        let announced = usize::from(header.length);
        let payload = rest.get(..announced).ok_or(MessageError::Length { announced, got: rest.len() })?;
        Ok(Message { header, payload })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    // covers: codec-mailbox
    #[test]
    fn a_coe_message_of_ten_bytes_has_the_expected_header() {
        let header = Header::new(Protocol::Coe, 5, 10);
        assert_eq!(header.encode(), [0x0A, 0x00, 0x00, 0x00, 0x00, 0x53]);
        let full = Header {
            length: 0x0102,
            address: 0x1003,
            channel: 0x21,
            priority: 3,
            protocol: Protocol::Voe,
            counter: 7,
            reserved: true,
        };
        assert_eq!(full.encode(), [0x02, 0x01, 0x03, 0x10, 0xE1, 0xFF]);
        assert_eq!(Header::decode(&full.encode()), full);
    }

    #[test]
    fn each_protocol_has_its_code() {
        let known = [
            (0, Protocol::Error),
            (1, Protocol::Aoe),
            (2, Protocol::Eoe),
            (3, Protocol::Coe),
            (4, Protocol::Foe),
            (5, Protocol::Soe),
            (6, Protocol::Other(6)),
            (15, Protocol::Voe),
        ];
        for (code, protocol) in known {
            assert_eq!(Protocol::from_code(code), protocol);
            assert_eq!(protocol.code(), code);
        }
    }

    // covers: codec-mailbox
    #[test]
    fn counters_run_from_1_to_7_and_never_return_to_0() {
        assert_eq!([0, 1, 2, 3, 4, 5, 6, 7].map(next_counter), [1, 2, 3, 4, 5, 6, 7, 1]);
        assert_eq!(next_counter(255), 1);
    }

    #[test]
    fn a_message_has_the_length_in_its_header() {
        let mailbox = [0x02, 0, 0, 0, 0, 0x13, 0xAA, 0xBB, 0xCC];
        let message = Message::decode(&mailbox).unwrap();
        assert_eq!(message.header, Header::new(Protocol::Coe, 1, 2));
        assert_eq!(message.payload, [0xAA, 0xBB]);
        assert_eq!(Message::decode(&mailbox[..7]), Err(MessageError::Length { announced: 2, got: 1 }));
        assert_eq!(Message::decode(&mailbox[..5]), Err(MessageError::Short { got: 5 }));
    }

    proptest! {
        #[test]
        fn any_six_bytes_round_trip(bytes in any::<[u8; Header::LEN]>()) {
            prop_assert_eq!(Header::decode(&bytes).encode(), bytes);
        }

        // covers: codec-mailbox
        #[test]
        fn any_mailbox_is_read_without_panic(bytes in proptest::collection::vec(any::<u8>(), 0..64)) {
            if let Ok(message) = Message::decode(&bytes) {
                prop_assert_eq!(message.payload.len(), usize::from(message.header.length));
            }
        }
    }
}
