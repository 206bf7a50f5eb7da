//! Error counters, registers 0x0300..0x0313 (protocol 2.5). All saturate at 255; any write clears the group.

/// Receive errors of one port, RX_ERROR_COUNTER (0x0300 + 2 x port).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct RxErrorCounter {
    /// Frames with a wrong FCS that were not marked by a previous controller.
    pub invalid_frames: u8,
    /// RX_ER symbols.
    pub rx_errors: u8,
}

impl RxErrorCounter {
    /// Bytes of the register.
    pub const LEN: usize = 2;

    /// From the register's bytes.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> RxErrorCounter {
        RxErrorCounter { invalid_frames: bytes[0], rx_errors: bytes[1] }
    }

    /// To the register's bytes.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        [self.invalid_frames, self.rx_errors]
    }
}

/// All error counters in one read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ErrorCounters {
    /// RX_ERROR_COUNTER of port 0..3.
    pub rx: [RxErrorCounter; 4],
    /// FORWARDED_RX_ERROR_COUNTER of port 0..3: bad frames that a previous controller has marked.
    pub forwarded: [u8; 4],
    /// EPU_ERROR_COUNTER: errors of the EtherCAT processing unit, including circulating frames.
    pub epu: u8,
    /// PDI_ERROR_COUNTER.
    pub pdi: u8,
    /// PDI_ERROR_CODE.
    pub pdi_code: u8,
    /// Byte 0x030F.
    pub reserved: u8,
    /// LOST_LINK_COUNTER of port 0..3.
    pub lost_link: [u8; 4],
}

impl ErrorCounters {
    /// Bytes of the registers.
    pub const LEN: usize = 20;

    /// From the registers' bytes.
    pub fn decode(bytes: &[u8; Self::LEN]) -> ErrorCounters {
        let b = bytes;
        ErrorCounters {
            rx: [0, 2, 4, 6].map(|at| RxErrorCounter::decode(&[b[at], b[at + 1]])),
            forwarded: [b[8], b[9], b[10], b[11]],
            epu: b[12],
            pdi: b[13],
            pdi_code: b[14],
            reserved: b[15],
            lost_link: [b[16], b[17], b[18], b[19]],
        }
    }

    /// To the registers' bytes.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        for (port, rx) in self.rx.iter().enumerate() {
            bytes[2 * port..2 * port + 2].copy_from_slice(&rx.encode());
        }
        bytes[8..12].copy_from_slice(&self.forwarded);
        bytes[12..16].copy_from_slice(&[self.epu, self.pdi, self.pdi_code, self.reserved]);
        bytes[16..].copy_from_slice(&self.lost_link);
        bytes
    }
}
