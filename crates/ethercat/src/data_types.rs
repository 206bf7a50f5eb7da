//! Data types of objects, registers and IDNs: values as users write and read them.

use serde::Serialize;

use crate::failure::Failure;
use crate::hex;
use crate::numbers;

/// How the bytes of a type are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bool,
    Signed,
    Unsigned,
    SignMagnitude,
    Float,
    Text,
    Octets,
    Unicode,
    Raw,
}

/// A data type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DataType {
    /// Its name.
    pub name: &'static str,
    /// Its code in dictionaries; `None` where it has none.
    pub code: Option<u16>,
    /// Its bytes; 0 for any number.
    pub bytes: usize,
    kind: Kind,
}

/// A value as JSON has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Scalar {
    /// A number of `bool`, an unsigned type.
    Unsigned(u64),
    /// A number of a signed type.
    Signed(i64),
    /// A `float`; null where it is no finite number.
    Float(f32),
    /// A `double`; null where it is no finite number.
    Double(f64),
    /// A `string` in UTF-8.
    Text(String),
    /// Bytes, or a `string` that is not UTF-8.
    Nothing,
}

const fn of(name: &'static str, code: u16, bytes: usize, kind: Kind) -> DataType {
    DataType { name, code: if code == 0 { None } else { Some(code) }, bytes, kind }
}

/// All data types.
pub const ALL: [DataType; 27] = [
    of("bool", 0x01, 1, Kind::Bool),
    of("int8", 0x02, 1, Kind::Signed),
    of("int16", 0x03, 2, Kind::Signed),
    of("int32", 0x04, 4, Kind::Signed),
    of("uint8", 0x05, 1, Kind::Unsigned),
    of("uint16", 0x06, 2, Kind::Unsigned),
    of("uint32", 0x07, 4, Kind::Unsigned),
    of("float", 0x08, 4, Kind::Float),
    of("string", 0x09, 0, Kind::Text),
    of("octet_string", 0x0A, 0, Kind::Octets),
    of("unicode_string", 0x0B, 0, Kind::Unicode),
    of("int24", 0x10, 3, Kind::Signed),
    of("double", 0x11, 8, Kind::Float),
    of("int40", 0x12, 5, Kind::Signed),
    of("int48", 0x13, 6, Kind::Signed),
    of("int56", 0x14, 7, Kind::Signed),
    of("int64", 0x15, 8, Kind::Signed),
    of("uint24", 0x16, 3, Kind::Unsigned),
    of("uint40", 0x18, 5, Kind::Unsigned),
    of("uint48", 0x19, 6, Kind::Unsigned),
    of("uint56", 0x1A, 7, Kind::Unsigned),
    of("uint64", 0x1B, 8, Kind::Unsigned),
    of("sm8", 0, 1, Kind::SignMagnitude),
    of("sm16", 0, 2, Kind::SignMagnitude),
    of("sm32", 0, 4, Kind::SignMagnitude),
    of("sm64", 0, 8, Kind::SignMagnitude),
    of("raw", 0, 0, Kind::Raw),
];

/// The type with a name.
///
/// # Errors
/// No type has this name.
pub fn named(name: &str) -> Result<DataType, Failure> {
    let found = ALL.into_iter().find(|data_type| data_type.name == name);
    found.ok_or_else(|| Failure::usage(format!("Invalid data type '{name}'!")))
}

/// The type with a code in dictionaries.
pub fn coded(code: u16) -> Option<DataType> {
    ALL.into_iter().find(|data_type| data_type.code == Some(code))
}

impl DataType {
    /// Sizes for which a number is printed; other sizes are printed as bytes.
    fn is_number(self) -> bool {
        matches!(self.bytes, 1 | 2 | 4 | 8)
    }

