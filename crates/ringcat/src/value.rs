//! Rust types of objects, registers and process data: little endian, as EtherCAT has them.

/// Number types of process data, objects and registers: `bool`, `u8` to `u64`, `i8` to `i64`, `f32` and `f64`.
///
/// A `bool` is one bit of process data and one byte of an object.
pub trait Number: Copy + Send + 'static + sealed::Sealed {
    /// Name of the type in messages.
    const NAME: &'static str;
    /// Number of bits in process data.
    const BITS: u16;
    /// Number of bytes in an object or a register.
    const BYTES: usize;

    /// Decodes the lower [`Number::BITS`] bits.
    fn from_bits(bits: u64) -> Self;

    /// Encodes into the lower [`Number::BITS`] bits.
    fn to_bits(self) -> u64;
}

/// What an object holds: a [`Number`], bytes, or text.
pub trait ObjectValue: Sized + Send + 'static {
    /// Size of the object in bytes; `None` if any size is allowed.
    const BYTES: Option<usize>;

    /// Decodes the bytes of an object; their number is [`ObjectValue::BYTES`], if it is given.
    fn decode(bytes: Vec<u8>) -> Self;

    /// Encodes the bytes of an object.
    fn encode(self) -> Vec<u8>;
}

mod sealed {
    pub trait Sealed {}
}

macro_rules! numbers {
    ($($type:ident: $bits:literal, $bytes:literal, |$from:ident| $decode:expr, |$to:ident| $encode:expr;)*) => {$(
        impl sealed::Sealed for $type {}

        impl Number for $type {
            const NAME: &'static str = stringify!($type);
            const BITS: u16 = $bits;
            const BYTES: usize = $bytes;

            fn from_bits($from: u64) -> $type {
                $decode
            }

            fn to_bits(self) -> u64 {
                let $to = self;
                $encode
            }
        }

        impl ObjectValue for $type {
            const BYTES: Option<usize> = Some($bytes);

            fn decode(bytes: Vec<u8>) -> $type {
                let mut all = [0; 8];
                all[..$bytes].copy_from_slice(&bytes[..$bytes]);
                <$type as Number>::from_bits(u64::from_le_bytes(all))
            }

            fn encode(self) -> Vec<u8> {
                Number::to_bits(self).to_le_bytes()[..$bytes].to_vec()
            }
        }
    )*};
}

numbers! {
    bool: 1, 1, |bits| bits != 0, |value| u64::from(value);
    u8: 8, 1, |bits| bits as u8, |value| u64::from(value);
    u16: 16, 2, |bits| bits as u16, |value| u64::from(value);
    u32: 32, 4, |bits| bits as u32, |value| u64::from(value);
    u64: 64, 8, |bits| bits, |value| value;
    i8: 8, 1, |bits| bits as i8, |value| u64::from(value as u8);
    i16: 16, 2, |bits| bits as i16, |value| u64::from(value as u16);
    i32: 32, 4, |bits| bits as i32, |value| u64::from(value as u32);
    i64: 64, 8, |bits| bits as i64, |value| value as u64;
    f32: 32, 4, |bits| f32::from_bits(bits as u32), |value| u64::from(value.to_bits());
    f64: 64, 8, |bits| f64::from_bits(bits), |value| value.to_bits();
}

impl ObjectValue for Vec<u8> {
    const BYTES: Option<usize> = None;

    fn decode(bytes: Vec<u8>) -> Vec<u8> {
        bytes
    }

    fn encode(self) -> Vec<u8> {
        self
    }
}

/// A visible string. Bytes that are no UTF-8 become replacement characters; zeros at the end are padding.
impl ObjectValue for String {
    const BYTES: Option<usize> = None;

    fn decode(bytes: Vec<u8>) -> String {
        String::from_utf8_lossy(&bytes).trim_end_matches('\0').to_owned()
    }

    fn encode(self) -> Vec<u8> {
        self.into_bytes()
    }
}

impl<const N: usize> ObjectValue for [u8; N] {
    const BYTES: Option<usize> = Some(N);

    fn decode(bytes: Vec<u8>) -> [u8; N] {
        let mut all = [0; N];
        all.copy_from_slice(&bytes[..N]);
        all
    }

    fn encode(self) -> Vec<u8> {
        self.to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_from_bits_and_from_bytes() {
        assert_eq!(i16::from_bits((-2i16).to_bits()), -2);
        assert_eq!((-2i16).to_bits(), 0xFFFE);
        assert_eq!(<i32 as ObjectValue>::decode((-70_000i32).encode()), -70_000);
        assert_eq!(<f32 as ObjectValue>::decode(1.5f32.encode()), 1.5);
        assert_eq!((true.encode(), bool::from_bits(1)), (vec![1], true));
        assert_eq!(0x1234u16.encode(), [0x34, 0x12]);
        assert_eq!(String::decode(b"drive\0\0".to_vec()), "drive");
        assert_eq!(<[u8; 2]>::decode(vec![1, 2]), [1, 2]);
    }
}
