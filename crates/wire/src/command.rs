//! The commands of EtherCAT datagrams (protocol 1.4).

use core::fmt;

/// Command code of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Command {
    /// No operation.
    Nop,
    /// Auto-increment physical read.
    Aprd,
    /// Auto-increment physical write.
    Apwr,
    /// Auto-increment physical read and write.
    Aprw,
    /// Fixed-address physical read.
    Fprd,
    /// Fixed-address physical write.
    Fpwr,
    /// Fixed-address physical read and write.
    Fprw,
    /// Broadcast read.
    Brd,
    /// Broadcast write.
    Bwr,
    /// Broadcast read and write.
    Brw,
    /// Logical read.
    Lrd,
    /// Logical write.
    Lwr,
    /// Logical read and write.
    Lrw,
    /// Auto-increment read, multiple write.
    Armw,
    /// Fixed-address read, multiple write.
    Frmw,
    /// A reserved code; controllers ignore the datagram. A decoded value is never 0..=14.
    Reserved(u8),
}

/// Meaning of a command's address field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Addressing {
    /// Not evaluated.
    None,
    /// Position in the ring; every processing unit increments it.
    AutoIncrement,
    /// Station address or enabled alias.
    Station,
    /// All SubDevices; every processing unit increments it.
    Broadcast,
    /// Logical address, mapped by FMMUs.
    Logical,
}

impl Command {
    /// All fifteen commands in the order of their codes.
    pub const ALL: [Command; 15] = [
        Command::Nop,
        Command::Aprd,
        Command::Apwr,
        Command::Aprw,
        Command::Fprd,
        Command::Fpwr,
        Command::Fprw,
        Command::Brd,
        Command::Bwr,
        Command::Brw,
        Command::Lrd,
        Command::Lwr,
        Command::Lrw,
        Command::Armw,
        Command::Frmw,
    ];

    /// From the code on the wire.
    pub const fn from_code(code: u8) -> Command {
        if (code as usize) < Self::ALL.len() { Self::ALL[code as usize] } else { Command::Reserved(code) }
    }

    /// The code on the wire.
    pub const fn code(self) -> u8 {
        match self {
            Command::Nop => 0,
            Command::Aprd => 1,
            Command::Apwr => 2,
            Command::Aprw => 3,
            Command::Fprd => 4,
            Command::Fpwr => 5,
            Command::Fprw => 6,
            Command::Brd => 7,
            Command::Bwr => 8,
            Command::Brw => 9,
            Command::Lrd => 10,
            Command::Lwr => 11,
            Command::Lrw => 12,
            Command::Armw => 13,
            Command::Frmw => 14,
            Command::Reserved(code) => code,
        }
    }

    /// The meaning of the address field.
    pub const fn addressing(self) -> Addressing {
        match self {
            Command::Nop | Command::Reserved(_) => Addressing::None,
            Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw => Addressing::AutoIncrement,
            Command::Fprd | Command::Fpwr | Command::Fprw | Command::Frmw => Addressing::Station,
            Command::Brd | Command::Bwr | Command::Brw => Addressing::Broadcast,
            Command::Lrd | Command::Lwr | Command::Lrw => Addressing::Logical,
        }
    }

    /// Whether SubDevices write data into the datagram (read access).
    pub const fn reads(self) -> bool {
        matches!(
            self,
            Command::Aprd
                | Command::Aprw
                | Command::Fprd
                | Command::Fprw
                | Command::Brd
                | Command::Brw
                | Command::Lrd
                | Command::Lrw
                | Command::Armw
                | Command::Frmw
        )
    }

    /// Whether SubDevices take data from the datagram (write access).
    pub const fn writes(self) -> bool {
        matches!(
            self,
            Command::Apwr
                | Command::Aprw
                | Command::Fpwr
                | Command::Fprw
                | Command::Bwr
                | Command::Brw
                | Command::Lwr
                | Command::Lrw
                | Command::Armw
                | Command::Frmw
        )
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Command::Nop => "NOP",
            Command::Aprd => "APRD",
            Command::Apwr => "APWR",
            Command::Aprw => "APRW",
            Command::Fprd => "FPRD",
            Command::Fpwr => "FPWR",
            Command::Fprw => "FPRW",
            Command::Brd => "BRD",
            Command::Bwr => "BWR",
            Command::Brw => "BRW",
            Command::Lrd => "LRD",
            Command::Lwr => "LWR",
            Command::Lrw => "LRW",
            Command::Armw => "ARMW",
            Command::Frmw => "FRMW",
            Command::Reserved(code) => return write!(f, "command {code:#04x}"),
        };
        f.write_str(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: codec-frames
    #[test]
    fn every_code_round_trips() {
        for code in 0..=255 {
            assert_eq!(Command::from_code(code).code(), code);
        }
    }
}