    /// What is printed for a value.
    ///
    /// # Errors
    /// The value has another size than the type.
    pub fn show(self, value: &[u8]) -> Result<Vec<u8>, Failure> {
        self.check(value)?;
        let (bits, width) = (little_endian(value), 2 * self.bytes);
        Ok(match self.kind {
            Kind::Text => [value, b"\n"].concat(),
            Kind::Octets => value.to_vec(),
            Kind::Unicode => [value, b"\n"].concat(),
            Kind::Float => format!("{}\n", general(self.float(bits))).into_bytes(),
            Kind::Bool | Kind::Unsigned if self.is_number() => format!("0x{bits:0width$x} {bits}\n").into_bytes(),
            Kind::Signed if self.is_number() => {
                format!("0x{bits:0width$x} {}\n", extended(bits, self.bytes)).into_bytes()
            }
            Kind::SignMagnitude => format!("0x{bits:0width$x} {}\n", self.sign_magnitude(bits)).into_bytes(),
            Kind::Bool | Kind::Unsigned | Kind::Signed | Kind::Raw => format!("{}\n", hex::listed(value)).into_bytes(),
        })
    }

    /// The value for JSON.
    ///
    /// # Errors
    /// The value has another size than the type.
    pub fn value(self, value: &[u8]) -> Result<Scalar, Failure> {
        self.check(value)?;
        let bits = little_endian(value);
        Ok(match self.kind {
            Kind::Bool | Kind::Unsigned => Scalar::Unsigned(bits),
            Kind::Signed => Scalar::Signed(extended(bits, self.bytes)),
            Kind::SignMagnitude => Scalar::Signed(self.sign_magnitude(bits)),
            Kind::Float if self.bytes == 4 => Scalar::Float(f32::from_bits(bits as u32)),
            Kind::Float => Scalar::Double(f64::from_bits(bits)),
            Kind::Text => str::from_utf8(value).map_or(Scalar::Nothing, |text| Scalar::Text(text.to_owned())),
            Kind::Octets | Kind::Unicode | Kind::Raw => Scalar::Nothing,
        })
    }

    fn check(self, value: &[u8]) -> Result<(), Failure> {
        if self.bytes == 0 || self.bytes == value.len() {
            return Ok(());
        }
        let (expected, got) = (self.bytes, value.len());
        let text = format!("Data type mismatch. Expected {} with {expected} byte, but got {got} byte.", self.name);
        Err(Failure::failed(text))
    }

    fn float(self, bits: u64) -> f64 {
        if self.bytes == 4 { f32::from_bits(bits as u32).into() } else { f64::from_bits(bits) }
    }

    fn sign_bit(self) -> u64 {
        1 << (8 * self.bytes as u32 - 1)
    }

    fn sign_magnitude(self, bits: u64) -> i64 {
        let magnitude = (bits & (self.sign_bit() - 1)) as i64;
        if bits & self.sign_bit() == 0 { magnitude } else { -magnitude }
    }

    /// The bytes of a value that a user writes.
    ///
    /// # Errors
    /// It is no value of the type, or out of its range.
    pub fn read(self, text: &str) -> Result<Vec<u8>, Failure> {
        let value = self.encode(text);
        value.ok_or_else(|| Failure::usage(format!("Invalid value argument '{text}' for type '{}'!", self.name)))
    }

    fn encode(self, text: &str) -> Option<Vec<u8>> {
        let bits = match self.kind {
            Kind::Text | Kind::Octets | Kind::Unicode => return Some(text.as_bytes().to_vec()),
            Kind::Raw => {
                let bytes = text.split([' ', ',']).filter(|part| !part.is_empty()).map(numbers::parse::<u8>);
                return bytes.collect();
            }
            Kind::Bool => numbers::parse::<u64>(text).filter(|value| *value <= 1)?,
            Kind::Unsigned => numbers::parse::<u64>(text).filter(|value| value >> 1 >> (8 * self.bytes - 1) == 0)?,
            Kind::Signed => {
                let value = numbers::parse_signed::<i64>(text)?;
                (extended(value as u64, self.bytes) == value).then_some(value as u64)?
            }
            Kind::SignMagnitude => {
                let value = numbers::parse_signed::<i64>(text)?;
                let magnitude = value.unsigned_abs();
                let sign = if value < 0 { self.sign_bit() } else { 0 };
                (magnitude < self.sign_bit()).then_some(magnitude | sign)?
            }
            // A value behind the largest one would be written as infinity.
            Kind::Float if self.bytes == 4 => {
                let value = text.trim().parse::<f32>().ok().filter(|value| value.is_finite())?;
                u64::from(value.to_bits())
            }
            Kind::Float => text.trim().parse::<f64>().ok().filter(|value| value.is_finite())?.to_bits(),
        };
        Some(bits.to_le_bytes()[..self.bytes].to_vec())
    }

