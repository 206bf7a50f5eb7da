//! Bytes in hexadecimal, as commands print them.

use std::fmt::Write;

/// `0x01 0x02`.
pub fn listed(bytes: &[u8]) -> String {
    let all: Vec<String> = bytes.iter().map(|byte| format!("0x{byte:02x}")).collect();
    all.join(" ")
}

/// `0102ab` behind a text.
pub fn put_digits(text: &mut String, bytes: &[u8]) {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    text.reserve(2 * bytes.len());
    for digit in bytes.iter().flat_map(|byte| [byte >> 4, byte & 0x0F]) {
        text.push(char::from(DIGITS[usize::from(digit)]));
    }
}

/// `02:00:00:00:00:01`.
pub fn mac(address: &[u8; 6]) -> String {
    address.map(|byte| format!("{byte:02x}")).join(":")
}

/// Lines of at most 16 bytes, each with `indent` before and a blank behind each byte, as in `domains` and `config`.
pub fn lines(indent: &str, bytes: &[u8]) -> String {
    let mut text = String::new();
    for line in bytes.chunks(16) {
        text.push_str(indent);
        // Writing to a string cannot fail.
        line.iter().for_each(|byte| _ = write!(text, "{byte:02x} "));
        text.push('\n');
    }
    text
}

/// Lines of at most 16 bytes without a blank at their ends, as in `sii_read`.
pub fn trimmed_lines(indent: &str, bytes: &[u8]) -> String {
    let lines = lines(indent, bytes);
    lines.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn bytes_are_listed_and_broken_into_lines() {
        assert_eq!((listed(&[1, 0xAB]), listed(&[])), ("0x01 0xab".to_owned(), String::new()));
        assert_eq!(mac(&[2, 0, 0, 0, 0, 1]), "02:00:00:00:00:01");
        let mut text = "=".to_owned();
        put_digits(&mut text, &[1, 0xAB]);
        assert_eq!(text, "=01ab");
        let bytes: Vec<u8> = (0..17).collect();
        let first = "  00 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d 0e 0f";
        assert_eq!(lines("  ", &bytes), format!("{first} \n  10 \n"));
        assert_eq!(trimmed_lines("  ", &bytes), format!("{first}\n  10\n"));
    }
}
