//! FMMUs: map logical bits to physical bits (protocol 3.10).
//!
//! Input: the FMMU registers and the bit range of a datagram. Output: the pieces of that range that this controller
//! maps in one direction. If several FMMUs match, the lowest number takes precedence. [`super::access`] moves the bits.

use ringcat_wire::register::{Fmmu, map};

/// First bit after the registers with side effects.
const REGISTERS_END: u64 = map::DIGITAL_OUTPUTS.0 as u64 * 8;

/// A piece of logical bits and its physical position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    /// First logical bit.
    pub logical: u64,
    /// First physical bit.
    pub physical: u64,
    /// Number of bits.
    pub len: u64,
}

/// Direction of a logical access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Read,
    Write,
}

#[derive(Clone, Copy, Debug)]
struct Mapping {
    /// First logical bit and the bit after the last.
    first: u64,
    end: u64,
    physical: u64,
    read: bool,
    write: bool,
}

/// The active FMMUs.
#[derive(Clone, Debug, Default)]
pub(super) struct Fmmus {
    mappings: Vec<Mapping>,
    /// Range of all mapped bits, to skip a datagram quickly.
    hull: (u64, u64),
    reads: bool,
    writes: bool,
    /// Whether registers with side effects can be written.
    reaches_registers: bool,
}

impl Fmmus {
    pub fn clear(&mut self) {
        self.mappings.clear();
        self.hull = (0, 0);
        (self.reads, self.writes, self.reaches_registers) = (false, false, false);
    }

    /// Adds the registers of the next FMMU, in the order of their numbers.
    pub fn push(&mut self, fmmu: &Fmmu, byte_oriented: bool) {
        let mut fmmu = *fmmu;
        if byte_oriented {
            (fmmu.logical_start_bit, fmmu.logical_stop_bit, fmmu.physical_start_bit) = (0, 7, 0);
        }
        let len = u64::from(fmmu.bit_length());
        if !fmmu.active || len == 0 || fmmu.length == 0 {
            return;
        }
        let first = u64::from(fmmu.logical_start.0) * 8 + u64::from(fmmu.logical_start_bit);
        let physical = u64::from(fmmu.physical_start) * 8 + u64::from(fmmu.physical_start_bit);
        let mapping = Mapping { first, end: first + len, physical, read: fmmu.read, write: fmmu.write };
        self.hull = match self.mappings.is_empty() {
            true => (mapping.first, mapping.end),
            false => (self.hull.0.min(mapping.first), self.hull.1.max(mapping.end)),
        };
        self.reads |= mapping.read;
        self.writes |= mapping.write;
        self.reaches_registers |= mapping.write && mapping.physical < REGISTERS_END;
        self.mappings.push(mapping);
    }

    /// Whether an FMMU may match these bits.
    pub fn concern(&self, first: u64, end: u64) -> bool {
        first < self.hull.1 && self.hull.0 < end
    }

    /// Whether there are FMMUs of both directions.
    pub fn both_ways(&self) -> bool {
        self.reads && self.writes
    }

    /// Whether a logical write may change the behaviour of the controller.
    pub fn reach_registers(&self) -> bool {
        self.reaches_registers
    }

    pub fn count(&self) -> usize {
        self.mappings.len()
    }

    /// The first piece at or after bit `from` and before `end` that mapping `n`, and none with a lower number, maps.
    pub fn piece(&self, n: usize, direction: Direction, from: u64, end: u64) -> Option<Piece> {
        let mapping = self.mappings.get(n).filter(|mapping| mapping.has(direction))?;
        let mut start = from.max(mapping.first);
        let mut stop = end.min(mapping.end);
        if start >= stop {
            return None;
        }
        let lower = || self.mappings[..n].iter().filter(|lower| lower.has(direction));
        while let Some(covering) = lower().find(|lower| lower.first <= start && start < lower.end) {
            start = covering.end;
        }
        for next in lower().filter(|lower| lower.first > start) {
            stop = stop.min(next.first);
        }
        let physical = mapping.physical + start.wrapping_sub(mapping.first);
        (start < stop).then(|| Piece { logical: start, physical, len: stop - start })
    }
}

impl Mapping {
    fn has(&self, direction: Direction) -> bool {
        match direction {
            Direction::Read => self.read,
            Direction::Write => self.write,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::address::LogicalAddress;

    fn fmmu(logical: u32, length: u16, bits: (u8, u8), physical: u16, bit: u8) -> Fmmu {
        Fmmu {
            logical_start: LogicalAddress(logical),
            length,
            logical_start_bit: bits.0,
            logical_stop_bit: bits.1,
            physical_start: physical,
            physical_start_bit: bit,
            read: true,
            active: true,
            ..Fmmu::default()
        }
    }

    #[test]
    fn fourteen_bits_from_bit_3_end_with_bit_0_of_the_third_byte() {
        // protocol 3.10: the data sheet's example counts 5 + 8 + 1 bits.
        let mut fmmus = Fmmus::default();
        fmmus.push(&fmmu(0x0001_0011, 3, (3, 0), 0x0F01, 1), false);
        let piece = fmmus.piece(0, Direction::Read, 0, u64::MAX).unwrap();
        assert_eq!(piece, Piece { logical: 0x0001_0011 * 8 + 3, physical: 0x0F01 * 8 + 1, len: 14 });
        assert_eq!(fmmus.piece(0, Direction::Write, 0, u64::MAX), None);
    }

    #[test]
    fn the_lower_numbered_fmmu_takes_precedence_and_leaves_the_rest() {
        let mut fmmus = Fmmus::default();
        fmmus.push(&fmmu(2, 1, (0, 7), 0x1000, 0), false);
        fmmus.push(&fmmu(0, 4, (0, 7), 0x1100, 0), false);
        let first = fmmus.piece(1, Direction::Read, 0, 1_000).unwrap();
        assert_eq!(first, Piece { logical: 0, physical: 0x1100 * 8, len: 16 });
        let second = fmmus.piece(1, Direction::Read, 16, 1_000).unwrap();
        assert_eq!(second, Piece { logical: 24, physical: 0x1103 * 8, len: 8 });
        assert_eq!(fmmus.piece(1, Direction::Read, 32, 1_000), None);
    }

    #[test]
    fn a_byte_oriented_fmmu_ignores_the_bits() {
        let mut fmmus = Fmmus::default();
        fmmus.push(&fmmu(0, 2, (3, 0), 0x1000, 1), true);
        assert_eq!(fmmus.piece(0, Direction::Read, 0, 99).unwrap(), Piece { logical: 0, physical: 0x8000, len: 16 });
    }
}
