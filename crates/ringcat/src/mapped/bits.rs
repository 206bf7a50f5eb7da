//! Outputs with any number of bits, whose values are checked.

use std::fmt;

use ringcat_engine::exchange::Entry;
use ringcat_engine::main_device::ObjectOf;

/// An output with any number of bits up to 64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputBits {
    entry: Entry,
    object: ObjectOf,
}

/// A value that has more bits than its place in the process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DoesNotFit {
    /// The object; `None` if no PDO entry is at the place.
    pub object: Option<ObjectOf>,
    /// The value.
    pub value: i128,
    /// Bits of its place.
    pub bits: u16,
}

impl OutputBits {
    pub(super) const fn new(entry: Entry, object: ObjectOf) -> OutputBits {
        OutputBits { entry, object }
    }

    /// Its place in a domain's image.
    pub const fn entry(&self) -> Entry {
        self.entry
    }

    /// The bits of an unsigned value, if it fits.
    pub(crate) fn unsigned(&self, value: u64) -> Result<u64, DoesNotFit> {
        unsigned(value, self.entry.bit_length).map_err(|error| error.of(Some(self.object)))
    }

    /// The bits of a signed value, if it fits.
    pub(crate) fn signed(&self, value: i64) -> Result<u64, DoesNotFit> {
        signed(value, self.entry.bit_length).map_err(|error| error.of(Some(self.object)))
    }
}

/// An unsigned value, if it fits into so many bits.
pub(crate) fn unsigned(value: u64, bits: u16) -> Result<u64, DoesNotFit> {
    match value.checked_shr(bits.into()).unwrap_or(0) {
        0 => Ok(value),
        _ => Err(DoesNotFit { object: None, value: value.into(), bits }),
    }
}

/// The two's complement of a signed value, if it fits into so many bits.
pub(crate) fn signed(value: i64, bits: u16) -> Result<u64, DoesNotFit> {
    let sign = value >> u32::from(bits.clamp(1, 64) - 1);
    match sign {
        0 | -1 => Ok(value as u64),
        _ => Err(DoesNotFit { object: None, value: value.into(), bits }),
    }
}

impl DoesNotFit {
    /// The same error, with the object at the place.
    pub(crate) const fn of(mut self, object: Option<ObjectOf>) -> DoesNotFit {
        self.object = object;
        self
    }
}

impl fmt::Display for DoesNotFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(object) = self.object {
            write!(f, "{object}: ")?;
        }
        write!(f, "{} does not fit into {} bits", self.value, self.bits)
    }
}

impl std::error::Error for DoesNotFit {}

#[cfg(test)]
mod tests {
    use ringcat_engine::main_device::SubDeviceId;

    use super::*;
    use ringcat_engine::domain::DomainId;

    const OBJECT: ObjectOf = ObjectOf::new(SubDeviceId(3), 0x7010, 1);

    fn bits(bit_length: u16) -> OutputBits {
        OutputBits::new(Entry { domain: DomainId(0), bit_offset: 0, bit_length }, OBJECT)
    }

    #[test]
    fn values_are_checked_at_the_edges_of_their_range() {
        assert_eq!(bits(12).unsigned(0xFFF), Ok(0xFFF));
        assert_eq!(bits(12).unsigned(0x1000), Err(DoesNotFit { object: Some(OBJECT), value: 0x1000, bits: 12 }));
        assert_eq!(bits(64).unsigned(u64::MAX), Ok(u64::MAX));
        assert_eq!(bits(12).signed(-2048).map(|value| value & 0xFFF), Ok(0x800));
        assert_eq!(bits(12).signed(2047), Ok(2047));
        assert!(bits(12).signed(2048).is_err() && bits(12).signed(-2049).is_err());
        assert_eq!(bits(64).signed(i64::MIN), Ok(i64::MIN as u64));
        assert_eq!(bits(1).signed(-1).map(|value| value & 1), Ok(1));
        assert_eq!(bits(1).signed(1).unwrap_err().to_string(), "SubDevice 3: 0x7010:01: 1 does not fit into 1 bits");
    }
}
