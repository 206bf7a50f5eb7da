//! Decodes the bytes of a file: byte order marks, UTF-8, UTF-16, and the one-byte encodings that an XML declaration
//! names.
//!
//! The reader ignores a declaration of UTF-16 in a file of single bytes: some tools write it by mistake.

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

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

/// The error for the first line that is not in the encoding.
fn not_in(encoding: &'static Encoding, bytes: &[u8]) -> XmlError {
    if bytes.trim_ascii_start().first() != Some(&b'<') {
        return XmlError::of_file(XmlProblem::NotXml);
    }
    let reason = format!(
        "the bytes are not in {}: save the file as UTF-8, or declare the encoding that it has (windows-1252?)",
        encoding.name()
    );
    let problem = XmlProblem::Encoding { reason };
    if encoding != UTF_8 {
        return XmlError::of_file(problem);
    }
    let valid = std::str::from_utf8(bytes).err().map_or(0, |error| error.valid_up_to());
    XmlError::at(place(bytes, valid), problem)
}
