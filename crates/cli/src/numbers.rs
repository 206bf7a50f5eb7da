//! Numbers on the command line.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Parses a number in a range; errors give the range and an example.
pub fn number<T>(range: RangeInclusive<T>, example: T) -> impl Fn(&str) -> Result<T, String> + Clone
where
    T: FromStr + PartialOrd + Display + Clone,
{
    move |text| {
        let number = text.parse::<T>().ok().filter(|number| range.contains(number));
        let (least, most) = (range.start(), range.end());
        number.ok_or_else(|| format!("expected a number from {least} to {most}, as in {example}"))
    }
}

/// Decimal, or hexadecimal with `0x`.
pub fn number_of_32_bits(text: &str) -> Result<u32, String> {
    of_bits(text, 32)
}

/// Decimal, or hexadecimal with `0x`.
pub fn number_of_16_bits(text: &str) -> Result<u16, String> {
    of_bits(text, 16)
}

fn of_bits<T: TryFrom<u64>>(text: &str, bits: u32) -> Result<T, String> {
    let is_number = |digits: &str| !digits.starts_with('+');
    let parsed = match text.strip_prefix("0x") {
        Some(digits) if is_number(digits) => u64::from_str_radix(digits, 16).ok(),
        Some(_) => None,
        None => text.parse().ok(),
    };
    let number = parsed.and_then(|number| T::try_from(number).ok());
    number.ok_or_else(|| format!("expected a number of {bits} bits, decimal or 0x and hexadecimal digits"))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: run
    #[test]
    fn a_number_that_is_none_or_out_of_range_is_refused_with_an_example() {
        let parse = number(1u8..=98, 80);
        assert_eq!(parse("98"), Ok(98));
        for text in ["", "0", "99", "300", "-1", "0x10", "ten", "1.5"] {
            assert_eq!(parse(text), Err("expected a number from 1 to 98, as in 80".to_owned()), "{text}");
        }
    }

    // covers: esi-use
    #[test]
    fn numbers_of_devices_are_decimal_or_hexadecimal() {
        assert_eq!((number_of_16_bits("0x1F"), number_of_16_bits("65535")), (Ok(31), Ok(65_535)));
        assert_eq!((number_of_32_bits("0xFFFFFFFF"), number_of_32_bits("7")), (Ok(u32::MAX), Ok(7)));
        for text in ["", "0x", "0x+1", "0x10000", "65536", "-1", "1F"] {
            let error = number_of_16_bits(text).expect_err(text);
            assert_eq!(error, "expected a number of 16 bits, decimal or 0x and hexadecimal digits");
        }
        assert!(number_of_32_bits("0x100000000").is_err());
    }
}
