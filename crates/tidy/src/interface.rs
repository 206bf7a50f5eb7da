//! The public items of the library `ringcat` according to its sources: a list kept in the repository, so that a review
//! shows every change of the interface.
//!
//! Input: the tree, formatted by rustfmt. Output: a line for each item: re-exports of the crate root, public types with
//! their fields and variants, traits with their items, public functions, and implemented traits. The list does not
//! contain items created by macros, and of types of lower crates only the name. It contains public items of private
//! modules, also if the crate root does not name them.

use crate::Finding;
use crate::tree::{File, Tree};

/// The list.
pub const LIST: &str = "crates/ringcat/public-items.txt";
/// The sources.
const SOURCES: &str = "crates/ringcat/src/";
/// One level of rustfmt.
const INDENT: usize = 4;

/// Context of a line.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Inside {
    /// The file itself, or an item without public parts.
    Nothing,
    /// A public struct: its public fields.
    Struct,
    /// A public enum: its variants.
    Enum,
    /// A public trait: its items.
    Trait,
    /// An impl without a trait: its public functions.
    Impl,
    /// A list of names that the crate root re-exports.
    Names,
}

/// One line for each public item, sorted by file.
pub fn items(tree: &Tree) -> Vec<String> {
    let mut files: Vec<&File> = tree.rust().filter(|file| file.path.starts_with(SOURCES)).collect();
    files.sort_by(|one, other| one.path.cmp(&other.path));
    files.into_iter().flat_map(of_file).collect()
}

fn of_file(file: &File) -> Vec<String> {
    let module = file.path.trim_start_matches(SOURCES).trim_end_matches(".rs").replace('/', "::");
    let mut found = Vec::new();
    let (mut inside, mut owner, mut is_test) = (Inside::Nothing, String::new(), false);
    let mut lines = file.text.lines().peekable();
    while let Some(line) = lines.next() {
        let depth = (line.len() - line.trim_start().len()) / INDENT;
        let text = line.trim();
        if text.starts_with("//") || text.starts_with('#') {
            is_test |= text == "#[cfg(test)]";
            continue;
        }
        // Tests are the last part of a file.
        if is_test && text.starts_with("mod ") {
            break;
        }
        is_test = false;
        if depth == 0 && matches!(text, "}" | "};") {
            inside = Inside::Nothing;
        }
        let is_wanted = match (depth, inside) {
            (0, _) => text.starts_with("pub ") || text.starts_with("impl"),
            (1, Inside::Struct | Inside::Impl) => text.starts_with("pub "),
            (1, Inside::Enum) => text.starts_with(char::is_uppercase),
            (1, Inside::Trait) => ["fn ", "type ", "const "].iter().any(|start| text.starts_with(start)),
            (1, Inside::Names) => true,
            _ => false,
        };
        if !is_wanted {
            continue;
        }
        let mut item = text.to_owned();
        while !is_whole(&item) {
            let Some(more) = lines.next() else { break };
            item.push(' ');
            item.push_str(more.trim());
        }
        let signature = signature(&item);
        if depth == 0 {
            inside = kind(&item);
            owner.clone_from(&signature);
            // Re-exports on several lines are complete here, and an impl without a trait is listed by its items.
            if inside != Inside::Impl {
                found.push(format!("{module}: {signature}"));
            }
        } else {
            found.push(format!("{module}: {owner}: {signature}"));
        }
    }
    found
}

/// Whether an item is complete: brackets are closed, and a body, a semicolon or a comma follows.
fn is_whole(item: &str) -> bool {
    let opened = item.chars().filter(|c| matches!(c, '(' | '[')).count();
    let closed = item.chars().filter(|c| matches!(c, ')' | ']')).count();
    let is_use = item.starts_with("pub use");
    opened == closed && (item.ends_with(';') || (!is_use && (item.ends_with([',', '}']) || item.ends_with('{'))))
}

/// An item without its body. A list of names keeps its braces.
fn signature(item: &str) -> String {
    let end = match item.starts_with("pub use") {
        true => item.len(),
        false => item.find(" {").unwrap_or(item.len()),
    };
    let text = item[..end].trim_end_matches([';', ',']);
    text.replace("( ", "(").replace(", )", ")").replace(",)", ")").replace("{ ", "{").replace(", }", "}")
}

fn kind(item: &str) -> Inside {
    let opens = item.ends_with('{');
    let starts = |words: &[&str]| words.iter().any(|word| item.starts_with(word));
    match () {
        () if !opens => Inside::Nothing,
        () if starts(&["pub struct"]) => Inside::Struct,
        () if starts(&["pub enum"]) => Inside::Enum,
        () if starts(&["pub trait"]) => Inside::Trait,
        () if starts(&["impl"]) && !item.contains(" for ") => Inside::Impl,
        () if starts(&["pub use"]) => Inside::Names,
        () => Inside::Nothing,
    }
}

/// Differences between the list and the sources.
pub fn changes(tree: &Tree, list: &str) -> Vec<Finding> {
    let now = items(tree);
    let before: Vec<&str> = list.lines().collect();
    let gone = before.iter().filter(|item| !now.iter().any(|other| other == *item)).map(|item| format!("- {item}"));
    let new = now.iter().filter(|item| !before.contains(&item.as_str())).map(|item| format!("+ {item}"));
    gone.chain(new).map(|text| Finding::new(LIST, 0, text)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn items_of(text: &str) -> Vec<String> {
        of_file(&File::new(&format!("{SOURCES}links/name.rs"), text))
    }

    #[test]
    fn public_items_are_listed_with_their_signatures_and_no_others() {
        let text = "//! Text.\n\npub use crate::one::{\n    A, B,\n};\n\n/// It.\npub struct It<T> {\n    \
                    /// A field.\n    pub field: u8,\n    hidden: T,\n}\n\nimpl<T> It<T> {\n    /// Long.\n    \
                    pub fn long(\n        &self,\n        more: (u8, u8),\n    ) -> bool {\n        \
                    pub_like()\n    }\n\n    fn own(&self) {}\n}\n\nimpl<T> Clone for It<T> {\n    \
                    fn clone(&self) -> It<T> {\n        it()\n    }\n}\n\n\
                    pub(crate) fn inner() {}\n\npub enum Either {\n    One,\n    Other { it: u8 },\n}\n\n\
                    pub const fn f() -> u8 {\n    1\n}\n\n#[cfg(test)]\nmod tests {\n    pub fn not_this() {}\n}\n";
        let expected = [
            "links::name: pub use crate::one::{A, B}",
            "links::name: pub struct It<T>",
            "links::name: pub struct It<T>: pub field: u8",
            "links::name: impl<T> It<T>: pub fn long(&self, more: (u8, u8)) -> bool",
            "links::name: impl<T> Clone for It<T>",
            "links::name: pub enum Either",
            "links::name: pub enum Either: One",
            "links::name: pub enum Either: Other",
            "links::name: pub const fn f() -> u8",
        ];
        assert_eq!(items_of(text), expected);
    }

    #[test]
    fn a_change_is_reported_in_both_directions() {
        let text = "//! Text.\n\npub fn new() {}\n";
        let tree = Tree { files: vec![File::new(&format!("{SOURCES}a.rs"), text)] };
        let changes = changes(&tree, "a: pub fn old()\n");
        let texts: Vec<&str> = changes.iter().map(|finding| finding.text.as_str()).collect();
        assert_eq!(texts, ["- a: pub fn old()", "+ a: pub fn new()"]);
    }
}
