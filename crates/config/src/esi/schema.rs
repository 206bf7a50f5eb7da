//! The elements and attributes of all editions of the schema (protocol ES-09), as far as the reader uses them or leaves
//! them out on purpose. What is not in them is a notice, so that a misspelt or a new element is not overlooked.
//!
//! Input: the root of a file. Output: notices.

mod edition;

use std::collections::HashMap;
use std::sync::OnceLock;

use super::element::Element;
use crate::xml::shown;

/// A child of this kind is not looked into: vendor data, images, what is for tools only.
const CLOSED: usize = usize::MAX;
/// A child or an attribute of this kind has a meaning for a MainDevice that the reader does not use.
const UNUSED: usize = usize::MAX - 1;

/// What an element may have.
#[derive(Debug, Default)]
struct Kind {
    /// Names with the kind, 0 or [`UNUSED`].
    attributes: Vec<(&'static str, usize)>,
    /// Names with the kind of the child.
    children: Vec<(&'static str, usize)>,
}

/// Kinds by number; the first is that of texts without children.
struct Schema {
    kinds: Vec<Kind>,
    numbers: HashMap<&'static str, usize>,
}

impl Schema {
    /// A row of [`edition::KINDS`] is a kind: its name, its attributes, its children. `Name=Kind` is a child of another
    /// kind than its name, `Name*` one that is not looked into, `Name!` one that is noted as not used; a child without
    /// a row is a text.
    fn new() -> Schema {
        let numbers: HashMap<_, _> = edition::KINDS.iter().zip(1..).map(|(row, number)| (row.0, number)).collect();
        let part = |text: &'static str| {
            let marked = |mark: char| text.strip_suffix(mark);
            match (marked('*'), marked('!'), text.split_once('=')) {
                (Some(name), ..) => (name, CLOSED),
                (_, Some(name), _) => (name, UNUSED),
                (.., Some((name, kind))) => (name, numbers.get(kind).copied().unwrap_or(0)),
                (None, None, None) => (text, numbers.get(text).copied().unwrap_or(0)),
            }
        };
        let rows = edition::KINDS.iter().map(|(_, attributes, children)| Kind {
            attributes: attributes.split_whitespace().map(part).collect(),
            children: children.split_whitespace().map(part).collect(),
        });
        Schema { kinds: std::iter::once(Kind::default()).chain(rows).collect(), numbers }
    }

    fn check(&self, element: Element<'_>, kind: usize) {
        let Some(of) = self.kinds.get(kind) else { return };
        let note = |at: Element<'_>, name: &str, mark: &str, found: Option<usize>| {
            let what = match found {
                Some(UNUSED) => "is not used",
                Some(_) => return,
                None => "is not known: not used",
            };
            at.note(format!("{}{mark}{} {what}", element.name(), shown(name).trim_matches('"')));
        };
        let kind_of = |list: &[(&str, usize)], name: &str| Some(list.iter().find(|(known, _)| *known == name)?.1);
        for name in element.attribute_names() {
            note(element, name, "@", kind_of(&of.attributes, name));
        }
        for child in element.all() {
            let found = kind_of(&of.children, child.name());
            note(child, child.name(), "/", found);
            if let Some(kind) = found {
                self.check(child, kind);
            }
        }
    }
}

/// Notes elements and attributes that no edition of the schema has.
pub(super) fn check(root: Element<'_>) {
    static SCHEMA: OnceLock<Schema> = OnceLock::new();
    let schema = SCHEMA.get_or_init(Schema::new);
    if let Some(kind) = schema.numbers.get(root.name()) {
        schema.check(root, *kind);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: ES-09
    #[test]
    fn each_kind_of_a_child_has_a_row() {
        for (name, _, children) in edition::KINDS {
            for kind in children.split_whitespace().filter_map(|child| child.split_once('=')).map(|pair| pair.1) {
                assert!(edition::KINDS.iter().any(|row| row.0 == kind), "{name}: {kind}");
            }
        }
        let names: std::collections::BTreeSet<_> = edition::KINDS.iter().map(|row| row.0).collect();
        assert_eq!(names.len(), edition::KINDS.len(), "a row each");
    }
}
