//! Numbers, booleans and bytes as ESI files write them (protocol ES-11).

/// A number and whether its spelling is unusual (`0x10`, `#X10`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Number {
    pub value: i64,
    pub is_unusual: bool,
}

/// The valid range of any number: 32 bits, with or without a sign.
pub(super) const RANGE: std::ops::RangeInclusive<i64> = i32::MIN as i64..=u32::MAX as i64;

/// Decimal with an optional sign, or `#x` and hexadecimal digits; at most 32 bits.
pub(super) fn number(text: &str) -> Option<Number> {
    let text = text.trim();
    let prefixes = [("#x", false), ("#X", true), ("0x", true), ("0X", true)];
    let (value, is_unusual) = match prefixes.iter().find_map(|(mark, odd)| Some((text.strip_prefix(mark)?, *odd))) {
        Some((digits, odd)) if !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_hexdigit()) => {
            (i64::from_str_radix(digits, 16).ok()?, odd)
        }
        Some(_) => return None,
        None => (text.parse().ok()?, false),
    };
    RANGE.contains(&value).then_some(Number { value, is_unusual })
}

/// Both spellings of a boolean, in either case.
pub(super) fn flag(text: &str) -> Option<bool> {
    match text.trim() {
        "1" => Some(true),
        "0" => Some(false),
        word if word.eq_ignore_ascii_case("true") => Some(true),
        word if word.eq_ignore_ascii_case("false") => Some(false),
        _ => None,
    }
}

/// Pairs of hexadecimal digits in the order of memory; blanks between them do not count.
pub(super) fn hex(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 2);
    let mut high = None;
    for byte in text.bytes().filter(|byte| !byte.is_ascii_whitespace()) {
        let digit = (byte as char).to_digit(16)? as u8;
        match high.take() {
            None => high = Some(digit),
            Some(first) => bytes.push(first << 4 | digit),
        }
    }
    high.is_none().then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: ES-11, ES-170
    #[test]
    fn numbers_have_two_spellings_and_32_bits() {
        let read = |text| number(text).map(|it| (it.value, it.is_unusual));
        for (text, expected) in [
            ("#x1A00", Some((6656, false))),
            ("#X1a00", Some((6656, true))),
            ("6656", Some((6656, false))),
            (" 2 ", Some((2, false))),
            ("-2000", Some((-2000, false))),
            ("+5", Some((5, false))),
            ("#x", None),
            ("0x10", Some((16, true))),
            ("#x1334910000", None),
            ("1.5", None),
            ("", None),
        ] {
            assert_eq!(read(text), expected, "{text:?}");
        }
    }

    // covers: ES-11
    #[test]
    fn booleans_have_words_and_digits_and_bytes_come_in_pairs() {
        assert_eq!(["1", "true", "True", " 0 ", "FALSE"].map(flag), [true, true, true, false, false].map(Some));
        assert_eq!([flag("2"), flag("")], [None, None]);
        assert_eq!(hex("0A fF\n00"), Some(vec![0x0A, 0xFF, 0]));
        assert_eq!([hex("0A0"), hex("0G")], [None, None]);
    }
}
