//! Newtypes for addresses and numbers on the wire. Each conversion exists once.

use core::fmt;

macro_rules! newtype {
    ($(#[$doc:meta])* $name:ident($inner:ty), $format:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub $inner);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, $format, self.0)
            }
        }
    };
}

newtype!(
    /// Configured station address (register 0x0010) or alias (register 0x0012) of a SubDevice.
    StationAddress(u16), "{:#06x}"
);
newtype!(
    /// Position of a SubDevice in the order in which a frame passes the EtherCAT processing units, starting at 0.
    Position(u16), "{}"
);
newtype!(
    /// Address in the 64 KiB address space of a SubDevice controller.
    RegisterAddress(u16), "{:#06x}"
);
newtype!(
    /// Byte address in the 4 GiB logical address space of a segment.
    LogicalAddress(u32), "{:#010x}"
);
newtype!(
    /// Working counter of a datagram (protocol 1.4).
    Wkc(u16), "{}"
);

impl Position {
    /// The ADP value for a datagram to the SubDevice at this position: it arrives there as zero, because every
    /// processing unit before it adds one (protocol 1.4).
    pub const fn auto_increment(self) -> u16 {
        0u16.wrapping_sub(self.0)
    }
}

impl Wkc {
    /// Sum of the working counters of the two copies of a datagram (protocol CR-05), wrapping as on the wire.
    #[must_use]
    pub const fn plus(self, other: Wkc) -> Wkc {
        Wkc(self.0.wrapping_add(other.0))
    }
}

impl RegisterAddress {
    /// The address `offset` bytes higher, wrapping at the end of the address space.
    #[must_use]
    pub const fn offset(self, offset: u16) -> RegisterAddress {
        RegisterAddress(self.0.wrapping_add(offset))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_third_subdevice_has_auto_increment_address_minus_two() {
        assert_eq!(Position(2).auto_increment(), 0xFFFE);
        assert_eq!(Position(0).auto_increment(), 0);
    }
}
