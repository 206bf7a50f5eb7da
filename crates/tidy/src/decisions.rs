//! References to `docs/decisions`: every decision that is cited by its number has a note.
//!
//! Input: a tree. Output: findings. One is cited as `decision 0007`, several as `decisions 0007, 0023 and 0045` or
//! `decisions 0074 to 0076`. Comments may break the line anywhere.

use crate::Finding;
use crate::protocol::{trimmed, words};
use crate::tree::Tree;

/// The directory of the notes.
const NOTES: &str = "docs/decisions/";
/// Digits of a number.
const DIGITS: usize = 4;

fn is_number(word: &str) -> bool {
    word.len() == DIGITS && word.bytes().all(|b| b.is_ascii_digit())
}

/// Cited decisions without a note.
pub fn unresolved(tree: &Tree) -> Vec<Finding> {
    let notes = tree.files.iter().filter_map(|file| file.path.strip_prefix(NOTES)?.split('-').next());
    let notes: Vec<&str> = notes.filter(|number| is_number(number)).collect();
    let mut findings = Vec::new();
    for file in &tree.files {
        let words = words(&file.text);
        for (at, (word, line)) in words.iter().enumerate() {
            if !matches!(trimmed(word).to_ascii_lowercase().as_str(), "decision" | "decisions") {
                continue;
            }
            let missing = cited(&words[at + 1..]).filter(|number| !notes.contains(number));
            let finding = |number| Finding::new(&file.path, *line, format!("docs/decisions has no note {number}"));
            findings.extend(missing.map(finding));
        }
    }
    findings
}

/// The numbers at the beginning of some words.
fn cited<'a>(words: &[(&'a str, usize)]) -> impl Iterator<Item = &'a str> {
    let words = words.iter().map(|(word, _)| *word);
    words.map(trimmed).take_while(|word| is_number(word) || matches!(*word, "and" | "to")).filter(|it| is_number(it))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    // covers: tree
    #[test]
    fn a_cited_decision_without_a_note_is_named_with_its_line() {
        let note = File::new("docs/decisions/0007-one-router.md", "# 0007\n");
        let right = File::new("crates/a/src/a.rs", "//! As planned (decision 0007), in decision\n//! 0007.\n");
        let word = concat!("deci", "sions");
        let text = format!("// A decision of 2000 bytes.\n// See {word} 0007 to\n// 0009, 7.\n");
        let wrong = File::new("crates/a/src/b.rs", &text);
        let found = unresolved(&Tree { files: vec![note, right, wrong] });
        let found: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(found, ["crates/a/src/b.rs:2: docs/decisions has no note 0009"]);
    }
}
