//! Values of a file in messages.

/// Characters of a wrong value that are shown.
const SHOWN: usize = 40;

/// A value as messages show it: quoted, on one line, not too long.
pub(crate) fn shown(value: &str) -> String {
    let mut text: String = value.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    if value.chars().nth(SHOWN).is_some() {
        text.push_str("...");
    }
    format!("\"{text}\"")
}
