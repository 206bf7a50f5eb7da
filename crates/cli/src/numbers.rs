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
    let parsed = match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    parsed.ok_or_else(|| "expected a number of 32 bits, decimal or 0x and hexadecimal digits".to_owned())
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
}
