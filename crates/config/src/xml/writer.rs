//! Elements to the text of a file: escaped, indented, well-formed whatever the texts hold.

use std::fmt::Display;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};

/// Columns of a level.
const INDENT: usize = 2;

/// A text of elements.
pub(crate) struct Elements {
    writer: Writer<Vec<u8>>,
}

impl Elements {
    /// A text with its declaration; UTF-8.
    pub fn new() -> Elements {
        let mut elements = Elements { writer: Writer::new_with_indent(Vec::new(), b' ', INDENT) };
        elements.put(Event::Decl(BytesDecl::new("1.0", Some("utf-8"), None)));
        elements
    }

    pub fn into_text(self) -> String {
        let mut bytes = self.writer.into_inner();
        bytes.push(b'\n');
        String::from_utf8_lossy(&bytes).into_owned()
    }

    fn put(&mut self, event: Event<'_>) {
        // A write to memory cannot fail.
        let _ = self.writer.write_event(event);
    }

    /// A comment.
    pub fn comment(&mut self, text: &str) {
        // Two hyphens would end it; a blank before and behind it keeps a hyphen from its ends.
        let text = format!(" {} ", one_line(text).replace("--", "- -"));
        self.put(Event::Comment(BytesText::from_escaped(text)));
    }

    /// An element with children.
    pub fn within(&mut self, name: &str, children: impl FnOnce(&mut Elements)) {
        self.with(name, &[], children);
    }

    /// An element with attributes and children.
    pub fn with(&mut self, name: &str, attributes: &[(&str, &str)], children: impl FnOnce(&mut Elements)) {
        let start = BytesStart::new(name).with_attributes(attributes.iter().copied());
        self.put(Event::Start(start));
        children(self);
        self.put(Event::End(BytesEnd::new(name)));
    }

    /// An element with a text, on one line.
    pub fn leaf(&mut self, name: &str, text: impl Display) {
        let text = one_line(&text.to_string());
        self.put(Event::Start(BytesStart::new(name)));
        self.put(Event::Text(BytesText::new(&text)));
        self.put(Event::End(BytesEnd::new(name)));
    }

    /// An element with a text, if there is one.
    pub fn some(&mut self, name: &str, text: Option<impl Display>) {
        if let Some(text) = text {
            self.leaf(name, text);
        }
    }

    /// An element with a text that is not empty.
    pub fn text(&mut self, name: &str, text: &str) {
        if !text.is_empty() {
            self.leaf(name, text);
        }
    }

    /// An element with bytes.
    pub fn hex(&mut self, name: &str, bytes: &[u8]) {
        let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        self.leaf(name, digits);
    }
}

/// A text as the readers give it: without control characters and outer blanks. Characters that XML does not permit are
/// replaced.
pub(crate) fn one_line(text: &str) -> String {
    let permitted = |character: char| match character {
        '\u{FFFE}' | '\u{FFFF}' => char::REPLACEMENT_CHARACTER,
        control if control.is_control() => ' ',
        other => other,
    };
    text.chars().map(permitted).collect::<String>().trim().to_owned()
}
