//! `docs/FEATURES.md` is honest: every row of its table names tests that exist.
//!
//! In goes a tree, out come findings. A row is `| capability | state | tests |`; each test is its function's name in
//! backticks; a path before it helps the reader where several have one name.

use std::collections::BTreeSet;

use crate::Finding;
use crate::tokens::{Token, separator_at, tokens};
use crate::tree::Tree;

/// Where the table is.
const PAGE: &str = "docs/FEATURES.md";
/// What the second column may say.
const STATES: [&str; 2] = ["works", "partly"];

/// Rows without a test, with an unknown state, or with a test that is not there.
pub fn rows_without_test(tree: &Tree) -> Vec<Finding> {
    let Some(page) = tree.file(PAGE) else {
        return vec![Finding::new(PAGE, 0, "is missing")];
    };
    let tests: BTreeSet<String> = tree.rust().flat_map(|file| test_names(&tokens(&file.text))).collect();
    let mut findings = Vec::new();
    let mut in_table = false;
    for (number, line) in page.text.lines().enumerate() {
        let cells: Vec<&str> = line.trim().trim_matches('|').split('|').map(str::trim).collect();
        if !line.trim_start().starts_with('|') {
            in_table = false;
        } else if cells.iter().all(|cell| cell.chars().all(|c| matches!(c, '-' | ':'))) {
            in_table = true;
        } else if in_table {
            findings.extend(faults(&cells, &tests).into_iter().map(|text| Finding::new(PAGE, number + 1, text)));
        }
    }
    findings
}

fn faults(cells: &[&str], tests: &BTreeSet<String>) -> Vec<String> {
    let [_, state, named] = cells else {
        return vec![format!("a row has three cells, this one {}", cells.len())];
    };
    let mut faults = Vec::new();
    if !STATES.contains(state) {
        faults.push(format!("state is one of {STATES:?}, got `{state}`"));
    }
    // Every second part is between backticks.
    let names: Vec<&str> = named.split('`').skip(1).step_by(2).collect();
    if names.is_empty() {
        faults.push("names no test".to_owned());
    }
    for name in names {
        if !tests.contains(name.rsplit("::").next().unwrap_or(name)) {
            faults.push(format!("there is no test `{name}`"));
        }
    }
    faults
}

/// Names of the functions with `#[test]`, also inside `proptest!`.
pub fn test_names(tokens: &[Token]) -> Vec<String> {
    let mut names = Vec::new();
    let mut marked = false;
    for (at, token) in tokens.iter().enumerate() {
        let attribute = at >= 2 && tokens[at - 1].is('[') && tokens[at - 2].is('#');
        if token.is_ident("test") && attribute && !separator_at(tokens, at + 1) {
            marked = true;
        } else if token.is_ident("fn") && marked {
            names.extend(tokens.get(at + 1).and_then(Token::ident).map(str::to_owned));
            marked = false;
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    fn findings(row: &str) -> Vec<Finding> {
        let source = "#[test] fn shown() {} fn not_a_test() {} proptest! { #[test] fn always(x in 0..1) {} }";
        let page = format!("| capability | state | test |\n|---|---|---|\n{row}\n");
        rows_without_test(&Tree { files: vec![File::new(PAGE, &page), File::new("crates/a/src/a.rs", source)] })
    }

    #[test]
    fn a_row_passes_when_all_its_tests_exist() {
        assert!(findings("| it works | works | `shown`, `module::always` |").is_empty());
    }

    #[test]
    fn a_row_whose_test_is_missing_is_found() {
        assert_eq!(findings("| it works | works | `shown` `gone` |").len(), 1);
        assert_eq!(findings("| it works | works | `not_a_test` |").len(), 1);
        assert_eq!(findings("| it works | works | - |").len(), 1);
        assert_eq!(findings("| it works | maybe | `shown` |").len(), 1);
        assert_eq!(findings("| it works | `shown` |").len(), 1);
    }

    #[test]
    fn a_missing_page_is_found() {
        assert_eq!(rows_without_test(&Tree::default()).len(), 1);
    }
}
