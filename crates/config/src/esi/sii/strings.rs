//! The strings of an image (protocol ES-86 to ES-89).

/// Maximum number of strings, and of characters in one.
const MOST: usize = 255;

/// Strings in the order of their indices, in Latin-1.
#[derive(Debug)]
pub(super) struct Strings {
    list: Vec<Vec<u8>>,
    /// Equal texts are stored once.
    shares: bool,
    /// Texts that were changed: characters that are not Latin-1, or too many.
    pub changed: Vec<String>,
    /// Texts for which there was no room.
    pub left_out: usize,
}

impl Strings {
    pub fn new(shares: bool) -> Strings {
        Strings { list: Vec::new(), shares, changed: Vec::new(), left_out: 0 }
    }

    /// The index of a text; 0 for an empty one.
    pub fn add(&mut self, text: &str) -> u8 {
        if text.is_empty() {
            return 0;
        }
        let mut bytes: Vec<u8> = text.chars().map(|it| u8::try_from(u32::from(it)).unwrap_or(b'?')).collect();
        let is_latin = text.chars().all(|character| u32::from(character) <= 0xFF);
        if !is_latin || bytes.len() > MOST {
            self.changed.push(text.to_owned());
            bytes.truncate(MOST);
        }
        if self.shares
            && let Some(at) = self.list.iter().position(|known| *known == bytes)
        {
            return u8::try_from(at + 1).unwrap_or(0);
        }
        if self.list.len() == MOST {
            self.left_out += 1;
            return 0;
        }
        self.list.push(bytes);
        u8::try_from(self.list.len()).unwrap_or(0)
    }

    /// The data of the category without padding; empty if there are no strings.
    pub fn bytes(&self) -> Vec<u8> {
        let mut data = Vec::new();
        if self.list.is_empty() {
            return data;
        }
        data.push(self.list.len() as u8);
        for text in &self.list {
            data.push(text.len() as u8);
            data.extend_from_slice(text);
        }
        data
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: ES-86, ES-88, ES-177
    #[test]
    fn strings_are_latin_1_and_shared() {
        let mut one = Strings::new(true);
        assert_eq!((one.add("A"), &one.bytes()[..]), (1, &[1, 1, 0x41][..]));
        let mut strings = Strings::new(true);
        assert!(strings.bytes().is_empty());
        assert_eq!([strings.add("AB"), strings.add(""), strings.add("10 \u{b5}s"), strings.add("AB")], [1, 0, 2, 1]);
        assert_eq!(strings.bytes(), b"\x02\x02AB\x0510 \xB5s");
        assert_eq!((strings.add("\u{3bc}"), strings.changed.len()), (3, 1));
        let mut each = Strings::new(false);
        assert_eq!([each.add("A"), each.add("A")], [1, 2]);
        let long = "x".repeat(300);
        assert_eq!(each.add(&long), 3);
        assert_eq!(each.bytes().len(), 1 + 2 + 2 + 1 + 255);
        (0..300).for_each(|n| _ = each.add(&n.to_string()));
        assert_eq!((each.bytes()[0], each.left_out), (255, 48));
    }
}
