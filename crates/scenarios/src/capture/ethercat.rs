//! Strict parser of EtherCAT frames for the capture checks (protocol 1.1 to 1.3, 9.7.1 A): a MainDevice must not send a
//! frame that is refused here.

/// Commands that only read: APRD, FPRD, BRD, LRD.
pub const READS: [u8; 4] = [1, 4, 7, 10];
/// Commands with an ADP that counts SubDevices and may differ between copies: APRD, APWR, APRW, ARMW.
const AUTO_INCREMENT: [u8; 4] = [1, 2, 3, 13];
/// Commands that write to physical addresses: APWR, APRW, FPWR, FPRW, BWR, BRW.
const WRITES: [u8; 6] = [2, 3, 5, 6, 8, 9];
/// Register of the station address.
const STATION_ADDRESS: u16 = 0x0010;

/// A datagram.
#[derive(Clone, Debug)]
pub struct Datagram<'a> {
    /// Cmd.
    pub command: u8,
    /// Idx.
    pub index: u8,
    /// C bit.
    pub circulating: bool,
    /// ADP, or the lower half of a logical address.
    pub adp: u16,
    /// ADO, or the upper half of a logical address.
    pub ado: u16,
    /// Event request.
    pub irq: u16,
    /// Data.
    pub data: &'a [u8],
    /// Working counter.
    pub wkc: u16,
    /// Offset of its header in the frame.
    pub at: usize,
}

impl Datagram<'_> {
    /// Its logical address.
    pub fn address(&self) -> u32 {
        u32::from(self.ado) << 16 | u32::from(self.adp)
    }
}

/// A frame.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    bytes: &'a [u8],
    /// Its datagrams, at least one.
    pub datagrams: Vec<Datagram<'a>>,
}

impl<'a> Frame<'a> {
    /// Parses a frame; the error is the fault.
    pub fn parse(bytes: &'a [u8]) -> Result<Frame<'a>, String> {
        if !(60..=1514).contains(&bytes.len()) {
            return Err(format!("{} bytes, expected 60 to 1514", bytes.len()));
        }
        if bytes[12..14] != [0x88, 0xA4] {
            return Err(format!("EtherType {:02x}{:02x}, expected 88a4", bytes[12], bytes[13]));
        }
        let header = u16::from_le_bytes([bytes[14], bytes[15]]);
        if header >> 11 != 0b00010 {
            return Err(format!("EtherCAT header {header:#06x}, expected type 1 and the reserved bit 0"));
        }
        let end = 16 + usize::from(header & 0x07FF);
        let Some(mut rest) = bytes.get(16..end) else {
            return Err(format!("the datagrams end at {end}, the frame at {}", bytes.len()));
        };
        if bytes[end..].iter().any(|byte| *byte != 0) {
            return Err("padding that is not zero".to_owned());
        }
        let mut datagrams = Vec::new();
        loop {
            let at = end - rest.len();
            let [command, index, adp_low, adp_high, ado_low, ado_high, low, high, irq_low, irq_high, behind @ ..] =
                rest
            else {
                return Err(format!("a datagram at {at} is cut off"));
            };
            let flags = u16::from_le_bytes([*low, *high]);
            let length = usize::from(flags & 0x07FF);
            if flags & 0x3800 != 0 {
                return Err(format!("reserved bits of the datagram at {at} are set"));
            }
            let (Some(data), Some(wkc)) = (behind.get(..length), behind.get(length..length + 2)) else {
                return Err(format!("{length} bytes of data at {at} do not fit"));
            };
            datagrams.push(Datagram {
                command: *command,
                index: *index,
                circulating: flags & 0x4000 != 0,
                adp: u16::from_le_bytes([*adp_low, *adp_high]),
                ado: u16::from_le_bytes([*ado_low, *ado_high]),
                irq: u16::from_le_bytes([*irq_low, *irq_high]),
                data,
                wkc: u16::from_le_bytes([wkc[0], wkc[1]]),
                at,
            });
            rest = &behind[length + 2..];
            match (flags & 0x8000 != 0, rest.is_empty()) {
                (true, false) => {}
                (false, true) => return Ok(Frame { bytes, datagrams }),
                (more, _) => return Err(format!("M = {} of the datagram at {at} is wrong", u8::from(more))),
            }
        }
    }

    /// Sent on the redundant link (RED bit, SM-01).
    pub fn is_marked_redundant(&self) -> bool {
        self.bytes[6] & 0x08 != 0
    }

    /// Sent by the acyclic half: bit 7 of the first Idx.
    pub fn is_acyclic(&self) -> bool {
        self.datagrams[0].index & 0x80 != 0
    }

    /// Its id in the source address, 8 bits.
    pub fn id(&self) -> u8 {
        self.bytes[7]
    }

    /// Its number within its class, 15 bits.
    pub fn number(&self) -> u16 {
        u16::from(self.datagrams[0].index & 0x7F) << 8 | u16::from(self.id())
    }

    /// Its bytes without those that may differ between the copies on both links: RED bit, ADP of auto-increment
    /// commands, written station addresses.
    pub fn alike(&self) -> Vec<u8> {
        let mut bytes = self.bytes.to_vec();
        bytes[6] &= !0x08;
        for datagram in &self.datagrams {
            if AUTO_INCREMENT.contains(&datagram.command) {
                bytes[datagram.at + 2..datagram.at + 4].fill(0);
            }
            if WRITES.contains(&datagram.command) && datagram.ado == STATION_ADDRESS {
                bytes[datagram.at + 10..][..datagram.data.len()].fill(0);
            }
        }
        bytes
    }
}
