//! Values of variables by the types that ENIs name (IEC 61131-3, as in process images of protocol 8.1).

use std::fmt;

/// Interpretation of a variable's bits by its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum VariableType {
    /// `BOOL`, `BIT`.
    Bool,
    /// `SINT`, `INT`, `DINT`, `LINT`.
    Signed,
    /// `USINT`, `BYTE`, `UINT`, `WORD`, ... and `BIT2` to `BIT8`.
    Unsigned,
    /// `REAL`.
    Real,
    /// `LREAL`.
    LongReal,
    /// Arrays, strings, structures, types of vendors: bits.
    Other,
}

/// The value of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Value {
    /// A bit.
    Bool(bool),
    /// A signed number.
    Signed(i64),
    /// An unsigned number.
    Unsigned(u64),
    /// A number with a fraction.
    Real(f64),
    /// Bits of a type that is not known.
    Bits(u64),
}

impl VariableType {
    /// The type by its name, case-insensitive.
    pub fn named(name: &str) -> VariableType {
        match name.trim().to_ascii_uppercase().as_str() {
            "BOOL" | "BIT" => VariableType::Bool,
            "SINT" | "INT" | "DINT" | "LINT" | "INT8" | "INT16" | "INT24" | "INT32" | "INT64" => VariableType::Signed,
            "USINT" | "UINT" | "UDINT" | "ULINT" | "BYTE" | "WORD" | "DWORD" | "LWORD" | "UINT8" | "UINT16"
            | "UINT24" | "UINT32" | "UINT64" | "BIT2" | "BIT3" | "BIT4" | "BIT5" | "BIT6" | "BIT7" | "BIT8" => {
                VariableType::Unsigned
            }
            "REAL" | "FLOAT" => VariableType::Real,
            "LREAL" | "DOUBLE" => VariableType::LongReal,
            _ => VariableType::Other,
        }
    }

    /// The value of `length` bits; the bits above them are zero.
    pub fn value(self, bits: u64, length: u16) -> Value {
        match (self, length) {
            (VariableType::Bool, _) => Value::Bool(bits != 0),
            (VariableType::Signed, 1..=64) => {
                let unused = 64 - u32::from(length);
                Value::Signed(((bits << unused) as i64) >> unused)
            }
            (VariableType::Unsigned, _) => Value::Unsigned(bits),
            (VariableType::Real, 32) => Value::Real(f32::from_bits(bits as u32).into()),
            (VariableType::LongReal, 64) => Value::Real(f64::from_bits(bits)),
            _ => Value::Bits(bits),
        }
    }

    /// Parses a value from text (`true`, `-5`, `0x1F`, `2.5`) into bits. `None` if the text is not a value of this
    /// type, or needs more than `length` bits.
    pub fn parse(self, text: &str, length: u16) -> Option<u64> {
        let text = text.trim();
        let mask = if length >= 64 { u64::MAX } else { (1 << length) - 1 };
        match (self, text.to_ascii_lowercase().as_str()) {
            (VariableType::Bool, "true" | "on") => return Some(1),
            (VariableType::Bool, "false" | "off") => return Some(0),
            (VariableType::Real, number) if length == 32 => {
                return number.parse().ok().map(|value: f32| value.to_bits().into());
            }
            (VariableType::LongReal, number) if length == 64 => return number.parse().ok().map(f64::to_bits),
            _ => {}
        }
        let hex = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
        let value: i128 = match hex {
            Some(digits) => i128::from(u64::from_str_radix(digits, 16).ok()?),
            None => text.parse().ok()?,
        };
        let (least, most) = match self {
            VariableType::Signed if hex.is_none() => (-(i128::from(mask / 2) + 1), i128::from(mask / 2)),
            _ => (0, i128::from(mask)),
        };
        (least..=most).contains(&value).then_some(value as u64 & mask)
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Bool(value) => value.fmt(f),
            Value::Signed(value) => value.fmt(f),
            Value::Unsigned(value) => value.fmt(f),
            Value::Real(value) => value.fmt(f),
            Value::Bits(value) => write!(f, "{value:#x}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: eni-run
    #[test]
    fn bits_become_values_by_the_type() {
        let value = |name: &str, bits, length| VariableType::named(name).value(bits, length).to_string();
        assert_eq!(value("BOOL", 1, 1), "true");
        assert_eq!(value("Int", 0xFFFE, 16), "-2");
        assert_eq!(value("UINT", 0xFFFE, 16), "65534");
        assert_eq!(value("REAL", 0xBFC0_0000, 32), "-1.5");
        assert_eq!(value("LREAL", 2.5f64.to_bits(), 64), "2.5");
        assert_eq!(value("ARRAY [0..1] OF BYTE", 0x1234, 16), "0x1234");
        assert_eq!(value("LINT", u64::MAX, 64), "-1");
    }

    // covers: eni-run
    #[test]
    fn a_written_value_becomes_bits_if_it_fits() {
        let bits = |name: &str, text: &str, length| VariableType::named(name).parse(text, length);
        assert_eq!(bits("BOOL", "true", 1), Some(1));
        assert_eq!(bits("INT", "-2", 16), Some(0xFFFE));
        assert_eq!(bits("INT", "0xFFFE", 16), Some(0xFFFE));
        assert_eq!(bits("REAL", "-1.5", 32), Some(0xBFC0_0000));
        assert_eq!(bits("ULINT", "0xFFFFFFFFFFFFFFFF", 64), Some(u64::MAX));
        for (name, text, length) in
            [("INT", "32768", 16), ("UINT", "-1", 16), ("BOOL", "2", 1), ("REAL", "fast", 32), ("BYTE", "0x100", 8)]
        {
            assert_eq!(bits(name, text, length), None, "{name} {text}");
        }
    }
}
