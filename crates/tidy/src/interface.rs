//! The public items of the library `ringcat`, as its sources have them: a list that is kept in the repository, so that
//! a review shows every change of the interface.
//!
//! Input: the tree, formatted by rustfmt. Output: a line for each item: what the crate root re-exports, public types
//! with their fields and variants, traits with their items, public functions, and the traits that types implement. For
//! what is re-exported of a lower crate, the module `handed_on` adds the same lines. Macros are not
//! expanded: the list has the items in the macro's body and each line of its calls, so that a change of either shows.
//! Items of private modules are listed where they are public, also if the crate root does not name them.

use crate::Finding;
use crate::tree::{File, Tree};

/// The list.
pub const LIST: &str = "crates/ringcat/public-items.txt";
/// The sources.
pub(crate) const SOURCES: &str = "crates/ringcat/src/";
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
    /// The definition of a macro: the public items in its body.
    Macro,
    /// A call of a macro at the top of a file: its lines.
    Call,
}

/// A public item.
pub(crate) struct Item {
    /// Module path of its file below `src`.
    pub module: String,
    /// The types that it is about: its own name, that of its owner, those that a macro makes.
    pub owners: Vec<String>,
    /// Signature, with that of its owner before it.
    pub text: String,
}

/// One line for each public item of the library itself, sorted by file.
pub(crate) fn own_items(tree: &Tree) -> Vec<String> {
    items_of(tree, SOURCES).into_iter().map(|item| format!("{}: {}", item.module, item.text)).collect()
}

/// The items of all files below a place, sorted by file. Files of tests have none.
pub(crate) fn items_of(tree: &Tree, sources: &str) -> Vec<Item> {
    let is_test = |path: &str| path.split('/').any(|part| matches!(part, "tests" | "tests.rs"));
    let mut files: Vec<&File> = tree.rust().filter(|file| file.path.starts_with(sources)).collect();
    files.retain(|file| !is_test(&file.path));
    files.sort_by(|one, other| one.path.cmp(&other.path));
    files.into_iter().flat_map(|file| of_file(file, sources)).collect()
}

fn of_file(file: &File, sources: &str) -> Vec<Item> {
    let module = file.path.trim_start_matches(sources).trim_end_matches(".rs").replace('/', "::");
    let mut found: Vec<(String, Vec<String>)> = Vec::new();
    let (mut inside, mut owner, mut is_test) = (Inside::Nothing, String::new(), false);
    let mut lines = file.text.lines();
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
        if !is_wanted(inside, depth, text) {
            continue;
        }
        let mut item = text.to_owned();
        let is_variant = inside == Inside::Enum && depth == 1;
        if is_variant && item.ends_with('{') {
            add_fields(&mut item, &mut lines);
        }
        while inside != Inside::Call && !is_whole(&item) {
            let Some(more) = lines.next() else { break };
            item.push(' ');
            item.push_str(more.trim());
        }
        let signature = if is_variant { variant(&item) } else { signature(&item) };
        if depth == 0 {
            inside = kind(&item);
            owner = macro_name(&item).map_or_else(|| signature.clone(), |name| format!("{name}!"));
            match inside {
                // Named by their items.
                Inside::Impl | Inside::Macro => {}
                Inside::Call if item.ends_with('{') => {}
                Inside::Call => found.push((item.clone(), words(&item))),
                _ => found.push((signature.clone(), vec![name_of(&signature)])),
            }
        } else {
            let text = if inside == Inside::Call { text.trim_end_matches(',') } else { signature.as_str() };
            let about = if inside == Inside::Call { words(text) } else { vec![name_of(&owner)] };
            found.push((format!("{owner}: {text}"), about));
        }
    }
    with_what_macros_make(&mut found);
    let item = |(text, owners)| Item { module: module.clone(), owners, text };
    found.into_iter().map(item).collect()
}

fn is_wanted(inside: Inside, depth: usize, text: &str) -> bool {
    match (depth, inside) {
        (0, _) => text.starts_with("pub ") || text.starts_with("impl") || macro_name(text).is_some(),
        (1, Inside::Struct | Inside::Impl) => text.starts_with("pub "),
        (1, Inside::Enum) => text.starts_with(char::is_uppercase),
        (1, Inside::Trait) => ["fn ", "type ", "const "].iter().any(|start| text.starts_with(start)),
        (1, Inside::Names) => true,
        (1, Inside::Call) => !matches!(text, ")" | "]" | "}"),
        (_, Inside::Macro) => text.starts_with("pub ") || text.starts_with("impl"),
        _ => false,
    }
}

/// What a macro's body makes is about every type that its calls name.
fn with_what_macros_make(found: &mut [(String, Vec<String>)]) {
    let calls: Vec<(String, Vec<String>)> = found.to_vec();
    for (text, owners) in found {
        let Some((name, rest)) = text.split_once("!: ") else { continue };
        if rest.starts_with("pub ") || rest.starts_with("impl") {
            let of_calls =
                calls.iter().filter(|(call, _)| call.starts_with(name) && call[name.len()..].starts_with('!'));
            owners.extend(of_calls.flat_map(|(_, words)| words.clone()));
        }
    }
}

/// The name of a macro that is defined or called in this line.
fn macro_name(text: &str) -> Option<&str> {
    let text = text.strip_prefix("macro_rules! ").map_or(text, |rest| rest);
    let (name, rest) = text.split_once(|c: char| !(c.is_alphanumeric() || c == '_'))?;
    let is_call = text.len() > name.len() && text[name.len()..].starts_with('!');
    let is_definition = rest.starts_with('{') && !name.is_empty() && !name.starts_with("impl");
    (is_call || is_definition).then_some(name)
}

