//! The header of every ADS message (protocol 6.7).

use core::fmt;

use super::{AdsErrorCode, PayloadError, split};

/// Address of a device in the ADS network (AMS NetId).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct NetId(pub [u8; 6]);

impl fmt::Display for NetId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, e, g] = self.0;
        write!(f, "{a}.{b}.{c}.{d}.{e}.{g}")
    }
}

/// A port of a device in the ADS network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AmsAddress {
    /// The device.
    pub net_id: NetId,
    /// Its port.
    pub port: u16,
}

/// ADS command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AdsCommand {
    /// 1: name and version.
    ReadDeviceInfo,
    /// 2: read.
    Read,
    /// 3: write.
    Write,
    /// 4: read the states of ADS and of the device.
    ReadState,
    /// 5: change the states.
    WriteControl,
    /// 6: add a notification.
    AddNotification,
    /// 7: delete a notification.
    DeleteNotification,
    /// 8: a notification, sent without a request.
    Notification,
    /// 9: write and read in one command.
    ReadWrite,
    /// Any other code.
    Other(u16),
}

impl AdsCommand {
    /// From the code.
    pub const fn from_code(code: u16) -> AdsCommand {
        match code {
            1 => AdsCommand::ReadDeviceInfo,
            2 => AdsCommand::Read,
            3 => AdsCommand::Write,
            4 => AdsCommand::ReadState,
            5 => AdsCommand::WriteControl,
            6 => AdsCommand::AddNotification,
            7 => AdsCommand::DeleteNotification,
            8 => AdsCommand::Notification,
            9 => AdsCommand::ReadWrite,
            code => AdsCommand::Other(code),
        }
    }

    /// The code.
    pub const fn code(self) -> u16 {
        match self {
            AdsCommand::ReadDeviceInfo => 1,
            AdsCommand::Read => 2,
            AdsCommand::Write => 3,
            AdsCommand::ReadState => 4,
            AdsCommand::WriteControl => 5,
            AdsCommand::AddNotification => 6,
            AdsCommand::DeleteNotification => 7,
            AdsCommand::Notification => 8,
            AdsCommand::ReadWrite => 9,
            AdsCommand::Other(code) => code,
        }
    }
}

/// The header of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AmsHeader {
    /// Receiver.
    pub target: AmsAddress,
    /// Sender.
    pub source: AmsAddress,
    /// ADS command.
    pub command: AdsCommand,
    /// Flags; [`AmsHeader::REQUEST`] or [`AmsHeader::RESPONSE`].
    pub flags: u16,
    /// Bytes after the header.
    pub length: u32,
    /// Error of the message transport.
    pub error: AdsErrorCode,
    /// Set by the sender of the request and returned in the response.
    pub invoke_id: u32,
}

impl AmsHeader {
    /// Bytes of the header.
    pub const LEN: usize = 32;
    /// Flags of a request.
    pub const REQUEST: u16 = 0x0004;
    /// Flags of a response.
    pub const RESPONSE: u16 = 0x0005;

    /// Decodes the header; `data` has the length in the header.
    pub fn decode(payload: &[u8]) -> Result<(AmsHeader, &[u8]), PayloadError> {
        let (b, rest) = split::<32>(payload, "AMS header")?;
        let word = |at: usize| u16::from_le_bytes([b[at], b[at + 1]]);
        let long = |at: usize| u32::from_le_bytes([b[at], b[at + 1], b[at + 2], b[at + 3]]);
        let address = |at: usize| AmsAddress {
            net_id: NetId([b[at], b[at + 1], b[at + 2], b[at + 3], b[at + 4], b[at + 5]]),
            port: word(at + 6),
        };
        let header = AmsHeader {
            target: address(0),
            source: address(8),
            command: AdsCommand::from_code(word(16)),
            flags: word(18),
            length: long(20),
            error: AdsErrorCode(long(24)),
            invoke_id: long(28),
        };
        let length = usize::try_from(header.length).unwrap_or(usize::MAX);
        let short = PayloadError::Short { what: "AMS data", expected: length, got: rest.len() };
        Ok((header, rest.get(..length).ok_or(short)?))
    }

    /// Encodes the header.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut out = [0; Self::LEN];
        for (at, address) in [(0, self.target), (8, self.source)] {
            out[at..at + 6].copy_from_slice(&address.net_id.0);
            out[at + 6..at + 8].copy_from_slice(&address.port.to_le_bytes());
        }
        out[16..18].copy_from_slice(&self.command.code().to_le_bytes());
        out[18..20].copy_from_slice(&self.flags.to_le_bytes());
        out[20..24].copy_from_slice(&self.length.to_le_bytes());
        out[24..28].copy_from_slice(&self.error.0.to_le_bytes());
        out[28..].copy_from_slice(&self.invoke_id.to_le_bytes());
        out
    }

    /// The header of the response to this request: sender and receiver are exchanged.
    pub const fn response(&self, length: u32) -> AmsHeader {
        AmsHeader {
            target: self.source,
            source: self.target,
            command: self.command,
            flags: Self::RESPONSE,
            length,
            error: AdsErrorCode::NO_ERROR,
            invoke_id: self.invoke_id,
        }
    }

    /// Whether the message is a response.
    pub const fn is_response(&self) -> bool {
        self.flags & 0x0001 != 0
    }
}
