//! Values of the file in messages.

/// Characters of a wrong value shown in a message.
const SHOWN: usize = 40;

/// A value for messages: quoted, on one line, limited in length.
pub(crate) fn shown(value: &str) -> String {
    let mut text: String = value.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    if value.chars().nth(SHOWN).is_some() {
        text.push_str("...");
    }
    format!("\"{text}\"")
}
