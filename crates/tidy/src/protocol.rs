//! References to `docs/protocol`: every cited section and statement exists there.
//!
//! Input: a tree. Output: findings. A section is cited as `protocol 7.1`, several as `protocol 6.1, 6.3` or `protocol
//! 1.1 to 1.3`; a statement by its id (CR-12). Comments may break the line anywhere. The pages themselves cite sections
//! by bare numbers, which are not checked.

use std::collections::BTreeSet;

use crate::Finding;
use crate::tree::{File, Tree};

/// The directory of the pages.
const PAGES: &str = "docs/protocol/";
/// The word before a section, and words used before the pages were part of the repository.
const WORD: &str = "protocol";
const FORMER_WORDS: [&str; 2] = [concat!("fac", "ts"), concat!("she", "et")];
/// The word before a number that the repository does not have.
const OUTSIDE_WORD: &str = concat!("iss", "ue");
/// Pages about what was done: a number in them is history.
const HISTORY: &str = "CHANGELOG.md";

/// Ids that can be cited.
#[derive(Clone, Debug, Default)]
pub struct Pages {
    /// Numbers of headings: `7`, `7.1`, `7.2.1`.
    pub sections: BTreeSet<String>,
    /// Ids of statements: `CR-12`, `REQ031`.
    pub statements: BTreeSet<String>,
    /// Sections that consist of statements.
    pub of_statements: BTreeSet<String>,
}

impl Pages {
    /// Headings and statements of the pages in a tree.
    pub fn of(tree: &Tree) -> Pages {
        let mut pages = Pages::default();
        for file in tree.files.iter().filter(|file| file.path.starts_with(PAGES)) {
            let mut section = "";
            for line in file.text.lines() {
                if let Some(number) = heading_number(line) {
                    section = number;
                    pages.sections.insert(number.to_owned());
                } else if let Some(id) = line.strip_prefix("| ").and_then(|row| row.split(' ').next())
                    && (is_statement(id) || is_requirement(id))
                {
                    pages.statements.insert(id.to_owned());
                    pages.of_statements.insert(section.to_owned());
                }
            }
        }
        pages
    }

    /// Whether a section or statement with this id exists.
    pub fn know(&self, id: &str) -> bool {
        self.sections.contains(id) || self.statements.contains(id)
    }

    /// First letters of ids of statements.
    fn letters(&self) -> BTreeSet<&str> {
        self.statements.iter().filter_map(|id| id.split_once('-')).map(|(letters, _)| letters).collect()
    }
}

fn heading_number(line: &str) -> Option<&str> {
    let number = line.strip_prefix('#')?.trim_start_matches('#').trim_start().split(' ').next()?.trim_end_matches('.');
    is_section(number).then_some(number)
}

/// Digits separated by points.
fn is_section(word: &str) -> bool {
    word.split('.').all(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()))
}

/// Two capital letters, a hyphen, two or three digits.
pub fn is_statement(word: &str) -> bool {
    let (letters, number) = word.split_once('-').unwrap_or_default();
    letters.len() == 2
        && letters.bytes().all(|b| b.is_ascii_uppercase())
        && (2..=3).contains(&number.len())
        && number.bytes().all(|b| b.is_ascii_digit())
}

fn is_requirement(word: &str) -> bool {
    word.strip_prefix("REQ").is_some_and(|number| number.len() == 3 && is_section(number))
}

/// Citations that do not exist, or in the former form.
pub fn unresolved(tree: &Tree) -> Vec<Finding> {
    let pages = Pages::of(tree);
    let elsewhere = tree.files.iter().filter(|file| !file.path.starts_with(PAGES) && file.path != HISTORY);
    elsewhere.flat_map(|file| in_file(file, &pages)).collect()
}

fn in_file(file: &File, pages: &Pages) -> Vec<Finding> {
    let letters = pages.letters();
    let words = words(&file.text);
    let mut findings = Vec::new();
    for (at, (word, line)) in words.iter().enumerate() {
        let bare = trimmed(word);
        let next = words.get(at + 1).map_or("", |(word, _)| trimmed(word));
        let is_former = FORMER_WORDS.iter().any(|former| bare.eq_ignore_ascii_case(former));
        if is_former && opens_list(word) && (is_section(next) || is_statement(next)) {
            findings.push(Finding::new(&file.path, *line, format!("cite docs/protocol: `{WORD} {next}`")));
        }
        if bare.eq_ignore_ascii_case(OUTSIDE_WORD) && opens_list(word) && is_section(next) {
            findings.push(Finding::new(&file.path, *line, format!("`{bare} {next}` is not in this repository")));
        }
        if bare.eq_ignore_ascii_case(WORD) && opens_list(word) {
            let missing = cited(&words[at + 1..]).into_iter().filter(|section| !pages.sections.contains(*section));
            findings.extend(
                missing
                    .map(|section| Finding::new(&file.path, *line, format!("docs/protocol has no section {section}"))),
            );
        }
        if is_statement(bare) && letters.contains(&bare[..2]) && !pages.statements.contains(bare) {
            findings.push(Finding::new(&file.path, *line, format!("docs/protocol has no statement {bare}")));
        }
    }
    findings
}

