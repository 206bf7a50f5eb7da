//! The list of random scenarios is complete: `ci/explorers.toml` names tests that exist, and every test that takes its
//! seeds from the environment is in it.
//!
//! Input: a tree. Output: findings.

use std::collections::BTreeSet;

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
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

/// Listed tests that do not exist, and tests that are not listed.
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
            Some(file) => {
                let name = text("test").rsplit("::").next().unwrap_or_default().to_owned();
                listed.insert((file.path.as_str(), name));
            }
            None => {
                let text = format!("{}: there is no `{}` in {}", text("name"), text("test"), text("program"));
                findings.push(Finding::new(LIST, 0, text));
            }
        }
    }
    let in_scope = |file: &&File| file.path.starts_with(TESTS) || file.path.starts_with(BENCHES);
    for file in tree.rust().filter(in_scope).filter(|file| file.text.contains(CALL)) {
        let of_file = || listed.iter().filter(|(path, _)| *path == file.path).map(|(_, name)| name);
        let missing = |line, what: &str| {
            Finding::new(&file.path, line, format!("{what} takes seeds from the environment: list it in {LIST}"))
        };
        if file.path.starts_with(BENCHES) || !file.text.contains("#[test]") {
            findings.extend(of_file().next().is_none().then(|| missing(0, "the file")));
            continue;
        }
        for (line, name) in tests_with_seeds(file) {
            if !of_file().any(|listed| name.starts_with(listed.as_str())) {
                findings.push(missing(line, &name));
            }
        }
    }
    findings
}

/// The tests of a file that take seeds, with their lines.
fn tests_with_seeds(file: &File) -> Vec<(usize, String)> {
    let Ok(syntax) = syn::parse_file(&file.text) else { return Vec::new() };
    let mut tests = Tests { lines: file.text.lines().collect(), found: Vec::new() };
    tests.visit_file(&syntax);
    tests.found
}

struct Tests<'a> {
    lines: Vec<&'a str>,
    found: Vec<(usize, String)>,
}

impl<'ast> Visit<'ast> for Tests<'_> {
    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        let (begin, end) = (item.block.span().start().line, item.block.span().end().line);
        let body = self.lines.get(begin - 1..end).unwrap_or_default();
        let is_test = item.attrs.iter().any(|attribute| attribute.path().is_ident("test"));
        if is_test && body.iter().any(|line| line.contains(CALL)) {
            self.found.push((begin, item.sig.ident.to_string()));
        }
        visit::visit_item_fn(self, item);
    }
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
        let second = "fn t() {}\n#[test]\nfn u() {\n    for seed in from_environment() {}\n}\n";
        let found = faults(&tree(second));
        assert_eq!(
            found.iter().map(|it| (it.file.as_str(), it.line)).collect::<Vec<_>>(),
            [("crates/scenarios/tests/p/m/n.rs", 3)]
        );
        assert_eq!(
            renamed.iter().map(|it| it.file.as_str()).collect::<Vec<_>>(),
            [LIST, "crates/scenarios/tests/p/m/n.rs"]
        );
        assert_eq!(faults(&Tree::default()).len(), 1);
    }
}
