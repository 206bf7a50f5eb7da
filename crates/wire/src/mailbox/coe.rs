//! CoE: the two-byte header of every message (protocol 6.3).
//!
//! After the header: SDO transfers in [`super::sdo`], the [`Emergency`], SDO information in [`SdoInformation`] with its
//! descriptions, or a PDO; the objects that describe
//! PDOs are in [`pdo_objects`]. Messages of the diagnosis history (object 0x10F3) are [`DiagnosisMessage`].

mod description;
mod diagnosis;
mod emergency;
mod information;
pub mod pdo_objects;
mod value;

use core::fmt;

pub use description::{AccessRights, EntryDescription, EntryRequest, ObjectCode, ObjectDescription, ValueInfo};
pub use diagnosis::{
    DiagnosisFlags, DiagnosisHistory, DiagnosisKind, DiagnosisMessage, DiagnosisParameter, DiagnosisParameters,
};
pub use emergency::Emergency;
pub use information::{Indices, InformationOpcode, ListType, SdoInformation};
pub use value::DataType;

/// Service of a CoE message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CoeService {
    /// 1: [`Emergency`].
    Emergency,
    /// 2: [`super::sdo::SdoRequest`], and every SDO abort.
    SdoRequest,
    /// 3: [`super::sdo::SdoResponse`].
    SdoResponse,
    /// 4: TxPDO.
    TxPdo,
    /// 5: RxPDO.
    RxPdo,
    /// 6: remote request of a TxPDO.
    TxPdoRemote,
    /// 7: remote request of an RxPDO.
    RxPdoRemote,
    /// 8: SDO information.
    SdoInformation,
    /// Any other code.
    Other(u8),
}

impl CoeService {
    /// From bits 15:12 of the header.
    pub const fn from_code(code: u8) -> CoeService {
        match code {
            1 => CoeService::Emergency,
            2 => CoeService::SdoRequest,
            3 => CoeService::SdoResponse,
            4 => CoeService::TxPdo,
            5 => CoeService::RxPdo,
            6 => CoeService::TxPdoRemote,
            7 => CoeService::RxPdoRemote,
            8 => CoeService::SdoInformation,
            code => CoeService::Other(code),
        }
    }

    /// Bits 15:12 of the header.
    pub const fn code(self) -> u8 {
        match self {
            CoeService::Emergency => 1,
            CoeService::SdoRequest => 2,
            CoeService::SdoResponse => 3,
            CoeService::TxPdo => 4,
            CoeService::RxPdo => 5,
            CoeService::TxPdoRemote => 6,
            CoeService::RxPdoRemote => 7,
            CoeService::SdoInformation => 8,
            CoeService::Other(code) => code & 0x0F,
        }
    }
}

impl fmt::Display for CoeService {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            CoeService::Emergency => "emergency",
            CoeService::SdoRequest => "SDO request",
            CoeService::SdoResponse => "SDO response",
            CoeService::TxPdo => "TxPDO",
            CoeService::RxPdo => "RxPDO",
            CoeService::TxPdoRemote => "TxPDO remote request",
            CoeService::RxPdoRemote => "RxPDO remote request",
            CoeService::SdoInformation => "SDO information",
            CoeService::Other(code) => return write!(f, "CoE service {code}"),
        })
    }
}

/// The CoE header.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CoeHeader {
    /// PDO number, 0..=511; 0 in SDO services.
    pub number: u16,
    /// Reserved bits 11:9, 0..=7.
    pub reserved: u8,
    /// Service.
    pub service: CoeService,
}

impl CoeHeader {
    /// Bytes of the header.
    pub const LEN: usize = 2;

    /// A header with number 0.
    pub const fn new(service: CoeService) -> CoeHeader {
        CoeHeader { number: 0, reserved: 0, service }
    }

    /// Decodes two bytes; every pattern is valid.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> CoeHeader {
        let word = u16::from_le_bytes(*bytes);
        CoeHeader {
            number: word & 0x01FF,
            reserved: (word >> 9) as u8 & 0x07,
            service: CoeService::from_code((word >> 12) as u8),
        }
    }

    /// Encodes into two bytes. Values above their range lose their upper bits.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let reserved = (self.reserved as u16 & 0x07) << 9;
        ((self.number & 0x01FF) | reserved | (self.service.code() as u16) << 12).to_le_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    // covers: codec-mailbox
    #[test]
    fn each_service_has_its_header() {
        let vectors = [
            (CoeService::Emergency, [0x00, 0x10]),
            (CoeService::SdoRequest, [0x00, 0x20]),
            (CoeService::SdoResponse, [0x00, 0x30]),
            (CoeService::TxPdo, [0x00, 0x40]),
            (CoeService::RxPdo, [0x00, 0x50]),
            (CoeService::TxPdoRemote, [0x00, 0x60]),
            (CoeService::RxPdoRemote, [0x00, 0x70]),
            (CoeService::SdoInformation, [0x00, 0x80]),
            (CoeService::Other(9), [0x00, 0x90]),
        ];
        for (service, bytes) in vectors {
            assert_eq!(CoeHeader::new(service).encode(), bytes, "{service}");
            assert_eq!(CoeHeader::decode(&bytes), CoeHeader::new(service), "{service}");
        }
    }

    #[test]
    fn the_number_has_nine_bits() {
        let header = CoeHeader { number: 0x01A5, reserved: 5, service: CoeService::TxPdo };
        assert_eq!(header.encode(), [0xA5, 0x4B]);
        assert_eq!(CoeHeader::decode(&[0xA5, 0x4B]), header);
    }

    proptest! {
        #[test]
        fn any_header_round_trips(bytes in any::<[u8; CoeHeader::LEN]>()) {
            prop_assert_eq!(CoeHeader::decode(&bytes).encode(), bytes);
        }
    }
}
