//! Numbers in decimal, octal (`0` before) and hexadecimal (`0x` before), and lists of them with ranges.

/// A number that fits the type; `None` for anything else.
pub fn parse<T: TryFrom<u64>>(text: &str) -> Option<T> {
    parse_u64(text).and_then(|value| T::try_from(value).ok())
}

/// A number with a sign that fits the type; `None` for anything else.
pub fn parse_signed<T: TryFrom<i128>>(text: &str) -> Option<T> {
    let (is_negative, digits) = match text.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, text.strip_prefix('+').unwrap_or(text)),
    };
    let value = i128::from(parse_u64(digits)?);
    T::try_from(if is_negative { -value } else { value }).ok()
}

fn parse_u64(text: &str) -> Option<u64> {
    let hexadecimal = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let (digits, radix) = match hexadecimal {
        Some(digits) => (digits, 16),
        None if text.len() > 1 && text.starts_with('0') => (&text[1..], 8),
        None => (text, 10),
    };
    // A sign behind the prefix is no digit.
    let is_number = digits.chars().all(|digit| digit.is_digit(radix)) && !digits.is_empty();
    if is_number { u64::from_str_radix(digits, radix).ok() } else { None }
}

/// A list of numbers and ranges: `n`, `n-m`, `n-`, `-m`, `-`, with commas between them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct List(Vec<(u32, Option<u32>)>);

impl List {
    /// All numbers.
    pub fn all() -> List {
        List(vec![(0, None)])
    }

    /// Reads a list; `None` for any other text.
    pub fn parse(text: &str) -> Option<List> {
        text.split(',').map(range).collect::<Option<_>>().map(List)
    }

    /// Whether a number is in the list.
    pub fn has(&self, number: u32) -> bool {
        self.0.iter().any(|(first, last)| number >= *first && last.is_none_or(|last| number <= last))
    }

    /// Numbers that are named one by one.
    pub fn singles(&self) -> impl Iterator<Item = u32> {
        self.0.iter().filter(|(first, last)| *last == Some(*first)).map(|(first, _)| *first)
    }

    /// The only number of a list that names one.
    pub fn single(&self) -> Option<u32> {
        match &self.0[..] {
            [(first, Some(last))] if first == last => Some(*first),
            _ => None,
        }
    }
}

fn range(text: &str) -> Option<(u32, Option<u32>)> {
    match text.split_once('-') {
        None => parse(text).map(|number| (number, Some(number))),
        Some((first, last)) => {
            let first = if first.is_empty() { 0 } else { parse(first)? };
            let last = if last.is_empty() { None } else { Some(parse(last)?) };
            Some((first, last))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn numbers_have_three_bases_and_a_range() {
        for (text, value) in [("0", 0), ("10", 10), ("010", 8), ("0x1F", 31), ("0Xff", 255), ("65535", 65535)] {
            assert_eq!(parse::<u16>(text), Some(value), "{text}");
        }
        for text in ["", "-1", "65536", "08", "0x", "1 ", "0x-1", "+1", "x", "1e3"] {
            assert_eq!(parse::<u16>(text), None, "{text}");
        }
        let signed = ["-128", "0x7f", "-0x80", "+5", "128", "--1"].map(parse_signed::<i8>);
        assert_eq!(signed, [Some(-128), Some(127), Some(-128), Some(5), None, None]);
    }

    // covers: daemon
    #[test]
    fn lists_have_ranges_that_may_be_open() {
        let chosen = |text: &str| {
            let list = List::parse(text).expect("it is a list");
            (0..6).filter(|number| list.has(*number)).collect::<Vec<_>>()
        };
        assert_eq!(chosen("-"), [0, 1, 2, 3, 4, 5]);
        assert_eq!(chosen("-1"), [0, 1]);
        assert_eq!(chosen("4-"), [4, 5]);
        assert_eq!(chosen("1,3-4"), [1, 3, 4]);
        for text in ["", "a", "1,", "1--2", "1-x", ",", "4294967296"] {
            assert_eq!(List::parse(text), None, "{text}");
        }
        assert_eq!(List::parse("3").and_then(|list| list.single()), Some(3));
        assert_eq!(List::parse("3-4").and_then(|list| list.single()), None);
    }
}
