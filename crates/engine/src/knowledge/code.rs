//! Values as bytes: numbers little-endian, an option behind a byte 0 or 1, a list behind its length in four bytes.
//!
//! Decoding allocates for a list only after it has checked that the rest of the input is long enough for it, so memory
//! is bounded by the length of the input.

use alloc::string::String;
use alloc::vec::Vec;

use super::error::KnowledgeError;

/// Most bytes of memory for one byte of input.
pub(super) const MOST_GROWTH: usize = 32;

/// Bytes that are being decoded.
pub(super) struct Input<'a> {
    bytes: &'a [u8],
    /// Offset of the byte behind the last one.
    end: usize,
}

impl<'a> Input<'a> {
    /// All of these bytes, the first of which has this offset.
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Input<'a> {
        Input { bytes, end: at + bytes.len() }
    }

    /// An error at the present place.
    #[inline]
    pub(super) fn expected(&self, expected: &'static str) -> KnowledgeError {
        KnowledgeError { offset: self.end - self.bytes.len(), expected }
    }

    /// Bytes that are left.
    #[inline]
    pub(super) fn left(&self) -> usize {
        self.bytes.len()
    }

    /// The next bytes.
    #[inline]
    pub(super) fn bytes(&mut self, count: usize, expected: &'static str) -> Result<&'a [u8], KnowledgeError> {
        let (first, rest) = self.bytes.split_at_checked(count).ok_or(self.expected(expected))?;
        self.bytes = rest;
        Ok(first)
    }

    /// The next bytes, of a known number.
    #[inline]
    pub(super) fn array<const N: usize>(&mut self, expected: &'static str) -> Result<[u8; N], KnowledgeError> {
        let (first, rest) = self.bytes.split_first_chunk().ok_or(self.expected(expected))?;
        self.bytes = rest;
        Ok(*first)
    }
}

/// A value with a form in bytes.
pub(super) trait Code: Sized {
    /// Fewest bytes of a value.
    const LEAST: usize;

    /// Appends the bytes of the value.
    fn put(&self, out: &mut Vec<u8>);

    /// Takes a value from the input.
    fn take(input: &mut Input<'_>) -> Result<Self, KnowledgeError>;

    /// Appends the bytes of several values.
    fn put_all(values: &[Self], out: &mut Vec<u8>) {
        values.iter().for_each(|value| value.put(out));
    }

    /// Takes this number of values, for which the input is long enough.
    fn take_all(input: &mut Input<'_>, count: usize) -> Result<Vec<Self>, KnowledgeError> {
        let mut values = Vec::with_capacity(count);
        for _ in 0..count {
            values.push(Self::take(input)?);
        }
        Ok(values)
    }
}

impl Code for u8 {
    const LEAST: usize = 1;

    #[inline]
    fn put(&self, out: &mut Vec<u8>) {
        out.push(*self);
    }

    #[inline]
    fn take(input: &mut Input<'_>) -> Result<u8, KnowledgeError> {
        let [byte] = input.array("a byte")?;
        Ok(byte)
    }

    fn put_all(values: &[u8], out: &mut Vec<u8>) {
        out.extend_from_slice(values);
    }

    fn take_all(input: &mut Input<'_>, count: usize) -> Result<Vec<u8>, KnowledgeError> {
        Ok(input.bytes(count, "bytes that are no longer than the rest")?.to_vec())
    }
}

macro_rules! numbers {
    ($($kind:ty, $what:literal;)*) => {$(
        impl Code for $kind {
            const LEAST: usize = size_of::<$kind>();

            #[inline]
            fn put(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            #[inline]
            fn take(input: &mut Input<'_>) -> Result<Self, KnowledgeError> {
                Ok(<$kind>::from_le_bytes(input.array($what)?))
            }
        }
    )*};
}

numbers! {
    u16, "two bytes";
    i16, "two bytes";
    u32, "four bytes";
    u64, "eight bytes";
    i64, "eight bytes";
}

impl Code for bool {
    const LEAST: usize = 1;

    #[inline]
    fn put(&self, out: &mut Vec<u8>) {
        out.push((*self).into());
    }

    #[inline]
    fn take(input: &mut Input<'_>) -> Result<bool, KnowledgeError> {
        let error = input.expected("0 or 1");
        match u8::take(input)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(error),
        }
    }
}

/// Offsets and lengths of an EEPROM, positions: 32 bits are enough.
impl Code for usize {
    const LEAST: usize = 4;

    #[inline]
    fn put(&self, out: &mut Vec<u8>) {
        u32::try_from(*self).unwrap_or(u32::MAX).put(out);
    }

