//! The public items of the library `ringcat`, as its sources have them: a list that is kept in the repository, so that
//! a review shows every change of the interface.
//!
//! Input: the tree. Output: a line for each item: what the crate root re-exports, public types with their fields,
//! variants and derived traits, traits with their items, public functions, and the traits that types implement. For
//! what is re-exported of a lower crate, the module `handed_on` adds the same lines. Of macros, the list has the public
//! items in the body and each part of the calls (`macros`). Items of private modules are listed where they are
//! public, also if the crate root does not name them. Private traits and types have no lines.

mod items;
mod macros;
mod one_line;

use std::collections::BTreeSet;

pub(crate) use self::items::Item;
use crate::Finding;
use crate::tree::{File, Tree};

/// The list.
pub const LIST: &str = "crates/ringcat/public-items.txt";
/// The sources.
pub(crate) const SOURCES: &str = "crates/ringcat/src/";

/// One line for each public item of the library itself, sorted by file.
pub(crate) fn own_items(tree: &Tree) -> Result<Vec<String>, Finding> {
    Ok(items_of(tree, SOURCES)?.into_iter().map(|item| format!("{}: {}", item.module, item.text)).collect())
}

/// The items of all files below a place, sorted by file. Files of tests have none.
pub(crate) fn items_of(tree: &Tree, sources: &str) -> Result<Vec<Item>, Finding> {
    let is_test = |path: &str| path.split('/').any(|part| matches!(part, "tests" | "tests.rs"));
    let mut files: Vec<&File> = tree.rust().filter(|file| file.path.starts_with(sources)).collect();
    files.retain(|file| !is_test(&file.path));
    files.sort_by(|one, other| one.path.cmp(&other.path));
    items::of_files(&files, sources)
}

/// Differences between the list and the sources.
pub fn changes(now: &[String], list: &str) -> Vec<Finding> {
    let before: BTreeSet<&str> = list.lines().collect();
    let after: BTreeSet<&str> = now.iter().map(String::as_str).collect();
    let gone = before.difference(&after).map(|item| format!("- {item}"));
    let new = after.difference(&before).map(|item| format!("+ {item}"));
    gone.chain(new).map(|text| Finding::new(LIST, 0, text)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_reported_in_both_directions() {
        let text = "//! Text.\n\npub fn new() {}\n";
        let tree = Tree { files: vec![File::new(&format!("{SOURCES}a.rs"), text)] };
        let changes = changes(&own_items(&tree).expect("parses"), "a: pub fn old()\n");
        let texts: Vec<&str> = changes.iter().map(|finding| finding.text.as_str()).collect();
        assert_eq!(texts, ["- a: pub fn old()", "+ a: pub fn new()"]);
    }
}
