//! The emergency message of CoE (protocol 6.3), and the classes of error codes (CiA 301).

/// An emergency message, after its CoE header. The SubDevice sends it without a request, also between a request and its
/// response.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Emergency {
    /// Error code.
    pub error_code: u16,
    /// Error register (object 0x1001).
    pub error_register: u8,
    /// Data of the vendor.
    pub data: [u8; 5],
}

impl Emergency {
    /// Bytes of the message after the CoE header.
    pub const LEN: usize = 8;
    /// Error code: the error is cleared.
    pub const ERROR_RESET: u16 = 0x0000;
    /// Error code: the transition from PREOP to SAFEOP failed.
    pub const PREOP_TO_SAFEOP_FAILED: u16 = 0xA000;
    /// Error code: the transition from SAFEOP to OP failed.
    pub const SAFEOP_TO_OP_FAILED: u16 = 0xA001;

    /// Decodes eight bytes.
    pub const fn decode(b: &[u8; Self::LEN]) -> Emergency {
        Emergency {
            error_code: u16::from_le_bytes([b[0], b[1]]),
            error_register: b[2],
            data: [b[3], b[4], b[5], b[6], b[7]],
        }
    }

    /// Encodes into eight bytes.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        let code = self.error_code.to_le_bytes();
        let [a, b, c, d, e] = self.data;
        [code[0], code[1], self.error_register, a, b, c, d, e]
    }

    /// The class of the error code; `None` for a class that CiA 301 does not name.
    pub const fn class_name(&self) -> Option<&'static str> {
        Some(match self.error_code {
            Self::PREOP_TO_SAFEOP_FAILED => "transition from PREOP to SAFEOP failed",
            Self::SAFEOP_TO_OP_FAILED => "transition from SAFEOP to OP failed",
            code => match (code >> 8) as u8 {
                0x00 => "error reset or no error",
                0x10..=0x1F => "generic error",
                0x21 => "current, device input side",
                0x22 => "current inside the device",
                0x23 => "current, device output side",
                0x20..=0x2F => "current",
                0x31 => "mains voltage",
                0x32 => "voltage inside the device",
                0x33 => "output voltage",
                0x30..=0x3F => "voltage",
                0x41 => "ambient temperature",
                0x42 => "device temperature",
                0x40..=0x4F => "temperature",
                0x50..=0x5F => "device hardware",
                0x61 => "internal software",
                0x62 => "user software",
                0x63 => "data set",
                0x60..=0x6F => "device software",
                0x70..=0x7F => "additional modules",
                0x81 => "communication",
                0x82 => "protocol error",
                0x80..=0x8F => "monitoring",
                0x90..=0x9F => "external error",
                0xA0 => "EtherCAT state machine",
                0xF0..=0xFE => "additional functions",
                0xFF => "device specific",
                _ => return None,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    // covers: codec-mailbox
    #[test]
    fn an_emergency_has_the_expected_bytes() {
        let emergency = Emergency { error_code: 0x8130, error_register: 0x11, data: [1, 2, 3, 4, 5] };
        assert_eq!(emergency.encode(), [0x30, 0x81, 0x11, 1, 2, 3, 4, 5]);
    }

    // covers: 6.3, codec-mailbox
    #[test]
    fn an_error_code_belongs_to_a_class() {
        let class = |error_code| Emergency { error_code, error_register: 0, data: [0; 5] }.class_name();
        let known = [
            (0x0000, "error reset or no error"),
            (0x1000, "generic error"),
            (0x2310, "current, device output side"),
            (0x2900, "current"),
            (0x3220, "voltage inside the device"),
            (0x4310, "temperature"),
            (0x6320, "data set"),
            (0x7300, "additional modules"),
            (0x8130, "communication"),
            (0xA000, "transition from PREOP to SAFEOP failed"),
            (0xA001, "transition from SAFEOP to OP failed"),
            (0xFF01, "device specific"),
        ];
        for (code, name) in known {
            assert_eq!(class(code), Some(name), "{code:#06x}");
        }
        assert_eq!([class(0x0123), class(0xB000)], [None, None]);
    }

    proptest! {
        #[test]
        fn any_emergency_round_trips(bytes in any::<[u8; Emergency::LEN]>()) {
            prop_assert_eq!(Emergency::decode(&bytes).encode(), bytes);
        }
    }
}
