//! Category STRINGS: the number of strings, then length and characters of each string (protocol 4.2).

/// The strings of an image, with indices starting at 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Strings<'a> {
    count: u8,
    data: &'a [u8],
}

impl<'a> Strings<'a> {
    /// Reads the data of a category.
    pub const fn new(data: &'a [u8]) -> Strings<'a> {
        match data.split_first() {
            Some((count, data)) => Strings { count: *count, data },
            None => Strings { count: 0, data },
        }
    }

    /// Number of strings in the category header.
    pub const fn count(&self) -> u8 {
        self.count
    }

    /// The characters of a string; `None` for index 0 ("no string"), an index above the count, and a string that
    /// extends beyond the category.
    pub fn string(&self, index: u8) -> Option<&'a [u8]> {
        self.iter().nth(usize::from(index.checked_sub(1)?))
    }

    /// All strings in order, starting at index 1. Ends at a string that extends beyond the category.
    pub const fn iter(&self) -> StringsIter<'a> {
        StringsIter { left: self.count, data: self.data }
    }
}

impl<'a> IntoIterator for Strings<'a> {
    type Item = &'a [u8];
    type IntoIter = StringsIter<'a>;

    fn into_iter(self) -> StringsIter<'a> {
        self.iter()
    }
}

/// Iterator over the strings of a category.
#[derive(Clone, Debug)]
pub struct StringsIter<'a> {
    left: u8,
    data: &'a [u8],
}

impl<'a> Iterator for StringsIter<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        self.left = self.left.checked_sub(1)?;
        let (length, rest) = self.data.split_first()?;
        let (string, rest) = rest.split_at_checked(usize::from(*length))?;
        self.data = rest;
        Some(string)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Three strings, the second one empty, and a padding byte.
    const LITERAL: [u8; 14] = [3, 6, b'E', b'K', b'1', b'1', b'0', b'0', 0, 3, b'B', b'u', b's', 0];

    // covers: codec-sii
    #[test]
    fn index_1_is_the_first_string_and_index_0_is_none() {
        let strings = Strings::new(&LITERAL);
        assert_eq!(strings.count(), 3);
        assert_eq!(strings.string(0), None);
        assert_eq!(strings.string(1), Some(b"EK1100".as_slice()));
        assert_eq!(strings.string(2), Some(b"".as_slice()));
        assert_eq!(strings.string(3), Some(b"Bus".as_slice()));
        assert_eq!(strings.string(4), None);
    }

    #[test]
    fn a_string_beyond_the_category_ends_the_strings() {
        let strings = Strings::new(&[2, 1, b'a', 9, b'b']);
        assert_eq!(strings.iter().collect::<Vec<_>>(), [b"a"]);
        assert_eq!(strings.string(2), None);
        assert_eq!(Strings::new(&[]).iter().next(), None);
    }
}
