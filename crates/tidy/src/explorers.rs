//! The list of random scenarios is complete: `ci/explorers.toml` names tests that exist, and every test that takes its
//! seeds from the environment is in it.
//!
//! Input: a tree. Output: findings.

use std::collections::BTreeSet;

use toml::Table;

use crate::Finding;
use crate::tree::{File, Tree};

/// Where they are listed.
pub const LIST: &str = "ci/explorers.toml";
/// Where they are.
const TESTS: &str = "crates/scenarios/tests/";
const BENCHES: &str = "crates/scenarios/src/bin/";
/// What such a test calls, directly or through the helper of the same name.
const CALL: &str = "from_environment(";

/// Listed tests that do not exist, and files with a test that is not listed.
pub fn faults(tree: &Tree) -> Vec<Finding> {
    let Some(list) = tree.file(LIST) else { return vec![Finding::new(LIST, 0, "is missing")] };
    let table: Table = match list.text.parse() {
        Ok(table) => table,
        Err(error) => return vec![Finding::new(LIST, 0, format!("cannot be read: {error}"))],
    };
    let mut findings = Vec::new();
    let mut listed = BTreeSet::new();
    for explorer in table.get("explorer").and_then(toml::Value::as_array).into_iter().flatten() {
        let text = |key: &str| explorer.get(key).and_then(toml::Value::as_str).unwrap_or_default();
        match place(tree, text("program"), text("test")) {
            Some(file) => _ = listed.insert(file.path.as_str()),
            None => {
                let text = format!("{}: there is no `{}` in {}", text("name"), text("test"), text("program"));
                findings.push(Finding::new(LIST, 0, text));
            }
        }
    }
    let in_scope = |file: &&File| file.path.starts_with(TESTS) || file.path.starts_with(BENCHES);
    for file in tree.rust().filter(in_scope).filter(|file| file.text.contains(CALL)) {
        if !listed.contains(file.path.as_str()) {
            findings.push(Finding::new(&file.path, 0, format!("takes seeds from the environment: list it in {LIST}")));
        }
    }
    findings
}

/// The file that has a test with this beginning of its name, or this subject of a bench.
fn place<'tree>(tree: &'tree Tree, program: &str, test: &str) -> Option<&'tree File> {
    let bench = tree.file(&format!("{BENCHES}{program}/{test}.rs"));
    let (modules, name) = test.rsplit_once("::").unwrap_or(("", test));
    let path =
        if modules.is_empty() { program.to_owned() } else { format!("{program}/{}", modules.replace("::", "/")) };
    let in_tests = tree.file(&format!("{TESTS}{path}.rs"));
    bench.or(in_tests.filter(|file| file.text.contains(&format!("fn {name}"))))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENTRIES: &str = "[[explorer]]\nname = \"a\"\nprogram = \"p\"\ntest = \"m::n::t\"\n\
                           [[explorer]]\nname = \"b\"\nprogram = \"q\"\ntest = \"t\"\n\
                           [[explorer]]\nname = \"c\"\nprogram = \"f\"\ntest = \"d\"\n";

    fn tree(deep: &str) -> Tree {
        let files = [
            (LIST, ENTRIES),
            ("crates/scenarios/tests/p/m/n.rs", deep),
            ("crates/scenarios/tests/q.rs", "fn t() { seeds::from_environment(); }"),
            ("crates/scenarios/src/bin/f/d.rs", "fn main() { seeds::from_environment(); }"),
        ];
        Tree { files: files.map(|(path, text)| File::new(path, text)).to_vec() }
    }

    #[test]
    fn listed_tests_exist_and_all_that_take_seeds_are_listed() {
        assert_eq!(faults(&tree("fn t() {}")), []);
        let renamed = faults(&tree("fn other() { seeds::from_environment(); }"));
        assert_eq!(
            renamed.iter().map(|it| it.file.as_str()).collect::<Vec<_>>(),
            [LIST, "crates/scenarios/tests/p/m/n.rs"]
        );
        assert_eq!(faults(&Tree::default()).len(), 1);
    }
}
