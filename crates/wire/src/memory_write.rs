//! A write into the memory of a SubDevice that must not be cut off: a change of the role would do that, and it may
//! destroy the SubDevice (seed 000, 3.7).

use core::fmt;

/// What is written, or may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WriteKind {
    /// A file, with FoE.
    File,
    /// The EEPROM.
    Eeprom,
    /// The SubDevice is in BOOT, or is brought there.
    Boot,
}

/// A write that is under way, and its SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MemoryWrite {
    /// What is written.
    pub kind: WriteKind,
    /// Whether `subdevice` is a position on the bus; otherwise it is an index in the declaration.
    pub is_position: bool,
    /// The SubDevice; `None` for numbers from [`MemoryWrite::NUMBERS`] on.
    pub subdevice: Option<u16>,
}

impl MemoryWrite {
    /// Numbers of SubDevices below this one are carried.
    pub const NUMBERS: u16 = 0x1FFF;
    const POSITION: u16 = 0x2000;

    /// Of a SubDevice with this number.
    pub fn new(kind: WriteKind, is_position: bool, subdevice: usize) -> MemoryWrite {
        let subdevice = u16::try_from(subdevice).ok().filter(|number| *number < Self::NUMBERS);
        MemoryWrite { kind, is_position, subdevice }
    }

    /// As a word, which is not 0.
    pub const fn code(self) -> u16 {
        let kind = match self.kind {
            WriteKind::File => 1,
            WriteKind::Eeprom => 2,
            WriteKind::Boot => 3,
        };
        let number = match self.subdevice {
            Some(number) if number < Self::NUMBERS => number,
            _ => Self::NUMBERS,
        };
        kind << 14 | if self.is_position { Self::POSITION } else { 0 } | number
    }

    /// From its word; `None` if nothing is written.
    pub const fn from_code(code: u16) -> Option<MemoryWrite> {
        let kind = match code >> 14 {
            1 => WriteKind::File,
            2 => WriteKind::Eeprom,
            3 => WriteKind::Boot,
            _ => return None,
        };
        let number = code & Self::NUMBERS;
        let subdevice = if number == Self::NUMBERS { None } else { Some(number) };
        Some(MemoryWrite { kind, is_position: code & Self::POSITION != 0, subdevice })
    }
}

impl fmt::Display for MemoryWrite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.kind {
            WriteKind::File => "a file is written to ",
            WriteKind::Eeprom => "the EEPROM is written of ",
            WriteKind::Boot => "in BOOT is ",
        })?;
        match (self.subdevice, self.is_position) {
            (Some(number), false) => write!(f, "SubDevice {number}"),
            (Some(number), true) => write!(f, "the SubDevice at position {number}"),
            (None, _) => write!(f, "a SubDevice behind the first {}", Self::NUMBERS),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    // covers: 9.8, standby
    #[test]
    fn a_memory_write_survives_its_word() {
        for kind in [WriteKind::File, WriteKind::Eeprom, WriteKind::Boot] {
            for is_position in [false, true] {
                for number in [0, 1, 0x1FFE, 0x1FFF, 70_000] {
                    let write = MemoryWrite::new(kind, is_position, number);
                    assert_eq!(MemoryWrite::from_code(write.code()), Some(write), "{number:#x}");
                    assert_eq!(write.subdevice, (number < 0x1FFF).then_some(number as u16));
                }
            }
        }
        assert!([0, 1, 0x3FFF].into_iter().all(|code| MemoryWrite::from_code(code).is_none()));
        let file = MemoryWrite::new(WriteKind::File, true, 3);
        assert_eq!(file.to_string(), "a file is written to the SubDevice at position 3");
        let eeprom = MemoryWrite::new(WriteKind::Eeprom, false, 2);
        assert_eq!(eeprom.to_string(), "the EEPROM is written of SubDevice 2");
    }
}
