//! Text of devices, files and other programs, as a terminal may show it.
//!
//! A name in an EEPROM or a file can contain characters that a terminal interprets as commands, or that change the
//! direction or the lines of a text (bidirectional formatting, line separators). Programs pass all text for operators
//! through [`visible`], and lines of JSON through [`visible_json`]. The one list of such characters is [`is_hidden`].

use std::fmt::Write;

/// Format characters and separators: first and last of each range.
const HIDDEN: [(char, char); 13] = [
    ('\u{AD}', '\u{AD}'),
    ('\u{61C}', '\u{61C}'),
    ('\u{180E}', '\u{180E}'),
    ('\u{200B}', '\u{200F}'),
    ('\u{2028}', '\u{202E}'),
    ('\u{2060}', '\u{206F}'),
    ('\u{FEFF}', '\u{FEFF}'),
    ('\u{FFF9}', '\u{FFFB}'),
    ('\u{13430}', '\u{1343F}'),
    ('\u{1BCA0}', '\u{1BCA3}'),
    ('\u{1D173}', '\u{1D17A}'),
    ('\u{E0000}', '\u{E00FF}'),
    // Variation selectors (U+E0100 to U+E01EF) belong to the character before them.
    ('\u{E01F0}', '\u{E0FFF}'),
];

/// Whether a character has no glyph of its own, but changes the state of a terminal, or the direction or the lines of a
/// text: control characters, line and paragraph separators, format characters (Unicode categories Cc, Zl, Zp, Cf). Not
/// hidden are line feeds and tabs, nor Arabic number signs and the Syriac abbreviation mark, which are visible.
#[inline(never)]
pub fn is_hidden(c: char) -> bool {
    if c < '\u{AD}' {
        return c.is_control() && c != '\n' && c != '\t';
    }
    HIDDEN.iter().any(|(first, last)| (*first..=*last).contains(&c))
}

/// A text with hidden characters as escape sequences of Rust (`\u{1b}`).
pub fn visible(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        // Writing to a string cannot fail.
        _ = match c {
            '\r' => shown.write_str("\\r"),
            '\0' => shown.write_str("\\0"),
            c if is_hidden(c) => write!(shown, "\\u{{{:x}}}", u32::from(c)),
            c => write!(shown, "{c}"),
        };
    }
    shown
}

/// A text in JSON with hidden characters as its escape sequences (`\u202e`). They are in strings only: elsewhere JSON
/// has none.
pub fn visible_json(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if !is_hidden(c) {
            shown.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut [0; 2]) {
            _ = write!(shown, "\\u{unit:04x}");
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: verdict
    #[test]
    fn control_characters_of_files_and_devices_are_escaped() {
        for text in ["", "plain", "two\nlines\tand a column", "Ger\u{e4}t \u{4e2d}\u{3000}e\u{301} \u{1F600}"] {
            assert_eq!((visible(text), visible_json(text)), (text.to_owned(), text.to_owned()));
        }
        let wild = "a\u{1b}[2Jb\u{9b}31m\r\u{7}\0\u{7f}\u{202e}\u{2066}c\n";
        assert_eq!(visible(wild), "a\\u{1b}[2Jb\\u{9b}31m\\r\\u{7}\\0\\u{7f}\\u{202e}\\u{2066}c\n");
    }

    // covers: verdict
    #[test]
    fn separators_and_format_characters_are_escaped_in_text_and_in_json() {
        let hidden = "\u{ad}\u{61c}\u{180e}\u{200b}\u{200d}\u{200e}\u{200f}\u{2028}\u{2029}\u{202a}\u{2060}\u{206f}\
                      \u{feff}\u{fff9}\u{1d173}\u{e0001}\u{e007f}";
        for c in hidden.chars() {
            let text = format!("a{c}b");
            assert_eq!(visible(&text), format!("a\\u{{{:x}}}b", u32::from(c)));
        }
        assert_eq!(visible_json("\"\u{7f}\u{200f}\u{2028}\u{e0001}\""), r#""\u007f\u200f\u2028\udb40\udc01""#);
    }
}