/// Words separated by blanks with their lines, without comment marks.
pub(crate) fn words(text: &str) -> Vec<(&str, usize)> {
    let mut words = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let body = line.trim_start().trim_start_matches(['/', '!', '#']);
        words.extend(body.split_whitespace().map(|word| (word, number + 1)));
    }
    words
}

/// A word without the punctuation around it.
pub(crate) fn trimmed(word: &str) -> &str {
    word.trim_matches(|c: char| !c.is_ascii_alphanumeric())
}

/// Whether a list of sections may follow the word: no punctuation closes the sentence after it.
fn opens_list(word: &str) -> bool {
    word.ends_with(|c: char| c.is_ascii_alphanumeric())
}

/// The sections at the beginning of some words: each but the last is followed by a comma, `and` or `to`.
fn cited<'a>(words: &[(&'a str, usize)]) -> Vec<&'a str> {
    let mut sections = Vec::new();
    let mut awaited = true;
    for (word, _) in words {
        let bare = trimmed(word);
        if matches!(*word, "and" | "to") && !sections.is_empty() {
            awaited = true;
        } else if awaited && (is_section(bare) || is_statement(bare)) && !word.starts_with("0x") {
            // A further bare number may count something else: `protocol 7.1, 2 links`.
            if is_section(bare) && (sections.is_empty() || bare.contains('.')) {
                sections.push(bare);
            }
            awaited = word.ends_with(',');
        } else {
            break;
        }
    }
    sections
}

#[cfg(test)]
mod tests {
    use super::*;

    fn findings(path: &str, text: &str) -> Vec<String> {
        let page = "# 7. Clocks\n## 7.1 Delays\n### 7.2.1 Loop\n| CR-12 | reported once | x |\n| REQ031 | M | y |\n";
        let files = vec![File::new("docs/protocol/07-clocks.md", page), File::new(path, text)];
        unresolved(&Tree { files }).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn sections_and_statements_that_exist_are_found_on_the_pages() {
        let text = "//! Delays (protocol 7.1, 7.2.1), also protocol\n//! 7, CR-12 and protocol 7.1 to 7.2.1.\n";
        assert!(findings("crates/a/src/a.rs", text).is_empty());
    }

    #[test]
    fn sections_and_statements_that_do_not_exist_are_named_with_their_line() {
        let text = format!("// {WORD}\n// 7.9, and {WORD} 7.1, 7.8 and 7.7.\n// {}-13 and X-9\n", "CR");
        let expected = ["7.9", "7.8", "7.7", concat!("CR", "-13")];
        let found = findings("crates/a/src/a.rs", &text);
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (finding, missing) in found.iter().zip(expected) {
            assert!(finding.ends_with(missing), "{finding}");
        }
        assert_eq!(findings("docs/dc.md", &format!("as {WORD} 8.1 says\n")).len(), 1);
    }

    #[test]
    fn other_numbers_after_the_word_are_ignored() {
        assert!(findings("crates/a/src/a.rs", "// protocol, 17 of them; no protocol (0x0F)\n").is_empty());
        assert!(findings("crates/a/src/a.rs", "// protocol 7.1, 2 links; protocol 7.1: 60 bytes\n").is_empty());
    }

    #[test]
    fn the_former_form_of_citations_is_found() {
        assert_eq!(findings("ci/check-mail", concat!("# Mail (fac", "ts\n# 7.1).\n")).len(), 1);
        assert_eq!(findings("docs/ecrt.md", concat!("| x | she", "et 5 |\n")).len(), 1);
        assert_eq!(findings("crates/a/tests/b.py", concat!("# (iss", "ue 4)\n")).len(), 1);
        assert_eq!(findings("CHANGELOG.md", concat!("- as iss", "ue 4 says\n")).len(), 0);
    }
}
