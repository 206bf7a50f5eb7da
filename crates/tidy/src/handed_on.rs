//! Items of lower crates that the library `ringcat` re-exports by name, with their members.
//!
//! Input: the lines of [`crate::interface`] for a lower crate. Output: those of the types that the sources of `ringcat`
//! name in a `pub use`: fields, variants, functions, implemented traits, and what macros make of them. Of a crate or a
//! module that is re-exported as a whole (`wire`, `sim`, `config`, `realtime`), all items.

use std::collections::BTreeSet;

use crate::Finding;
use crate::interface::{Item, SOURCES, items_of, own_items};
use crate::tree::Tree;

/// Lower crates by the name under which the sources of `ringcat` use them.
const CRATES: [&str; 7] = ["engine", "wire", "link", "config", "control", "gateway", "sim"];

/// The whole list: the items of the library, then those of lower crates.
pub fn items(tree: &Tree) -> Result<Vec<String>, Finding> {
    Ok(own_items(tree)?.into_iter().chain(members(tree)?).collect())
}

/// Lines for what is re-exported, sorted by crate and name.
fn members(tree: &Tree) -> Result<Vec<String>, Finding> {
    let of_crates: Result<Vec<_>, _> = CRATES.iter().map(|name| of_crate(tree, name)).collect();
    Ok(of_crates?.concat())
}

fn of_crate(tree: &Tree, name: &str) -> Result<Vec<String>, Finding> {
    let names = re_exported(tree, name);
    let items = items_of(tree, &format!("crates/{name}/src/"))?;
    let line = |item: &Item| format!("ringcat_{name}::{}: {}", item.module, item.text);
    if is_re_exported_whole(tree, name) {
        return Ok(items.iter().map(line).collect());
    }
    let root = tree.file(&format!("crates/{name}/src/lib.rs")).map_or("", |root| &root.text);
    let is_module = |wanted: &&String| root.lines().any(|line| line == format!("pub mod {wanted};"));
    let (modules, names): (Vec<&String>, Vec<&String>) = names.iter().partition(is_module);
    let is_of_module = |item: &&Item| modules.iter().any(|module| is_below(&item.module, module));
    let mut found: Vec<String> = items.iter().filter(is_of_module).map(line).collect();
    for wanted in names {
        for item in items.iter().filter(|item| item.owners.contains(wanted)) {
            found.push(format!("ringcat_{name}::{wanted}: {}", item.text));
        }
    }
    Ok(found)
}

/// Whether the sources of the library have `pub use ringcat_<name> as ...`.
fn is_re_exported_whole(tree: &Tree, name: &str) -> bool {
    let start = format!("pub use ringcat_{name} as ");
    let mut sources = tree.rust().filter(|file| file.path.starts_with(SOURCES));
    sources.any(|file| file.text.lines().any(|line| line.starts_with(&start)))
}

/// Whether a module is this one or in it.
fn is_below(path: &str, module: &str) -> bool {
    path.strip_prefix(module).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// The names in `pub use ringcat_<name>::...` of the library; a renamed one by its name in the lower crate.
pub(crate) fn re_exported(tree: &Tree, name: &str) -> BTreeSet<String> {
    let start = format!("pub use ringcat_{name}::");
    let mut names = BTreeSet::new();
    for file in tree.rust().filter(|file| file.path.starts_with(SOURCES)) {
        for part in file.text.split("\n").collect::<Vec<_>>().join(" ").split("pub use ").skip(1) {
            let whole = format!("pub use {part}");
            let Some(path) = whole.strip_prefix(&start).and_then(|rest| rest.split(';').next()) else { continue };
            let list = path.split_once('{').map_or_else(
                || path.rsplit("::").next().unwrap_or_default(),
                |(_, list)| list.trim_end().trim_end_matches('}'),
            );
            let originals = list.split(',').filter_map(|one| one.split_whitespace().next());
            names.extend(originals.filter(|one| one.starts_with(char::is_alphabetic)).map(str::to_owned));
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    #[test]
    fn members_of_types_are_listed_where_the_library_names_the_type() {
        let library = "//! It.\n\npub use ringcat_engine::one::{\n    A, B as C,\n};\npub use ringcat_engine::two::D;\n\
             pub use ringcat_link::near;\npub use ringcat_wire as wire;\n";
        let lower = "//! It.\n\n/// A.\npub struct A {\n    pub field: u8,\n}\n\n\
                     impl A {\n    pub fn f(&self) {}\n}\n\n\
                     impl Clone for A {\n    fn clone(&self) -> A {\n        A\n    }\n}\n\npub struct Other;\n\n\
                     pub enum B {\n    One,\n}\n";
        let made = "//! It.\n\nmacro_rules! ids {\n    ($name:ident) => {\n        \
                    pub struct $name(pub u8);\n\n        \
                    impl Copy for $name {}\n    };\n}\n\nids! {\n    D\n}\n\nids! {\n    E\n}\n";
        let tree = Tree {
            files: vec![
                File::new("crates/ringcat/src/lib.rs", library),
                File::new("crates/engine/src/one.rs", lower),
                File::new("crates/engine/src/two.rs", made),
                File::new("crates/link/src/lib.rs", "//! It.\n\npub mod near;\n"),
                File::new("crates/link/src/near.rs", "//! It.\n\npub fn near() {}\n"),
                File::new("crates/link/src/nearer.rs", "//! It.\n\npub fn nearer() {}\n"),
                File::new("crates/wire/src/al/code.rs", "//! It.\n\npub fn code() {}\n"),
            ],
        };
        let expected = [
            "ringcat_engine::A: pub struct A",
            "ringcat_engine::A: pub struct A: pub field: u8",
            "ringcat_engine::A: impl A: pub fn f(&self)",
            "ringcat_engine::A: impl Clone for A",
            "ringcat_engine::B: pub enum B",
            "ringcat_engine::B: pub enum B: One",
            "ringcat_engine::D: ids!: D",
            "ringcat_engine::D: ids!: pub struct $name(pub u8)",
            "ringcat_engine::D: ids!: impl Copy for $name",
            "ringcat_link::near: pub fn near()",
            "ringcat_wire::al::code: pub fn code()",
        ];
        let mut found = members(&tree).expect("parses");
        found.sort_by_key(|line| expected.iter().position(|other| other == line));
        assert_eq!(found, expected);
    }
}
