//! An element of the file with typed access to its content. Errors contain line, column and the path from the root.

use std::cell::{Cell, RefCell};
use std::fmt::Display;
use std::net::Ipv4Addr;

use roxmltree::Node;

use super::error::{EniError, Problem};
use super::model::Unknown;
use crate::xml::{Lines, MAX_UNKNOWN, Place, shown};

/// Data shared by all elements of a file.
pub(super) struct File<'a> {
    lines: Lines<'a>,
    unknown: RefCell<Vec<Unknown>>,
    more_unknown: Cell<usize>,
}

impl<'a> File<'a> {
    pub fn new(text: &'a str) -> File<'a> {
        File { lines: Lines::new(text), unknown: RefCell::default(), more_unknown: Cell::default() }
    }

    pub fn place(&self, at: usize) -> Place {
        self.lines.place(at)
    }

    /// Unknown elements, and the number of those that are not listed.
    pub fn into_unknown(self) -> (Vec<Unknown>, usize) {
        (self.unknown.into_inner(), self.more_unknown.get())
    }
}

/// An element.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    node: Node<'a, 'a>,
    file: &'a File<'a>,
}

impl<'a> Element<'a> {
    pub fn new(node: Node<'a, 'a>, file: &'a File<'a>) -> Element<'a> {
        Element { node, file }
    }

    pub fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    pub fn place(&self) -> Place {
        self.file.place(self.node.range().start)
    }

    fn elements(&self) -> impl Iterator<Item = Element<'a>> + use<'a> {
        let file = self.file;
        self.node.children().filter(Node::is_element).map(move |node| Element { node, file })
    }

    /// The first child with this name.
    pub fn child(&self, name: &str) -> Option<Element<'a>> {
        self.elements().find(|child| child.name() == name)
    }

    /// All children with this name.
    pub fn children(&self, name: &'static str) -> impl Iterator<Item = Element<'a>> + use<'a> {
        self.elements().filter(move |child| child.name() == name)
    }

    /// All children, in document order.
    pub fn all(&self) -> impl Iterator<Item = Element<'a>> + use<'a> {
        self.elements()
    }

    /// The child with this name, or an error that it is missing.
    pub fn required(&self, name: &'static str) -> Result<Element<'a>, EniError> {
        self.child(name).ok_or_else(|| self.error(Problem::Missing { element: name }))
    }

    /// Notes children whose names are not in this list.
    pub fn expects(&self, names: &[&str]) {
        for child in self.elements().filter(|child| !names.contains(&child.name())) {
            child.note_unknown();
        }
    }

    /// Notes this element as unknown.
    pub fn note_unknown(&self) {
        let mut unknown = self.file.unknown.borrow_mut();
        if unknown.len() < MAX_UNKNOWN {
            unknown.push(Unknown { place: self.place(), element: self.path() });
        } else {
            self.file.more_unknown.set(self.file.more_unknown.get() + 1);
        }
    }

    /// Text of the element, including CDATA, trimmed.
    pub fn text(&self) -> String {
        let texts = self.node.children().filter(Node::is_text).filter_map(|node| node.text());
        texts.collect::<String>().trim().to_owned()
    }

    /// Text of a child on one line, so that a name does not split a message; empty if there is no such child.
    pub fn text_of(&self, name: &str) -> String {
        let text = self.child(name).map(|child| child.text()).unwrap_or_default();
        text.chars().map(|character| if character.is_control() { ' ' } else { character }).collect()
    }

    /// The element's text as a number.
    pub fn number<T: TryFrom<i64> + Bound>(&self) -> Result<T, EniError> {
        let text = self.text();
        let parsed = number(&text).and_then(|value| T::try_from(value).ok());
        parsed.ok_or_else(|| {
            let expected = format!("a number from {} to {}", T::LOWEST, T::HIGHEST);
            self.error(Problem::Value { expected, got: shown(&text) })
        })
    }

    /// The number in a child; `None` if the child is missing or empty.
    pub fn number_of<T: TryFrom<i64> + Bound>(&self, name: &str) -> Result<Option<T>, EniError> {
        match self.child(name) {
            Some(child) if !child.text().is_empty() => child.number().map(Some),
            _ => Ok(None),
        }
    }

    /// The 32 bits of an id in a child; old tools write those above 2^31 as negative numbers (protocol ES-113).
    pub fn id_of(&self, name: &str) -> Result<Option<u32>, EniError> {
        match self.child(name).and_then(|child| number(&child.text())) {
            Some(value) if value < 0 && i32::try_from(value).is_ok() => Ok(Some(value as u32)),
            _ => self.number_of(name),
        }
    }

    /// The number in a required child.
    pub fn required_number<T: TryFrom<i64> + Bound>(&self, name: &'static str) -> Result<T, EniError> {
        self.required(name)?.number()
    }

    /// The element's text as a boolean.
    pub fn flag(&self) -> Result<bool, EniError> {
        let text = self.text();
        flag(&text).ok_or_else(|| self.error(Problem::Value { expected: FLAGS.to_owned(), got: shown(&text) }))
    }

    /// The boolean in a child; false if the child is missing, true if it is empty.
    pub fn flag_of(&self, name: &str) -> Result<bool, EniError> {
        match self.child(name) {
            None => Ok(false),
            Some(child) if child.text().is_empty() => Ok(true),
            Some(child) => child.flag(),
        }
    }

    /// The boolean in an attribute; false if the attribute is missing.
    pub fn flag_in(&self, attribute: &str) -> Result<bool, EniError> {
        let Some(text) = self.attribute(attribute) else { return Ok(false) };
        let expected = || format!("{FLAGS} in the attribute {attribute}");
        flag(text.trim()).ok_or_else(|| self.error(Problem::Value { expected: expected(), got: shown(text) }))
    }

    /// An attribute.
    pub fn attribute(&self, name: &str) -> Option<&'a str> {
        self.node.attributes().find(|attribute| attribute.name() == name).map(|attribute| attribute.value())
    }

    /// The element's text as hexadecimal bytes, with optional blanks or MAC address separators.
    pub fn hex(&self) -> Result<Vec<u8>, EniError> {
        let text = self.text();
        hex(&text).ok_or_else(|| {
            let expected = "bytes as pairs of hexadecimal digits".to_owned();
            self.error(Problem::Value { expected, got: shown(&text) })
        })
    }

    /// Bytes in a child; `None` if the child is missing.
    pub fn hex_of(&self, name: &str) -> Result<Option<Vec<u8>>, EniError> {
        self.child(name).map(|child| child.hex()).transpose()
    }

    /// The four bytes of an IP address in a child, in hexadecimal or in dotted decimal form.
    pub fn ip_of(&self, name: &str) -> Result<Option<Vec<u8>>, EniError> {
        match self.child(name).map(|child| (child, child.text())) {
            Some((child, text)) if text.contains('.') => match text.parse::<Ipv4Addr>() {
                Ok(address) => Ok(Some(address.octets().to_vec())),
                Err(_) => Err(child.wrong("an IP address")),
            },
            _ => self.hex_of(name),
        }
    }

    /// An error about this element.
    pub fn error(&self, problem: Problem) -> EniError {
        EniError { place: Some(self.place()), element: self.path(), problem }
    }

    /// An error about the value of this element.
    pub fn wrong(&self, expected: impl Display) -> EniError {
        self.error(Problem::Value { expected: expected.to_string(), got: shown(&self.text()) })
    }

    /// The path from the root, without the root: `Config/Slave[2] "EL2008"/Info`.
    pub fn path(&self) -> String {
        let mut parts: Vec<String> = Vec::new();
        let mut node = Some(self.node);
        while let Some(element) = node.filter(Node::is_element) {
            if element.parent_element().is_some() {
                parts.push(Element { node: element, file: self.file }.step());
            }
            node = element.parent();
        }
        parts.reverse();
        parts.join("/")
    }

    /// Name, number among siblings of the same name, and the element's own name.
    fn step(&self) -> String {
        let name = self.name();
        let same = |node: &Node<'_, '_>| node.is_element() && node.tag_name().name() == name;
        let before = self.node.prev_siblings().skip(1).filter(same).count();
        let alone = before == 0 && !self.node.next_siblings().skip(1).any(|node| same(&node));
        let number = if alone { String::new() } else { format!("[{}]", before + 1) };
        let itself = match name {
            "Slave" => self.child("Info").map(|info| info.text_of("Name")),
            "InitCmd" | "Cmd" => Some(self.text_of("Comment")),
            _ => None,
        };
        let itself = itself.filter(|text| !text.is_empty()).map(|text| format!(" {}", shown(&text)));
        format!("{name}{number}{}", itself.unwrap_or_default())
    }
}

