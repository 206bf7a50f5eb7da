//! Pages that list the tests of each feature and of each part of `docs/protocol`.
//!
//! Input: a tree. Output: the texts that `cargo run -p tidy -- tests` writes, and findings if the pages in the
//! repository are out of date.

use std::collections::BTreeSet;

use crate::Finding;
use crate::covers::{self, Test};
use crate::features;
use crate::protocol::Pages;
use crate::tree::Tree;

/// The pages, by path.
pub fn pages(tree: &Tree) -> [(&'static str, String); 2] {
    [("docs/feature-tests.md", of_features(tree)), ("docs/protocol-tests.md", of_protocol(tree))]
}

/// Pages that do not match the tests.
pub fn outdated(tree: &Tree) -> Vec<Finding> {
    let current = |path: &str, text: &str| tree.file(path).is_some_and(|file| file.text == text);
    let old = pages(tree).into_iter().filter(|(path, text)| !current(path, text));
    old.map(|(path, _)| Finding::new(path, 0, "is out of date: run `cargo run -p tidy -- tests`")).collect()
}

/// The page that lists the tests of each row.
fn of_features(tree: &Tree) -> String {
    let tests = covers::all(tree);
    let mut text = opening("Tests of each feature");
    let page = tree.file(features::PAGE).map_or("", |page| &page.text);
    for row in features::rows(page).into_iter().flatten().filter(|row| !row.id.is_empty()) {
        text += &format!("\n## {}\n\n{}\n\n{}", row.id, row.capability, list(&tests, &row.id));
    }
    text
}

/// Statements first, then sections in order; those without a test are left out.
fn of_protocol(tree: &Tree) -> String {
    let tests = covers::all(tree);
    let pages = Pages::of(tree);
    let covered: BTreeSet<&String> = tests.iter().flat_map(|test| &test.covers).collect();
    let mut sections: Vec<&String> = pages.sections.iter().collect();
    sections.sort_by_key(|id| id.split('.').map(|part| part.parse().unwrap_or(0)).collect::<Vec<u32>>());
    let mut text = opening("Tests of each statement and section of docs/protocol");
    text += "`cargo run -p tidy -- coverage` lists what no test covers.\n";
    for id in pages.statements.iter().chain(sections).filter(|id| covered.contains(id)) {
        text += &format!("\n## {id}\n\n{}", list(&tests, id));
    }
    text
}

/// The heading of a page and its origin.
pub(crate) fn opening(title: &str) -> String {
    format!(
        "# {title}\n\nWritten by `cargo run -p tidy -- tests` from the `// covers:` lines of the tests; the tidy check \
         fails when it is\nout of date. In parentheses: the crate.\n"
    )
}

/// The tests that cover an id, one line each, in order.
pub(crate) fn list(tests: &[Test], id: &str) -> String {
    let covering = tests.iter().filter(|test| test.covers.iter().any(|covered| covered == id));
    let lines: BTreeSet<String> = covering.map(|test| format!("* `{}` ({})\n", test.name, test.home())).collect();
    lines.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    #[test]
    fn pages_list_covered_ids_and_are_out_of_date_until_written() {
        let page = "# 7. Clocks\n## 7.1 Delays\n## 7.10 Late\n| CR-01 | a |\n| CR-02 | b |\n";
        let source = "// covers: CR-02, 7.10, 7.1\n#[test]\nfn shown() {}\n";
        let files = vec![File::new("docs/protocol/a.md", page), File::new("crates/a/src/a.rs", source)];
        let mut tree = Tree { files };
        let expected = "\n## CR-02\n\n* `shown` (a)\n\n## 7.1\n\n* `shown` (a)\n\n## 7.10\n\n* `shown` (a)\n";
        assert!(of_protocol(&tree).ends_with(expected), "{}", of_protocol(&tree));
        assert_eq!(outdated(&tree).len(), 2);
        let written = pages(&tree).into_iter().map(|(path, text)| File::new(path, &text));
        tree.files.extend(written.collect::<Vec<_>>());
        assert!(outdated(&tree).is_empty());
    }

    #[test]
    fn the_list_of_tests_names_them_under_their_row() {
        let row =
            "| capability | state | limits |\n|---|---|---|\n| [it works](feature-tests.md#ring-cut) | works | |\n";
        let source = "// covers: ring-cut\n#[test]\nfn shown() {}\n";
        let files = vec![File::new(features::PAGE, row), File::new("crates/a/src/a.rs", source)];
        let page = of_features(&Tree { files });
        assert!(page.ends_with("## ring-cut\n\nit works\n\n* `shown` (a)\n"), "{page}");
    }
}