    #[inline]
    fn take(input: &mut Input<'_>) -> Result<usize, KnowledgeError> {
        Ok(u32::take(input)? as usize)
    }
}

impl<T: Code> Code for Option<T> {
    const LEAST: usize = 1;

    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(input: &mut Input<'_>) -> Result<Option<T>, KnowledgeError> {
        bool::take(input)?.then(|| T::take(input)).transpose()
    }
}

impl<T: Code> Code for Vec<T> {
    const LEAST: usize = 4;

    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        T::put_all(self, out);
    }

    fn take(input: &mut Input<'_>) -> Result<Vec<T>, KnowledgeError> {
        const { assert!(T::LEAST > 0 && size_of::<T>() <= MOST_GROWTH * T::LEAST, "too much memory for a byte") };
        let error = input.expected("a list that is no longer than the rest");
        let count = usize::take(input)?;
        if count > input.left() / T::LEAST {
            return Err(error);
        }
        T::take_all(input, count)
    }
}

impl Code for String {
    const LEAST: usize = 4;

    #[inline]
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        out.extend_from_slice(self.as_bytes());
    }

    #[inline]
    fn take(input: &mut Input<'_>) -> Result<String, KnowledgeError> {
        let count = usize::take(input)?;
        let error = input.expected("text in UTF-8");
        let bytes = input.bytes(count, "a text that is no longer than the rest")?;
        core::str::from_utf8(bytes).map(String::from).map_err(|_| error)
    }
}

impl<T: Code, const N: usize> Code for [T; N]
where
    T: Copy + Default,
{
    const LEAST: usize = N * T::LEAST;

    fn put(&self, out: &mut Vec<u8>) {
        T::put_all(self, out);
    }

    fn take(input: &mut Input<'_>) -> Result<[T; N], KnowledgeError> {
        let mut values = [T::default(); N];
        for value in &mut values {
            *value = T::take(input)?;
        }
        Ok(values)
    }
}

impl<A: Code, B: Code> Code for (A, B) {
    const LEAST: usize = A::LEAST + B::LEAST;

    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }

    fn take(input: &mut Input<'_>) -> Result<(A, B), KnowledgeError> {
        Ok((A::take(input)?, B::take(input)?))
    }
}

/// A structure: its fields one after the other.
macro_rules! fields {
    ($kind:ty { $($field:ident: $of:ty),* $(,)? }) => {
        impl $crate::knowledge::code::Code for $kind {
            const LEAST: usize = 0 $(+ <$of as $crate::knowledge::code::Code>::LEAST)*;

            fn put(&self, out: &mut alloc::vec::Vec<u8>) {
                $(<$of as $crate::knowledge::code::Code>::put(&self.$field, out);)*
            }

            fn take(
                input: &mut $crate::knowledge::code::Input<'_>,
            ) -> Result<Self, $crate::knowledge::error::KnowledgeError> {
                Ok(Self { $($field: <$of as $crate::knowledge::code::Code>::take(input)?),* })
            }
        }
    };
}

/// A value with a number on the wire.
macro_rules! by_number {
    ($kind:ty, $number:ty, $to:expr, $from:expr) => {
        impl $crate::knowledge::code::Code for $kind {
            const LEAST: usize = <$number as $crate::knowledge::code::Code>::LEAST;

            fn put(&self, out: &mut alloc::vec::Vec<u8>) {
                let to: fn(&$kind) -> $number = $to;
                $crate::knowledge::code::Code::put(&to(self), out);
            }

            fn take(
                input: &mut $crate::knowledge::code::Input<'_>,
            ) -> Result<Self, $crate::knowledge::error::KnowledgeError> {
                let from: fn($number) -> $kind = $from;
                Ok(from(<$number as $crate::knowledge::code::Code>::take(input)?))
            }
        }
    };
}

/// One of several: its number, and the fields of this one.
macro_rules! choice {
    ($kind:ident, $what:literal { $($number:literal = $name:ident $({ $($field:ident: $of:ty),* })?),* $(,)? }) => {
        impl $crate::knowledge::code::Code for $kind {
            const LEAST: usize = 1;

            fn put(&self, out: &mut alloc::vec::Vec<u8>) {
                match self {
                    $($kind::$name $({ $($field),* })? => {
                        out.push($number);
                        $($(<$of as $crate::knowledge::code::Code>::put($field, out);)*)?
                    })*
                }
            }

            fn take(
                input: &mut $crate::knowledge::code::Input<'_>,
            ) -> Result<Self, $crate::knowledge::error::KnowledgeError> {
                let error = input.expected($what);
                Ok(match <u8 as $crate::knowledge::code::Code>::take(input)? {
                    $($number => $kind::$name $({
                        $($field: <$of as $crate::knowledge::code::Code>::take(input)?),*
                    })?,)*
                    _ => return Err(error),
                })
            }
        }
    };
}

pub(super) use {by_number, choice, fields};