    /// Whether its values are bytes as they are, so that a file may hold one.
    pub fn is_text(self) -> bool {
        matches!(self.kind, Kind::Text | Kind::Octets | Kind::Unicode | Kind::Raw)
    }
}

/// At most eight bytes as a number.
fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().take(8).rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}

/// A number of this many bytes with its sign.
fn extended(bits: u64, bytes: usize) -> i64 {
    let unused = 64 - 8 * bytes as u32;
    (bits << unused) as i64 >> unused
}

/// A number with six significant digits, as `%g` of C prints it.
fn general(value: f64) -> String {
    const DIGITS: i32 = 6;
    if value.is_nan() {
        return if value.is_sign_negative() { "-nan" } else { "nan" }.to_owned();
    }
    if value.is_infinite() {
        return if value < 0.0 { "-inf" } else { "inf" }.to_owned();
    }
    // Rounding may carry into another power of ten, so the exponent is that of the rounded number.
    let scientific = format!("{value:.*e}", DIGITS as usize - 1);
    let (digits, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-4..DIGITS).contains(&exponent) {
        return trimmed(&format!("{value:.*}", (DIGITS - 1 - exponent) as usize)).to_owned();
    }
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{}e{sign}{:02}", trimmed(digits), exponent.abs())
}

/// Without zeros at the end of a fraction.
fn trimmed(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(name: &str, value: &[u8]) -> String {
        let shown = named(name).expect("it is a type").show(value).expect("it has the size");
        String::from_utf8(shown).expect("it is text")
    }

    fn read(name: &str, text: &str) -> Option<Vec<u8>> {
        named(name).expect("it is a type").read(text).ok()
    }

    // covers: daemon
    #[test]
    fn values_are_printed_as_users_know_them() {
        for (name, value, text) in [
            ("int32", &[5, 0, 0, 0x80][..], "0x80000005 -2147483643\n"),
            ("uint32", &[2, 0, 0, 0], "0x00000002 2\n"),
            ("sm32", &[5, 0, 0, 0x80], "0x80000005 -5\n"),
            ("sm64", &[5, 0, 0, 0, 0, 0, 0, 0x80], "0x8000000000000005 -5\n"),
            ("bool", &[1], "0x01 1\n"),
            ("int8", &[0xFF], "0xff -1\n"),
            ("uint64", &[0xFF; 8], "0xffffffffffffffff 18446744073709551615\n"),
            ("uint24", &[0x11, 0x22, 0x33], "0x11 0x22 0x33\n"),
            ("float", &[2, 0, 0, 0], "2.8026e-45\n"),
            ("double", &716.532_f64.to_le_bytes(), "716.532\n"),
            ("string", b"EL3102", "EL3102\n"),
            ("octet_string", b"EL3102", "EL3102"),
            ("raw", &[1, 2], "0x01 0x02\n"),
        ] {
            assert_eq!(shown(name, value), text, "{name}");
        }
        let failure = named("uint8").expect("it is a type").show(&[1, 2, 3, 4]).expect_err("it has another size");
        assert_eq!(failure.text(), "Data type mismatch. Expected uint8 with 1 byte, but got 4 byte.\n");
    }

    // covers: daemon
    #[test]
    fn values_are_numbers_or_text_in_json() {
        for (name, value, json) in [
            ("int32", &[5, 0, 0, 0x80][..], "-2147483643"),
            ("sm16", &[5, 0x80], "-5"),
            ("bool", &[1], "1"),
            ("int24", &[0xFF; 3], "-1"),
            ("uint24", &[0x11, 0x22, 0x33], "3351057"),
            ("uint64", &[0xFF; 8], "18446744073709551615"),
            ("float", &0.1_f32.to_le_bytes(), "0.1"),
            ("float", &f32::NAN.to_le_bytes(), "null"),
            ("double", &716.532_f64.to_le_bytes(), "716.532"),
            ("string", b"a\"\x01", r#""a\"\u0001""#),
            ("string", &[0xFF], "null"),
            ("octet_string", b"ab", "null"),
            ("unicode_string", b"a\0", "null"),
            ("raw", &[1], "null"),
        ] {
            let value = named(name).expect("it is a type").value(value).expect("it has the size");
            assert_eq!(serde_json::to_string(&value).expect("it is JSON"), json, "{name}");
        }
        assert!(named("uint8").expect("it is a type").value(&[1, 2]).is_err());
    }

    // covers: daemon
    #[test]
    fn general_numbers_are_those_of_c() {
        for (value, text) in [
            (0.0, "0"),
            (-1.5, "-1.5"),
            (100_000.0, "100000"),
            (999_999.5, "1e+06"),
            (1_000_000.0, "1e+06"),
            (0.0001, "0.0001"),
            (0.000_012_345_678, "1.23457e-05"),
            (1e100, "1e+100"),
            (f64::NAN, "nan"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(general(value), text);
        }
    }

    // covers: daemon
    #[test]
    fn values_are_read_within_their_ranges() {
        assert_eq!(read("uint8", "300"), None);
        assert_eq!(read("uint8", "0xff"), Some(vec![255]));
        assert_eq!(read("uint64", "18446744073709551615"), Some(vec![255; 8]));
        assert_eq!((read("int8", "-128"), read("int8", "128")), (Some(vec![0x80]), None));
        assert_eq!((read("int24", "-1"), read("int24", "0x800000")), (Some(vec![255; 3]), None));
        assert_eq!((read("sm16", "-5"), read("sm16", "32768")), (Some(vec![5, 0x80]), None));
        assert_eq!((read("bool", "1"), read("bool", "2"), read("bool", "")), (Some(vec![1]), None, None));
        for (name, text) in [("float", "1e39"), ("double", "1e309"), ("float", "nan"), ("double", "inf")] {
            assert_eq!(read(name, text), None, "{name} {text}");
        }
        assert_eq!(read("float", "1.5"), Some(1.5_f32.to_le_bytes().to_vec()));
        assert_eq!((read("string", "ab"), read("raw", "0x01 2")), (Some(b"ab".to_vec()), Some(vec![1, 2])));
        assert!(named("int9").is_err());
    }

    // covers: daemon
    #[test]
    fn what_is_printed_is_read_again() {
        for data_type in ALL.into_iter().filter(|it| it.bytes != 0) {
            for seed in 0..200_u64 {
                let bits = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
                let value = bits.to_le_bytes()[..data_type.bytes].to_vec();
                let text = data_type.show(&value).expect("it has the size");
                let text = String::from_utf8(text).expect("it is text");
                // Six digits do not identify every float; negative zero has no number.
                let is_exact = !matches!(data_type.kind, Kind::Float) && data_type.is_number();
                let is_zero = data_type.kind == Kind::SignMagnitude && data_type.sign_magnitude(bits) == 0;
                let is_bool = data_type.kind == Kind::Bool && value[0] > 1;
                if let Some(number) = text.trim().split(' ').next_back().filter(|_| is_exact && !is_zero && !is_bool) {
                    assert_eq!(data_type.read(number).ok(), Some(value), "{data_type:?} {text}");
                }
            }
        }
    }
}
