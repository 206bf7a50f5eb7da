//! Decodes the bytes of a file: byte order marks, UTF-8, UTF-16, and the one-byte encodings that an XML declaration
//! names.
//!
//! The reader ignores a declaration of UTF-16 in a file of single bytes: some tools write it by mistake.

use std::borrow::Cow;

use encoding_rs::{DecoderResult, Encoding, UTF_8, UTF_16BE, UTF_16LE};

use super::error::{Place, XmlError, XmlProblem};
use super::limits::MAX_BYTES;
use super::quoted::shown;

/// Bytes at the beginning that may contain the declaration.
const DECLARATION: usize = 256;

/// The text of a file.
pub(crate) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, XmlError> {
    if bytes.len() > MAX_BYTES {
        return Err(XmlError::of_file(XmlProblem::TooMuch { what: "bytes", limit: MAX_BYTES }));
    }
    other_widths(bytes)?;
    let (encoding, mark) = match Encoding::for_bom(bytes) {
        Some(found) => found,
        None => {
            ascii_only(bytes)?;
            (without_mark(bytes)?, 0)
        }
    };
    match encoding.decode_without_bom_handling_and_without_replacement(&bytes[mark..]) {
        Some(text) => Ok(text),
        None => Err(not_in(encoding, &bytes[mark..])),
    }
}

/// The text of a file that may declare a one-byte encoding although its bytes are UTF-8: then these count. The flag
/// says that this differs from the declaration.
pub(crate) fn decode_utf8_first(bytes: &[u8]) -> Result<(Cow<'_, str>, bool), XmlError> {
    let is_small = bytes.len() <= MAX_BYTES;
    if is_small
        && !bytes.is_ascii()
        && let Ok(text) = std::str::from_utf8(bytes)
        && Encoding::for_bom(bytes).is_none()
        && without_mark(bytes)? != UTF_8
    {
        return Ok((Cow::Borrowed(text), true));
    }
    decode(bytes).map(|text| (text, false))
}

/// A file that declares US-ASCII has no other bytes: decoders take the name for that of windows-1252.
fn ascii_only(bytes: &[u8]) -> Result<(), XmlError> {
    let Some(at) = bytes.iter().position(|byte| !byte.is_ascii()) else { return Ok(()) };
    let is_declared = declared(bytes).is_some_and(|label| {
        ["us-ascii", "ascii", "iso646-us", "ansi_x3.4-1968"].iter().any(|name| label.eq_ignore_ascii_case(name))
    });
    if !is_declared {
        return Ok(());
    }
    let byte = bytes[at];
    let reason = format!(
        "the byte {byte:#04x} is not in US-ASCII, which the file declares: save the file as UTF-8, or declare the \
         encoding that it has (windows-1252?)"
    );
    Err(XmlError::at(place(bytes, at), XmlProblem::Encoding { reason }))
}

/// Line and column of a byte; the line before it is UTF-8.
fn place(bytes: &[u8], at: usize) -> Place {
    let line = bytes[..at].iter().filter(|byte| **byte == b'\n').count() + 1;
    let begin = bytes[..at].iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
    let column = String::from_utf8_lossy(&bytes[begin..at]).chars().count() + 1;
    Place { line: line as u32, column: column as u32 }
}

/// Encodings that XML files of tools do not have, and that no declaration shows: UTF-32 with and without a byte order
/// mark, EBCDIC by the beginning `<?xm` of a declaration.
fn other_widths(bytes: &[u8]) -> Result<(), XmlError> {
    let encoding = match bytes {
        [0xFF, 0xFE, 0, 0, ..] | [b'<', 0, 0, 0, ..] => "UTF-32LE",
        [0, 0, 0xFE, 0xFF, ..] | [0, 0, 0, b'<', ..] => "UTF-32BE",
        [0x4C, 0x6F, 0xA7, 0x94, ..] => "EBCDIC",
        _ => return Ok(()),
    };
    let reason = format!("the bytes are in {encoding}, which is not read: save the file as UTF-8");
    Err(XmlError::at(Place { line: 1, column: 1 }, XmlProblem::Encoding { reason }))
}

/// The encoding of a file without byte order mark.
fn without_mark(bytes: &[u8]) -> Result<&'static Encoding, XmlError> {
    match bytes {
        [b'<', 0, ..] => return Ok(UTF_16LE),
        [0, b'<', ..] => return Ok(UTF_16BE),
        _ => {}
    }
    let Some(label) = declared(bytes) else { return Ok(UTF_8) };
    match Encoding::for_label(label.as_bytes()) {
        Some(encoding) if encoding == UTF_16LE || encoding == UTF_16BE => Ok(UTF_8),
        Some(encoding) => Ok(encoding),
        None => {
            let reason = format!("the encoding {} is not known: save the file as UTF-8", shown(&label));
            Err(XmlError::at(Place { line: 1, column: 1 }, XmlProblem::Encoding { reason }))
        }
    }
}

/// The encoding in the XML declaration.
fn declared(bytes: &[u8]) -> Option<String> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(DECLARATION)]);
    let declaration = head.trim_start().strip_prefix("<?xml")?.split("?>").next()?.to_owned();
    let value = declaration.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start().to_owned();
    let quote = value.chars().next().filter(|quote| matches!(quote, '"' | '\''))?;
    Some(value[1..].split(quote).next()?.to_owned())
}

/// The error for the first place that is not in the encoding.
fn not_in(encoding: &'static Encoding, bytes: &[u8]) -> XmlError {
    let is_wide = encoding == UTF_16LE || encoding == UTF_16BE;
    let begin: Vec<u8> = bytes.iter().copied().filter(|byte| !is_wide || *byte != 0).take(DECLARATION).collect();
    if begin.trim_ascii_start().first() != Some(&b'<') {
        return XmlError::of_file(XmlProblem::NotXml);
    }
    let name = encoding.name();
    let reason = if is_wide {
        format!("a character is not complete in {name}: the file is damaged or truncated; copy or export it again")
    } else {
        format!(
            "the bytes are not in {name}: save the file as UTF-8, or declare the encoding that it has (windows-1252?)"
        )
    };
    XmlError::at(end_of_text(encoding, bytes), XmlProblem::Encoding { reason })
}

/// The place behind the last character that can be decoded.
fn end_of_text(encoding: &'static Encoding, bytes: &[u8]) -> Place {
    let mut decoder = encoding.new_decoder_without_bom_handling();
    let (mut line, mut column, mut at) = (1_u32, 1_u32, 0);
    let mut buffer = [0_u8; 4096];
    loop {
        let rest = bytes.get(at..).unwrap_or_default();
        let (result, read, written) = decoder.decode_to_utf8_without_replacement(rest, &mut buffer, true);
        at += read;
        for c in String::from_utf8_lossy(&buffer[..written]).chars() {
            (line, column) = if c == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        if result != DecoderResult::OutputFull {
            return Place { line, column };
        }
    }
}
