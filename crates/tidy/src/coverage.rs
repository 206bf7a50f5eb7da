//! Lists the parts of `docs/protocol` that no test covers, as a source of new tests; not a rule.
//!
//! Input: a tree. Output: text. Sections that consist of others or of statements, and the chapters 0 (how to read) and
//! 11 (appendix), need no test.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use crate::covers;
use crate::protocol::Pages;
use crate::tree::Tree;

/// Number of tests of each id, including ids without a test.
fn counts(tree: &Tree) -> BTreeMap<String, usize> {
    let pages = Pages::of(tree);
    let parents = |section: &&String| pages.sections.iter().any(|other| other.starts_with(&format!("{section}.")));
    let leaves = pages.sections.iter().filter(|section| !parents(section));
    let facts = leaves.filter(|section| !pages.of_statements.contains(*section));
    let testable = facts.filter(|section| !matches!(section.split('.').next(), Some("0" | "11")));
    let mut counts: BTreeMap<String, usize> =
        pages.statements.iter().chain(testable).map(|id| (id.clone(), 0)).collect();
    for id in covers::all(tree).into_iter().flat_map(|test| test.covers) {
        if let Entry::Occupied(mut count) = counts.entry(id) {
            *count.get_mut() += 1;
        }
    }
    counts
}

/// The list, one line per kind of id.
pub fn report(tree: &Tree) -> String {
    let mut kinds: BTreeMap<String, (usize, Vec<String>)> = BTreeMap::new();
    for (id, count) in counts(tree) {
        let kind = if id.starts_with(|c: char| c.is_ascii_digit()) {
            "sections".to_owned()
        } else {
            id.chars().take_while(char::is_ascii_uppercase).collect()
        };
        let (all, missing) = kinds.entry(kind).or_default();
        *all += 1;
        if count == 0 {
            missing.push(id);
        }
    }
    let mut text = String::new();
    for (kind, (all, mut missing)) in kinds {
        missing.sort_by_key(|id| id.split('.').map(|part| part.parse().unwrap_or(0)).collect::<Vec<u32>>());
        text += &format!("{kind}: {} of {all} covered", all - missing.len());
        text += &if missing.is_empty() { "\n".to_owned() } else { format!("; no test: {}\n", missing.join(", ")) };
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    #[test]
    fn the_report_names_statements_and_sections_without_a_test() {
        let page = "# 7. Clocks\n## 7.1 Delays\n## 7.2 Drift\n### 7.2.1 Loop\n## 9.2 Ring\n| CR-01 | a |\n\
                    | CR-02 | b |\n## 11.3 Model\n";
        let source = "// covers: CR-02, 7.1\n#[test]\nfn a() {}\n";
        let files = vec![File::new("docs/protocol/a.md", page), File::new("crates/a/src/a.rs", source)];
        let expected = "CR: 1 of 2 covered; no test: CR-01\nsections: 1 of 2 covered; no test: 7.2.1\n";
        assert_eq!(report(&Tree { files }), expected);
    }
}
