//! What is not yet as it should be: counts that may shrink and never grow.
//!
//! In go the [`Counts`] of a rule and `crates/tidy/known.toml`, out come findings. A key that is not in the file and a
//! number above the one there are findings; so is an entry that is mended, except for the words, which many hands
//! mend at once. `cargo run -p tidy -- shrink` lowers the file to what is there.

use std::collections::BTreeMap;
use std::fmt::Write;

use toml::{Table, Value};

use crate::Finding;
use crate::tree::Tree;

/// What a rule counts: a file or an item, and how much there is.
pub type Counts = BTreeMap<String, usize>;

/// Where known faults are listed.
pub const PATH: &str = "crates/tidy/known.toml";

/// Known faults by rule.
#[derive(Default)]
pub struct Known {
    rules: BTreeMap<String, Counts>,
}

/// What follows from an entry that is larger than what was found.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mended {
    /// The file has to shrink at once.
    MustShrink,
    /// It shrinks when there is time.
    MayShrink,
}

impl Known {
    /// Reads the file in a tree; without one nothing is known.
    pub fn read(tree: &Tree) -> Result<Known, Finding> {
        let text = tree.file(PATH).map_or("", |file| file.text.as_str());
        let table: Table = text.parse().map_err(|error| Finding::new(PATH, 0, format!("cannot be read: {error}")))?;
        let count = |(key, value): (&String, &Value)| {
            value.as_integer().and_then(|count| usize::try_from(count).ok()).map(|count| (key.clone(), count))
        };
        let counts = |value: &Value| value.as_table().into_iter().flatten().filter_map(count).collect::<Counts>();
        Ok(Known { rules: table.iter().map(|(rule, value)| (rule.clone(), counts(value))).collect() })
    }

    /// What a rule found, against what is known of it.
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

/// The file that lists exactly what was found.
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
    fn what_is_known_passes_and_more_of_it_does_not() {
        let compare = |found: &[(&str, usize)]| known().compare("rule", &counts(found), Mended::MustShrink).len();
        assert_eq!(compare(&[("a.rs", 3), ("b.rs", 1)]), 0);
        assert_eq!(compare(&[("a.rs", 4), ("b.rs", 1)]), 1);
        assert_eq!(compare(&[("a.rs", 3), ("b.rs", 1), ("c.rs", 1)]), 1);
        assert_eq!(known().total("rule"), 4);
    }

    #[test]
    fn an_entry_that_is_mended_has_to_go() {
        let found = counts(&[("a.rs", 2)]);
        assert_eq!(known().compare("rule", &found, Mended::MustShrink).len(), 2);
        assert_eq!(known().compare("rule", &found, Mended::MayShrink), []);
    }

    #[test]
    fn the_file_that_is_written_says_what_was_found() {
        let text = file_of(&[("rule", counts(&[("a.rs: f", 61)])), ("other", Counts::new())]);
        let known = Known::read(&Tree { files: vec![File::new(PATH, &text)] }).expect("valid");
        assert_eq!(known.compare("rule", &counts(&[("a.rs: f", 61)]), Mended::MustShrink), []);
    }
}
