//! An element of the file with typed access to its content, by path and never by "any descendant of this name":
//! `Device`, `InitCmd` and `Index` also occur deep inside vendor data (protocol ES-17).

use std::borrow::Cow;
use std::cell::RefCell;

use roxmltree::Node;

use super::error::{EsiError, EsiProblem, Notices};
use super::model::Names;
use super::number::{self, flag, hex};
use crate::xml::{Lines, shown};

/// LcId of a name without one: English (protocol ES-12).
const ENGLISH: u32 = 1033;

/// Data shared by all elements of a file.
pub(super) struct File<'a> {
    pub name: &'a str,
    lines: Lines<'a>,
    notices: RefCell<Notices>,
}

impl<'a> File<'a> {
    pub fn new(name: &'a str, text: &'a str) -> File<'a> {
        File { name, lines: Lines::new(text), notices: RefCell::default() }
    }

    pub fn into_notices(self) -> Notices {
        self.notices.into_inner()
    }

    pub fn note(&self, line: u32, text: String) {
        self.notices.borrow_mut().add(line, text);
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

    pub fn line(&self) -> u32 {
        self.file.lines.line(self.node.range().start)
    }

    /// All child elements in document order.
    pub fn all(&self) -> impl Iterator<Item = Element<'a>> + use<'a> {
        let file = self.file;
        self.node.children().filter(Node::is_element).map(move |node| Element { node, file })
    }

    /// Names of the element and of all elements in it, at any level.
    pub fn names_below(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.node.descendants().filter(Node::is_element).map(|node| node.tag_name().name())
    }

    pub fn child(&self, name: &str) -> Option<Element<'a>> {
        self.all().find(|child| child.name() == name)
    }

    pub fn children<'n>(&self, name: &'n str) -> impl Iterator<Item = Element<'a>> + use<'a, 'n> {
        self.all().filter(move |child| child.name() == name)
    }

    pub fn required(&self, name: &'static str) -> Result<Element<'a>, EsiError> {
        self.child(name).ok_or_else(|| self.error(EsiProblem::Missing { element: name }))
    }

    /// Text including CDATA, with leading and trailing blanks: they are part of identifying texts (protocol ES-13).
    pub fn raw(&self) -> Cow<'a, str> {
        let mut texts = self.node.children().filter(Node::is_text).filter_map(|node| node.text());
        let first = texts.next().unwrap_or_default();
        match texts.next() {
            None => Cow::Borrowed(first),
            Some(second) => Cow::Owned([first, second].into_iter().chain(texts).collect()),
        }
    }

    /// Text on one line; trailing line breaks of the layout are not part of it.
    pub fn text(&self) -> String {
        let raw = self.raw();
        if raw.contains(char::is_control) {
            return raw.trim().replace(char::is_control, " ");
        }
        raw.into_owned()
    }

    /// Text of a child; empty if there is none.
    pub fn text_of(&self, name: &str) -> String {
        self.child(name).map(|child| child.text()).unwrap_or_default()
    }

    pub fn attribute(&self, name: &str) -> Option<&'a str> {
        self.node.attribute(name)
    }

    /// The element's text as a number.
    pub fn number<T: TryFrom<i64>>(&self) -> Result<T, EsiError> {
        self.parsed(&self.raw(), None)
    }

    /// The number in a child; `None` if the child is missing. An empty one is an error (protocol ES-170).
    pub fn number_of<T: TryFrom<i64>>(&self, name: &str) -> Result<Option<T>, EsiError> {
        self.child(name).map(|child| child.number()).transpose()
    }

    pub fn required_number<T: TryFrom<i64>>(&self, name: &'static str) -> Result<T, EsiError> {
        self.required(name)?.number()
    }

    /// The number in an attribute; `None` if it is missing. An empty one is an error (protocol ES-170).
    pub fn number_in<T: TryFrom<i64>>(&self, attribute: &str) -> Result<Option<T>, EsiError> {
        self.attribute(attribute).map(|text| self.parsed(text, Some(attribute))).transpose()
    }

    fn parsed<T: TryFrom<i64>>(&self, text: &str, attribute: Option<&str>) -> Result<T, EsiError> {
        let found = number::number(text);
        if found.is_some_and(|found| found.is_unusual) {
            let what = attribute.unwrap_or(self.name());
            let text =
                format!("{what}: hexadecimal numbers begin with #x, not as in {}: read all the same", shown(text));
            self.file.note(self.line(), text);
        }
        let value = found.and_then(|found| T::try_from(found.value).ok());
        value.ok_or_else(|| {
            let of = attribute.map(|name| format!(" in the attribute {name}")).unwrap_or_default();
            let bits = 8 * std::mem::size_of::<T>();
            let expected = format!("a number of {bits} bits{of}, decimal or #x and hexadecimal digits");
            self.error(EsiProblem::Value { expected, got: shown(text) })
        })
    }

    /// The boolean in an attribute; `None` if it is missing, and with a notice if it is empty, as in real files.
    pub fn flag_in(&self, attribute: &str) -> Result<Option<bool>, EsiError> {
        let Some(text) = self.attribute(attribute) else { return Ok(None) };
        if text.trim().is_empty() {
            self.file.note(self.line(), format!("{}@{attribute} is empty: read as if it were missing", self.name()));
            return Ok(None);
        }
        let wrong = || {
            let expected = format!("0, 1, true or false in the attribute {attribute}");
            self.error(EsiProblem::Value { expected, got: shown(text) })
        };
        flag(text).map(Some).ok_or_else(wrong)
    }

    /// Whether an attribute is there and true.
    pub fn is(&self, attribute: &str) -> Result<bool, EsiError> {
        Ok(self.flag_in(attribute)?.unwrap_or_default())
    }

    /// The boolean in a child; `None` if it is missing, true if it is empty.
    pub fn flag_of(&self, name: &str) -> Result<Option<bool>, EsiError> {
        let Some(child) = self.child(name) else { return Ok(None) };
        let text = child.raw();
        if text.trim().is_empty() {
            return Ok(Some(true));
        }
        flag(&text).map(Some).ok_or_else(|| child.wrong("0, 1, true or false"))
    }

    /// The element's text as bytes.
    pub fn hex(&self) -> Result<Vec<u8>, EsiError> {
        hex(&self.raw()).ok_or_else(|| self.wrong("bytes as pairs of hexadecimal digits"))
    }

    pub fn hex_of(&self, name: &str) -> Result<Option<Vec<u8>>, EsiError> {
        self.child(name).map(|child| child.hex()).transpose()
    }

    /// The text of children of this name, by language.
    pub fn names(&self, name: &str) -> Result<Names, EsiError> {
        let mut names = Vec::new();
        for child in self.children(name) {
            names.push((child.number_in("LcId")?.unwrap_or(ENGLISH), child.text()));
        }
        Ok(Names::new(names))
    }

    /// The names of its attributes; those of a name space belong to the tools.
    pub fn attribute_names(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.node.attributes().filter(|attribute| attribute.namespace().is_none()).map(|attribute| attribute.name())
    }

    pub fn note(&self, text: impl Into<String>) {
        self.file.note(self.line(), text.into());
    }

    /// A notice about another line of the file.
    pub fn note_at(&self, line: u32, text: String) {
        self.file.note(line, text);
    }

    /// An error about this element.
    pub fn error(&self, problem: EsiProblem) -> EsiError {
        let place = Some(self.file.lines.place(self.node.range().start));
        let error = EsiError::at_line(self.file.name, 0, &self.device(), problem);
        EsiError { place, element: self.path().into(), ..error }
    }

    /// An error about the value of this element.
    pub fn wrong(&self, expected: &str) -> EsiError {
        self.error(EsiProblem::Value { expected: expected.to_owned(), got: shown(&self.raw()) })
    }

    /// The path from the device, or from the root.
    fn path(&self) -> String {
        let mut parts: Vec<&str> = Vec::new();
        for node in self.node.ancestors().filter(Node::is_element) {
            let name = node.tag_name().name();
            let is_device = is_described(node);
            parts.push(name);
            if is_device {
                break;
            }
        }
        parts.reverse();
        parts.join("/")
    }

    /// `Type` of the device or module around this element.
    fn device(&self) -> String {
        let around = self.node.ancestors().find(|node| is_described(*node));
        let kind = around.and_then(|node| Element { node, file: self.file }.child("Type"));
        kind.map(|kind| kind.text().trim().chars().take(80).collect()).unwrap_or_default()
    }
}

/// Whether a node is the description of a device or module.
fn is_described(node: Node<'_, '_>) -> bool {
    let parent = node.parent_element().map(|parent| parent.tag_name().name());
    matches!((parent, node.tag_name().name()), (Some("Devices"), "Device") | (Some("Modules"), "Module"))
}
