//! Rules for single files: length, name, opening comment, no unfinished work.
//!
//! Input: a tree. Output: findings; [`nearly_too_long`] returns only warnings.

use crate::Finding;
use crate::tokens::tokens;
use crate::tree::{File, Tree};

/// A longer source file has to be split.
pub const MAX_LINES: usize = 1000;
/// A longer source file should be split.
pub const WARN_LINES: usize = 600;

/// Names that do not describe the content.
const EMPTY_NAMES: [&str; 6] = ["utils", "util", "common", "helpers", "misc", "manager"];

/// Marks of unfinished work, split so that this list does not match itself.
const UNFINISHED_WORDS: [&str; 2] = [concat!("TO", "DO"), concat!("FIX", "ME")];
/// Macros in place of missing code.
const UNFINISHED_MACROS: [&str; 2] = ["todo", "unimplemented"];

/// Sources with more than [`MAX_LINES`] lines.
pub fn too_long(tree: &Tree) -> Vec<Finding> {
    longer_than(tree, MAX_LINES)
}

/// Sources with more than [`WARN_LINES`] lines.
pub fn nearly_too_long(tree: &Tree) -> Vec<Finding> {
    longer_than(tree, WARN_LINES)
}

fn longer_than(tree: &Tree, limit: usize) -> Vec<Finding> {
    let too_long = |file: &File| {
        let lines = file.text.lines().count();
        (lines > limit).then(|| Finding::new(&file.path, 0, format!("{lines} lines, more than {limit}: split it")))
    };
    tree.rust().filter_map(too_long).collect()
}

/// Files, directories and inline modules with a name that does not describe the content.
pub fn empty_names(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for file in &tree.files {
        let parts = file.path.split('/').map(|part| part.split('.').next().unwrap_or(part));
        for name in parts.filter(|part| EMPTY_NAMES.contains(part)) {
            findings.push(Finding::new(&file.path, 0, format!("`{name}` does not say what is inside: rename it")));
        }
        if !file.is_rust() {
            continue;
        }
        for pair in tokens(&file.text).windows(2) {
            if let (true, Some(name)) = (pair[0].is_ident("mod"), pair[1].ident())
                && EMPTY_NAMES.contains(&name)
            {
                let text = format!("module `{name}` does not say what is inside: rename it");
                findings.push(Finding::new(&file.path, pair[1].line, text));
            }
        }
    }
    findings
}

/// Sources without an opening `//!` comment; a `tests.rs` beside a module is described by that module.
pub fn without_opening_comment(tree: &Tree) -> Vec<Finding> {
    let text = "does not open with a `//!` comment that says what it does, what goes in and out, and its source";
    let silent = |file: &&File| !file.text.starts_with("//! ") && !file.path.ends_with("/tests.rs");
    tree.rust().filter(silent).map(|file| Finding::new(&file.path, 1, text)).collect()
}

/// Marks of unfinished work.
pub fn unfinished(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for file in tree.rust() {
        for (number, line) in file.text.lines().enumerate() {
            let mut words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
            if let Some(word) = words.find(|word| UNFINISHED_WORDS.contains(word)) {
                findings.push(Finding::new(&file.path, number + 1, format!("{word}: do it now or write an issue")));
            }
        }
        for pair in tokens(&file.text).windows(2) {
            if let (Some(name), true) = (pair[0].ident(), pair[1].is('!'))
                && UNFINISHED_MACROS.contains(&name)
            {
                findings.push(Finding::new(&file.path, pair[0].line, format!("{name}!(): write the code")));
            }
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(path: &str, text: &str) -> Tree {
        Tree { files: vec![File::new(path, text)] }
    }

    #[test]
    fn a_source_of_a_thousand_lines_passes_and_one_more_does_not() {
        assert!(too_long(&tree("a.rs", &"\n".repeat(1000))).is_empty());
        assert_eq!(too_long(&tree("a.rs", &"\n".repeat(1001))).len(), 1);
        assert_eq!(nearly_too_long(&tree("a.rs", &"\n".repeat(601))).len(), 1);
        assert!(too_long(&tree("a.md", &"\n".repeat(1001))).is_empty());
    }

    #[test]
    fn empty_names_of_files_directories_and_modules_are_found() {
        assert_eq!(empty_names(&tree("crates/x/src/utils.rs", "")).len(), 1);
        assert_eq!(empty_names(&tree("crates/x/src/common/a.rs", "")).len(), 1);
        assert_eq!(empty_names(&tree("examples/c/helpers.c", "mod util {}")).len(), 1);
        assert_eq!(empty_names(&tree("crates/x/src/a.rs", "mod helpers {}")).len(), 1);
        assert!(empty_names(&tree("crates/x/src/common_mode.rs", "mod a; // mod misc")).is_empty());
    }

    #[test]
    fn a_source_must_open_with_its_purpose() {
        assert_eq!(without_opening_comment(&tree("a.rs", "use x;\n")).len(), 1);
        assert!(without_opening_comment(&tree("a.rs", "//! What it does.\n")).is_empty());
        assert!(without_opening_comment(&tree("a/tests.rs", "use super::*;\n")).is_empty());
    }

    #[test]
    fn unfinished_work_is_found_in_comments_and_code() {
        let comment = format!("// {}: later\n", concat!("TO", "DO"));
        assert_eq!(unfinished(&tree("a.rs", &comment)).len(), 1);
        assert_eq!(unfinished(&tree("a.rs", "fn f() { todo!() }")).len(), 1);
        assert!(unfinished(&tree("a.rs", "fn f() { let todo = \"unimplemented!()\"; }")).is_empty());
    }
}
