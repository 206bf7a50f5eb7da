//! Values that a network file writes as text: times, shifts, bytes, MAC addresses.

use std::fmt;
use std::time::Duration;

use serde::de::{Deserialize, Deserializer, Error};

/// Units of times with their nanoseconds, the largest first.
const UNITS: [(&str, u64); 5] =
    [("min", 60_000_000_000), ("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1_000), ("ns", 1)];

/// A time with its unit: `250us`, `1ms`, `10s`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Time(pub Duration);

/// A time with its unit that may be negative: `-10us`, `0ns`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shift(pub i64);

/// Bytes as pairs of hexadecimal digits, with blanks between them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bytes(pub Vec<u8>);

/// A MAC address: `02:00:00:00:00:01`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mac(pub [u8; 6]);

/// Nanoseconds of a time without a sign.
fn nanoseconds(text: &str) -> Option<u64> {
    let at = text.find(|c: char| !c.is_ascii_digit())?;
    let (number, unit) = text.split_at(at);
    let (_, factor) = UNITS.iter().find(|(name, _)| *name == unit)?;
    number.parse::<u64>().ok()?.checked_mul(*factor)
}

fn write_time(ns: u64, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let fits = |factor: u64| ns.is_multiple_of(factor) && (ns > 0 || factor == 1);
    let (unit, factor) = UNITS.into_iter().find(|(_, factor)| fits(*factor)).unwrap_or(("ns", 1));
    write!(f, "{}{unit}", ns / factor)
}

impl Time {
    /// The time in a text.
    fn of(text: &str) -> Option<Time> {
        nanoseconds(text).map(|ns| Time(Duration::from_nanos(ns)))
    }
}

impl Shift {
    fn of(text: &str) -> Option<Shift> {
        let magnitude = text.strip_prefix('-').unwrap_or(text);
        let ns = i64::try_from(nanoseconds(magnitude)?).ok()?;
        Some(Shift(if magnitude.len() < text.len() { -ns } else { ns }))
    }
}

impl Bytes {
    fn of(text: &str) -> Option<Bytes> {
        let words = text.split_ascii_whitespace().flat_map(|word| word.as_bytes().chunks(2));
        let pairs = words.map(|pair| match pair {
            [_, _] => u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok().filter(|_| pair[0] != b'+'),
            _ => None,
        });
        pairs.collect::<Option<Vec<u8>>>().map(Bytes)
    }
}

impl Mac {
    fn of(text: &str) -> Option<Mac> {
        let mut bytes = [0; 6];
        let mut parts = text.split(':');
        for byte in &mut bytes {
            let part = parts.next().filter(|part| part.len() == 2 && !part.starts_with('+'))?;
            *byte = u8::from_str_radix(part, 16).ok()?;
        }
        parts.next().is_none().then_some(Mac(bytes))
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_time(u64::try_from(self.0.as_nanos()).unwrap_or(u64::MAX), f)
    }
}

impl fmt::Display for Shift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 < 0 {
            f.write_str("-")?;
        }
        write_time(self.0.unsigned_abs(), f)
    }
}

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, byte) in self.0.iter().enumerate() {
            write!(f, "{}{byte:02x}", if number > 0 { " " } else { "" })?;
        }
        Ok(())
    }
}

impl fmt::Display for Mac {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, e, g] = self.0;
        write!(f, "{a:02x}:{b:02x}:{c:02x}:{d:02x}:{e:02x}:{g:02x}")
    }
}

/// Reads a value from its text, and gives it a pattern in the JSON schema.
macro_rules! from_text {
    ($($kind:ident: $expected:literal, $pattern:literal;)*) => {$(
        impl<'de> Deserialize<'de> for $kind {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<$kind, D::Error> {
                let text = String::deserialize(deserializer)?;
                $kind::of(&text).ok_or_else(|| {
                    D::Error::custom(format!("expected {}, got \"{}\"", $expected, text.escape_debug()))
                })
            }
        }

        #[cfg(test)]
        impl schemars::JsonSchema for $kind {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($kind).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({ "type": "string", "pattern": $pattern })
            }
        }
    )*};
}

from_text! {
    Time: "a time with ns, us, ms, s or min behind it, as in \"500us\"", "^[0-9]+(ns|us|ms|s|min)$";
    Shift: "a time that may have a minus, as in \"-10us\"", "^-?[0-9]+(ns|us|ms|s|min)$";
    Bytes: "pairs of hexadecimal digits, as in \"e8 03\"", "^\\s*([0-9A-Fa-f]{2}\\s*)*$";
    Mac: "six pairs of hexadecimal digits, as in \"02:00:00:00:00:01\"", "^([0-9A-Fa-f]{2}:){5}[0-9A-Fa-f]{2}$";
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: network-file
    #[test]
    fn times_bytes_and_addresses_are_written_as_they_are_read() {
        for text in ["0ns", "1ns", "250us", "1ms", "1500us", "10s", "90s", "5min"] {
            assert_eq!(Time::of(text).expect("a time").to_string(), text);
        }
        for text in ["-10us", "0ns", "1ms"] {
            assert_eq!(Shift::of(text).expect("a shift").to_string(), text);
        }
        assert_eq!(Shift::of("-0s"), Some(Shift(0)));
        assert_eq!(Bytes::of("e803").expect("bytes").to_string(), "e8 03");
        assert_eq!(Mac::of("02:00:00:00:00:aF").expect("an address").to_string(), "02:00:00:00:00:af");
        for wrong in ["", "1", "ms", "1.5ms", "+1ms", "--1ms", "18446744073709551615s", "1 ms"] {
            assert_eq!((Time::of(wrong), Shift::of(wrong)), (None, None), "{wrong}");
        }
        assert_eq!([Bytes::of("e"), Bytes::of("+1"), Bytes::of("e8 0"), Bytes::of("ä")], [const { None }; 4]);
        // Blanks separate bytes: "0 1" is neither the byte 01 nor two bytes.
        assert_eq!([Bytes::of("0 1"), Bytes::of("e8 0 3"), Bytes::of("e 803")], [const { None }; 3]);
        assert_eq!([Mac::of("02:00"), Mac::of("02:00:00:00:00:01:02"), Mac::of("2:0:0:0:0:1")], [None; 3]);
    }
}
