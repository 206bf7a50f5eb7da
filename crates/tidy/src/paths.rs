//! Checks that the paths in `docs/ARCHITECTURE.md` exist.
//!
//! Input: a tree. Output: findings: a word in backticks that starts with `crates/` or `ci/` has to be a file, or a
//! non-empty directory if it ends with `/`. Decisions and the changelog may name removed files.

use crate::Finding;
use crate::tree::Tree;

/// The page that is checked.
const PAGE: &str = "docs/ARCHITECTURE.md";

/// Paths on the page that lead nowhere.
pub fn leading_nowhere(tree: &Tree) -> Vec<Finding> {
    let Some(page) = tree.file(PAGE) else {
        return vec![Finding::new(PAGE, 0, "is missing")];
    };
    let mut findings = Vec::new();
    for (number, line) in page.text.lines().enumerate() {
        // Every second part is between backticks.
        for path in line.split('`').skip(1).step_by(2).filter(|path| is_place(path)) {
            if !exists(tree, path) {
                findings.push(Finding::new(PAGE, number + 1, format!("there is no `{path}`")));
            }
        }
    }
    findings
}

fn is_place(word: &str) -> bool {
    (word.starts_with("crates/") || word.starts_with("ci/")) && (word.ends_with('/') || word.ends_with(".rs"))
}

fn exists(tree: &Tree, path: &str) -> bool {
    tree.files.iter().any(|file| if path.ends_with('/') { file.path.starts_with(path) } else { file.path == path })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    #[test]
    fn a_place_that_does_not_exist_is_found() {
        let page = "`crates/a/src/b.rs` `crates/a/src/` and `b.rs`\n`crates/a/src/c.rs` or `crates/a/tests/`\n";
        let files = vec![File::new("crates/a/src/b.rs", ""), File::new(PAGE, page)];
        let lines: Vec<usize> = leading_nowhere(&Tree { files }).iter().map(|finding| finding.line).collect();
        assert_eq!(lines, [2, 2]);
    }
}
