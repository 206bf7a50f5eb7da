//! Macros that declare typed views of registers: bit fields, which keep all unnamed bits, and plain numbers.

/// A value that fills a bit field of a register.
pub(super) trait Field: Copy {
    /// From the field's bits, shifted down and masked.
    fn from_field(raw: u32) -> Self;
    /// To the field's bits; the caller cuts off bits beyond the field's width.
    fn to_field(self) -> u32;
}

impl Field for bool {
    fn from_field(raw: u32) -> bool {
        raw != 0
    }
    fn to_field(self) -> u32 {
        u32::from(self)
    }
}

impl Field for u8 {
    fn from_field(raw: u32) -> u8 {
        raw as u8
    }
    fn to_field(self) -> u32 {
        u32::from(self)
    }
}

impl Field for u16 {
    fn from_field(raw: u32) -> u16 {
        raw as u16
    }
    fn to_field(self) -> u32 {
        u32::from(self)
    }
}

impl Field for u32 {
    fn from_field(raw: u32) -> u32 {
        raw
    }
    fn to_field(self) -> u32 {
        self
    }
}

/// Mask of the lowest `width` bits (1..=32).
pub(super) const fn low_bits(width: u32) -> u32 {
    u32::MAX >> (32 - width)
}

/// Declares a register of named bit fields, `field: Type = lowest bit, width;`. Registers with unnamed bits are
/// declared with `reserved kept` and get a field for them.
macro_rules! bit_register {
    ($(#[$doc:meta])* $name:ident($bits:ty, reset $reset:literal $(, $reserved:ident kept)?) {
        $($(#[$field_doc:meta])* $field:ident: $type:ty = $shift:literal, $width:literal;)*
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: $type,)*
            $(
                /// All other bits, not shifted.
                pub $reserved: $bits,
            )?
        }

        impl $name {
            /// Bytes of the register.
            pub const LEN: usize = <$bits>::BITS as usize / 8;
            /// Value after a reset.
            pub const RESET: $bits = $reset;
            /// Mask of the bits that have a name.
            pub const NAMED: $bits = {
                let mut named = 0u32;
                $(named |= $crate::register::view::low_bits($width) << $shift;)*
                named as $bits
            };

            /// From the register's value.
            pub fn from_bits(bits: $bits) -> $name {
                use $crate::register::view::{Field, low_bits};
                $name {
                    $($field: <$type as Field>::from_field(u32::from(bits) >> $shift & low_bits($width)),)*
                    $($reserved: bits & !Self::NAMED,)?
                }
            }

            /// The register's value. Numbers that are too large for their field lose their upper bits.
            pub fn bits(self) -> $bits {
                use $crate::register::view::{Field, low_bits};
                let mut named = 0u32;
                $(named |= (Field::to_field(self.$field) & low_bits($width)) << $shift;)*
                let bits = named as $bits;
                $(let bits = bits | self.$reserved & !Self::NAMED;)?
                bits
            }

            /// From the register's bytes.
            pub fn decode(bytes: &[u8; Self::LEN]) -> $name {
                Self::from_bits(<$bits>::from_le_bytes(*bytes))
            }

            /// To the register's bytes.
            pub fn encode(&self) -> [u8; Self::LEN] {
                self.bits().to_le_bytes()
            }
        }

        impl Default for $name {
            /// The value after a reset.
            fn default() -> $name {
                $name::from_bits(Self::RESET)
            }
        }
    };
}

/// Declares a register that is one number.
macro_rules! number_register {
    ($(#[$doc:meta])* $name:ident($number:ty, reset $reset:literal)) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct $name(pub $number);

        impl $name {
            /// Value after a reset.
            pub const RESET: $number = $reset;
        }

        number_bytes!($name($number));

        impl Default for $name {
            /// The value after a reset.
            fn default() -> $name {
                $name(Self::RESET)
            }
        }
    };
}

/// Implements conversion to and from the bytes of a register for a newtype of a number.
macro_rules! number_bytes {
    ($name:ident($number:ty)) => {
        impl $name {
            /// Bytes of the register.
            pub const LEN: usize = <$number>::BITS as usize / 8;

            /// From the register's bytes.
            pub const fn decode(bytes: &[u8; Self::LEN]) -> $name {
                $name(<$number>::from_le_bytes(*bytes))
            }

            /// To the register's bytes.
            pub const fn encode(&self) -> [u8; Self::LEN] {
                self.0.to_le_bytes()
            }
        }
    };
}
