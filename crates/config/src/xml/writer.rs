//! Writes elements, one per line, indented.

use std::fmt::{self, Display, Write};

/// A text of elements.
#[derive(Debug)]
pub(crate) struct Writer {
    text: String,
    depth: usize,
}

impl Writer {
    /// A text with its declaration; UTF-8.
    pub fn new() -> Writer {
        Writer { text: String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"), depth: 0 }
    }

    pub fn into_text(self) -> String {
        self.text
    }

    fn line(&mut self, text: fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{:width$}{text}", "", width = 2 * self.depth);
    }

    /// A comment; two hyphens end none.
    pub fn comment(&mut self, text: &str) {
        let text = escaped(text).replace("--", "- -");
        self.line(format_args!("<!-- {text} -->"));
    }

    /// The begin of an element, with its attributes as they are.
    pub fn open(&mut self, tag: impl Display) {
        self.line(format_args!("<{tag}>"));
        self.depth += 1;
    }

    pub fn close(&mut self, name: &str) {
        self.depth = self.depth.saturating_sub(1);
        self.line(format_args!("</{name}>"));
    }

    /// An element with children.
    pub fn within(&mut self, name: &str, children: impl FnOnce(&mut Writer)) {
        self.open(name);
        children(self);
        self.close(name);
    }

    /// An element with a text.
    pub fn leaf(&mut self, name: &str, text: impl Display) {
        let text = escaped(&text.to_string());
        self.line(format_args!("<{name}>{text}</{name}>"));
    }

    /// An element with attributes as they are, and a text.
    pub fn leaf_with(&mut self, name: &str, attributes: &str, text: impl Display) {
        let text = escaped(&text.to_string());
        self.line(format_args!("<{name}{attributes}>{text}</{name}>"));
    }

    /// An element without content.
    pub fn empty(&mut self, tag: impl Display) {
        self.line(format_args!("<{tag}/>"));
    }

    /// An element with a text, if there is one.
    pub fn some(&mut self, name: &str, text: Option<impl Display>) {
        if let Some(text) = text {
            self.leaf(name, text);
        }
    }

    /// An element with bytes.
    pub fn hex(&mut self, name: &str, bytes: &[u8]) {
        let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        self.leaf(name, digits);
    }
}

/// A text with the characters of XML replaced; control characters become blanks.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            control if control.is_control() => out.push(' '),
            other => out.push(other),
        }
    }
    out
}