/// All names in a text.
fn words(text: &str) -> Vec<String> {
    let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_'));
    words.filter(|word| word.starts_with(char::is_uppercase)).map(str::to_owned).collect()
}

/// The type that a signature is about: the one that it declares, or for which an impl is.
fn name_of(signature: &str) -> String {
    let text = signature.rsplit_once(" for ").map_or(signature, |(_, after)| after);
    let text = text.strip_prefix("pub ").unwrap_or(text);
    let is_impl = signature.starts_with("impl") && !signature.contains(" for ");
    let text = if is_impl { without_parameters(text.trim_start_matches("impl")) } else { text };
    let keywords = ["const", "unsafe", "async", "fn", "struct", "enum", "trait", "type", "static", "use", "mod"];
    let mut names = text.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|word| !word.is_empty());
    names.find(|word| !keywords.contains(word)).unwrap_or_default().to_owned()
}

/// What follows the `<...>` behind `impl`.
fn without_parameters(text: &str) -> &str {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '<' => depth += 1,
            '>' if !text[..at].ends_with('-') => depth -= 1,
            _ => {}
        }
        if depth == 0 && !c.is_whitespace() {
            return if c == '>' { &text[at + 1..] } else { &text[at..] };
        }
    }
    text
}

/// Whether an item is complete: brackets are closed, and a body, a semicolon or a comma follows.
fn is_whole(item: &str) -> bool {
    let opened = item.chars().filter(|c| matches!(c, '(' | '[')).count();
    let closed = item.chars().filter(|c| matches!(c, ')' | ']')).count();
    let is_use = item.starts_with("pub use");
    opened == closed && (item.ends_with(';') || (!is_use && (item.ends_with([',', '}']) || item.ends_with('{'))))
}

/// The fields of a variant, without their comments, up to its closing brace.
fn add_fields<'a>(item: &mut String, lines: &mut impl Iterator<Item = &'a str>) {
    for line in lines {
        let text = line.trim();
        if !text.starts_with("//") && !text.starts_with('#') {
            item.push(' ');
            item.push_str(text);
        }
        if line.len() - line.trim_start().len() <= INDENT {
            break;
        }
    }
}

/// A variant in one line.
fn variant(item: &str) -> String {
    item.trim_end_matches(',').replace(", }", " }").replace("( ", "(").replace(", )", ")").replace(",)", ")")
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
        () if item.starts_with("macro_rules!") => Inside::Macro,
        () if macro_name(item).is_some() => Inside::Call,
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
pub fn changes(now: &[String], list: &str) -> Vec<Finding> {
    let before: Vec<&str> = list.lines().collect();
    let gone = before.iter().filter(|item| !now.iter().any(|other| other == *item)).map(|item| format!("- {item}"));
    let new = now.iter().filter(|item| !before.contains(&item.as_str())).map(|item| format!("+ {item}"));
    gone.chain(new).map(|text| Finding::new(LIST, 0, text)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn items_of(text: &str) -> Vec<String> {
        let items = of_file(&File::new(&format!("{SOURCES}links/name.rs"), text), SOURCES);
        items.into_iter().map(|item| format!("{}: {}", item.module, item.text)).collect()
    }

    #[test]
    fn public_items_are_listed_with_their_signatures_and_no_others() {
        let text = "//! Text.\n\npub use crate::one::{\n    A, B,\n};\n\n/// It.\npub struct It<T> {\n    \
                    /// A field.\n    pub field: u8,\n    hidden: T,\n}\n\nimpl<T> It<T> {\n    /// Long.\n    \
                    pub fn long(\n        &self,\n        more: (u8, u8),\n    ) -> bool {\n        \
                    pub_like()\n    }\n\n    fn own(&self) {}\n}\n\nimpl<T> Clone for It<T> {\n    \
                    fn clone(&self) -> It<T> {\n        it()\n    }\n}\n\n\
                    pub(crate) fn inner() {}\n\npub enum Either {\n    One,\n    Other { it: u8 },\n    \
                    Long {\n        /// A field.\n        first: u8,\n        second: u8,\n    },\n}\n\n\
                    pub const fn f() -> u8 {\n    1\n}\n\n#[cfg(test)]\nmod tests {\n    pub fn not_this() {}\n}\n";
        let expected = [
            "links::name: pub use crate::one::{A, B}",
            "links::name: pub struct It<T>",
            "links::name: pub struct It<T>: pub field: u8",
            "links::name: impl<T> It<T>: pub fn long(&self, more: (u8, u8)) -> bool",
            "links::name: impl<T> Clone for It<T>",
            "links::name: pub enum Either",
            "links::name: pub enum Either: One",
            "links::name: pub enum Either: Other { it: u8 }",
            "links::name: pub enum Either: Long { first: u8, second: u8 }",
            "links::name: pub const fn f() -> u8",
        ];
        assert_eq!(items_of(text), expected);
    }

    #[test]
    fn a_change_is_reported_in_both_directions() {
        let text = "//! Text.\n\npub fn new() {}\n";
        let tree = Tree { files: vec![File::new(&format!("{SOURCES}a.rs"), text)] };
        let changes = changes(&own_items(&tree), "a: pub fn old()\n");
        let texts: Vec<&str> = changes.iter().map(|finding| finding.text.as_str()).collect();
        assert_eq!(texts, ["- a: pub fn old()", "+ a: pub fn new()"]);
    }
}