const FLAGS: &str = "0, 1, true or false";

fn flag(text: &str) -> Option<bool> {
    match text {
        "1" | "true" | "True" | "TRUE" => Some(true),
        "0" | "false" | "False" | "FALSE" => Some(false),
        _ => None,
    }
}

/// Decimal, or hexadecimal with the prefix `#x` or `0x`.
fn number(text: &str) -> Option<i64> {
    let hexadecimal = ["#x", "#X", "0x", "0X"].iter().find_map(|prefix| text.strip_prefix(prefix));
    match hexadecimal {
        Some(digits) if digits.bytes().all(|byte| byte.is_ascii_hexdigit()) => i64::from_str_radix(digits, 16).ok(),
        Some(_) => None,
        None => text.parse().ok(),
    }
}

/// Pairs of hexadecimal digits.
fn hex(text: &str) -> Option<Vec<u8>> {
    let text = ["#x", "#X", "0x", "0X"].iter().find_map(|prefix| text.strip_prefix(prefix)).unwrap_or(text);
    let separator = |c: &char| c.is_whitespace() || matches!(c, ':' | '-');
    let digits: Option<Vec<u8>> =
        text.chars().filter(|c| !separator(c)).map(|c| c.to_digit(16).map(|digit| digit as u8)).collect();
    let digits = digits.filter(|digits| digits.len().is_multiple_of(2))?;
    Some(digits.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]).collect())
}

/// Bounds of a number type, for messages.
pub(super) trait Bound {
    const LOWEST: i64;
    const HIGHEST: i64;
}

macro_rules! bounds {
    ($($number:ty),+) => {
        $(impl Bound for $number {
            const LOWEST: i64 = <$number>::MIN as i64;
            const HIGHEST: i64 = <$number>::MAX as i64;
        })+
    };
}

bounds!(u8, u16, u32, i32);
