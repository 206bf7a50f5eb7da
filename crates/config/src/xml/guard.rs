//! A first pass over the text that limits the work of the XML reader: depth, attributes and namespaces, which the
//! reader processes in quadratic time. It does not check well-formedness; the reader does.

use super::error::{Place, XmlError, XmlProblem};
use super::limits::{MAX_ATTRIBUTES, MAX_DEPTH};

/// Why a file with a document type is refused.
pub(super) const NO_DOCUMENT_TYPE: &str = "a document type definition (DTD), which can define entities, is not read";

/// Refuses a text with more levels or attributes than such files have.
pub(crate) fn check(text: &str) -> Result<(), XmlError> {
    let bytes = text.as_bytes();
    let mut depth = 0_usize;
    let mut namespaces = 0_usize;
    let mut at = 0;
    while let Some(begin) = find(bytes, at, b"<") {
        let rest = &bytes[begin..];
        at = if rest.starts_with(b"<!--") {
            find(bytes, begin + 4, b"-->").map_or(bytes.len(), |end| end + 3)
        } else if rest.starts_with(b"<![CDATA[") {
            find(bytes, begin + 9, b"]]>").map_or(bytes.len(), |end| end + 3)
        } else if rest.starts_with(b"<?") {
            find(bytes, begin + 2, b"?>").map_or(bytes.len(), |end| end + 2)
        } else if rest.starts_with(b"<!DOCTYPE") {
            // Its entities would be counted as elements.
            let reason = NO_DOCUMENT_TYPE.to_owned();
            return Err(XmlError::at(place(text, begin), XmlProblem::Syntax { reason }));
        } else {
            let tag = Tag::read(bytes, begin);
            namespaces += tag.namespaces;
            match tag.kind {
                TagKind::Open => depth += 1,
                TagKind::Close => depth = depth.saturating_sub(1),
                TagKind::Empty => {}
            }
            let limit = |what, limit| Err(XmlError::at(place(text, begin), XmlProblem::TooMuch { what, limit }));
            if depth > MAX_DEPTH {
                return limit("levels of elements", MAX_DEPTH);
            }
            if tag.attributes > MAX_ATTRIBUTES {
                return limit("attributes of an element", MAX_ATTRIBUTES);
            }
            if namespaces > MAX_ATTRIBUTES {
                return limit("namespaces", MAX_ATTRIBUTES);
            }
            tag.end
        };
    }
    Ok(())
}

enum TagKind {
    Open,
    Close,
    Empty,
}

struct Tag {
    kind: TagKind,
    attributes: usize,
    namespaces: usize,
    end: usize,
}

impl Tag {
    /// From `<` to the byte after `>`; an attribute is counted by its `=` outside of quotes.
    fn read(bytes: &[u8], begin: usize) -> Tag {
        let mut tag = Tag { kind: TagKind::Open, attributes: 0, namespaces: 0, end: bytes.len() };
        if bytes.get(begin + 1) == Some(&b'/') {
            tag.kind = TagKind::Close;
        }
        let mut quote = None;
        for (at, byte) in bytes.iter().enumerate().skip(begin + 1) {
            match (quote, byte) {
                (Some(open), byte) if open == byte => quote = None,
                (Some(_), _) => {}
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'=') => tag.attributes += 1,
                (None, b'x') if bytes[at..].starts_with(b"xmlns") => tag.namespaces += 1,
                (None, b'>') => {
                    if bytes[at - 1] == b'/' {
                        tag.kind = TagKind::Empty;
                    }
                    tag.end = at + 1;
                    break;
                }
                (None, _) => {}
            }
        }
        tag
    }
}

/// Position of `what` at or after `from`.
fn find(bytes: &[u8], from: usize, what: &[u8]) -> Option<usize> {
    let first = *what.first()?;
    let mut at = from;
    loop {
        at += bytes.get(at..)?.iter().position(|byte| *byte == first)?;
        if bytes[at..].starts_with(what) {
            return Some(at);
        }
        at += 1;
    }
}

fn place(text: &str, at: usize) -> Place {
    let before = text.get(..at).unwrap_or(text);
    let begin = before.rfind('\n').map_or(0, |at| at + 1);
    let line = before.matches('\n').count() + 1;
    Place { line: line as u32, column: (before[begin..].chars().count() + 1) as u32 }
}
