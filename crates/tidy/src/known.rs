//! Known violations: counts that may shrink and never grow.
//!
//! Input: the [`Counts`] of a rule and `crates/tidy/known.toml`. Output: findings. A key that is not in the file and a
//! number above that in the file are findings; so is an entry that is larger than needed, except for the words, which
//! several people correct at the same time. `cargo run -p tidy -- shrink` lowers the file to the current counts.

use std::collections::BTreeMap;
use std::fmt::Write;

use toml::{Table, Value};

use crate::Finding;
use crate::tree::Tree;

/// Counts of a rule by file or item.
pub type Counts = BTreeMap<String, usize>;

/// The list of known violations.
pub const PATH: &str = "crates/tidy/known.toml";

/// Known violations by rule.
#[derive(Default)]
pub struct Known {
    rules: BTreeMap<String, Counts>,
}

/// Consequence of an entry that is larger than the count.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mended {
    /// The file has to shrink at once.
    MustShrink,
    /// It may shrink later.
    MayShrink,
}

impl Known {
    /// Reads the file in a tree; without the file nothing is known.
    pub fn read(tree: &Tree) -> Result<Known, Finding> {
        let text = tree.file(PATH).map_or("", |file| file.text.as_str());
        let table: Table = text.parse().map_err(|error| Finding::new(PATH, 0, format!("cannot be read: {error}")))?;
        let count = |(key, value): (&String, &Value)| {
            value.as_integer().and_then(|count| usize::try_from(count).ok()).map(|count| (key.clone(), count))
        };
        let counts = |value: &Value| value.as_table().into_iter().flatten().filter_map(count).collect::<Counts>();
        Ok(Known { rules: table.iter().map(|(rule, value)| (rule.clone(), counts(value))).collect() })
    }

    /// Compares the counts of a rule with the known counts.
    pub fn compare(&self, rule: &str, found: &Counts, mended: Mended) -> Vec<Finding> {
        let nothing = Counts::new();
        let known = self.rules.get(rule).unwrap_or(&nothing);
        let mut findings = Vec::new();
        for (key, count) in found {
            match known.get(key) {
                None => findings.push(Finding::new(key, 0, format!("{rule}: {count}"))),
                Some(known) if count > known => {
                    findings.push(Finding::new(key, 0, format!("{rule}: {count}, {known} before")));
                }
                Some(_) => {}
            }
        }
        if mended == Mended::MustShrink {
            for (key, known) in known {
                let left = found.get(key).copied().unwrap_or(0);
                if left < *known {
                    let text = format!("`{key}` has {left} left of {known}: `cargo run -p tidy -- shrink`");
                    findings.push(Finding::new(PATH, 0, format!("{rule}: {text}")));
                }
            }
        }
        findings
    }

    /// The sum of a rule's entries.
    pub fn total(&self, rule: &str) -> usize {
        self.rules.get(rule).map_or(0, |counts| counts.values().sum())
    }
}

/// The text of the file for these counts.
pub fn file_of(found: &[(&str, Counts)]) -> String {
    let mut text = String::from(
        "# What is not yet as it should be, by rule: see `src/known.rs`. Written by `cargo run -p tidy -- shrink`, \
         which\n\
         # only lowers it; nothing is added by hand.\n",
    );
    for (rule, counts) in found.iter().filter(|(_, counts)| !counts.is_empty()) {
        let _ = writeln!(text, "\n[{rule}]");
        for (key, count) in counts {
            let _ = writeln!(text, "\"{key}\" = {count}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    fn known() -> Known {
        let tree = Tree { files: vec![File::new(PATH, "[rule]\n\"a.rs\" = 3\n\"b.rs\" = 1\n")] };
        Known::read(&tree).expect("valid")
    }

    fn counts(of: &[(&str, usize)]) -> Counts {
        of.iter().map(|(key, count)| ((*key).to_owned(), *count)).collect()
    }

    #[test]
    fn known_counts_pass_and_larger_ones_do_not() {
        let compare = |found: &[(&str, usize)]| known().compare("rule", &counts(found), Mended::MustShrink).len();
        assert_eq!(compare(&[("a.rs", 3), ("b.rs", 1)]), 0);
        assert_eq!(compare(&[("a.rs", 4), ("b.rs", 1)]), 1);
        assert_eq!(compare(&[("a.rs", 3), ("b.rs", 1), ("c.rs", 1)]), 1);
        assert_eq!(known().total("rule"), 4);
    }

    #[test]
    fn an_outdated_entry_is_found() {
        let found = counts(&[("a.rs", 2)]);
        assert_eq!(known().compare("rule", &found, Mended::MustShrink).len(), 2);
        assert_eq!(known().compare("rule", &found, Mended::MayShrink), []);
    }

    #[test]
    fn the_written_file_contains_the_counts() {
        let text = file_of(&[("rule", counts(&[("a.rs: f", 61)])), ("other", Counts::new())]);
        let known = Known::read(&Tree { files: vec![File::new(PATH, &text)] }).expect("valid");
        assert_eq!(known.compare("rule", &counts(&[("a.rs: f", 61)]), Mended::MustShrink), []);
    }
}
