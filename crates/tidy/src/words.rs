//! Words for people, which the field does not use for devices and frames.
//!
//! Input: a tree. Output: [`Counts`] of such words per file outside of the allow-list ([`ALLOWED`]). Data sheets name
//! the acting device: "the SubDevice that processes the frame".

use crate::Finding;
use crate::known::{self, Counts};
use crate::tree::{File, Tree};

/// Words that no data sheet has.
pub const WORDS: [&str; 9] =
    ["who", "whoever", "whom", "somebody", "nobody", "everybody", "someone", "anyone", "everyone"];

/// A place that may have such words.
#[derive(Clone, Copy, Debug)]
pub struct Allowed {
    /// The file.
    pub file: &'static str,
    /// What is allowed in it, word for word; the whole file without one.
    pub phrase: Option<&'static str>,
    /// Reason of the exception.
    pub reason: &'static str,
}

/// The allow-list. Entries that allow nothing any more are findings ([`stale`]).
pub const ALLOWED: [Allowed; 1] =
    [Allowed { file: "crates/tidy/src/words.rs", phrase: None, reason: "lists the words and tests the rule" }];

/// Files whose keys are names of other files, which are counted where they are.
const NAMES_OF_FILES: [&str; 1] = [known::PATH];

/// How often each file uses one of [`WORDS`] outside of the allow-list.
pub fn for_people(tree: &Tree) -> Counts {
    outside(tree, &ALLOWED)
}

fn outside(tree: &Tree, allowed: &[Allowed]) -> Counts {
    let files = tree.files.iter().filter(|file| !NAMES_OF_FILES.contains(&file.path.as_str()));
    let counted = files.map(|file| (file.path.clone(), count(&file.text) - allowed_in(file, allowed)));
    counted.filter(|(_, count)| *count > 0).collect()
}

/// Words of a file that the list allows.
fn allowed_in(file: &File, allowed: &[Allowed]) -> usize {
    let entries: Vec<&Allowed> = allowed.iter().filter(|entry| entry.file == file.path).collect();
    if entries.iter().any(|entry| entry.phrase.is_none()) {
        return count(&file.text);
    }
    let phrases = entries.iter().filter_map(|entry| entry.phrase);
    phrases.map(|phrase| file.text.matches(phrase).count() * count(phrase)).sum()
}

/// Entries of the allow-list that allow nothing.
pub fn stale(tree: &Tree) -> Vec<Finding> {
    stale_of(tree, &ALLOWED)
}

fn stale_of(tree: &Tree, allowed: &[Allowed]) -> Vec<Finding> {
    let is_used = |entry: &&Allowed| tree.file(entry.file).is_some_and(|file| allowed_in(file, &[**entry]) > 0);
    let unused = allowed.iter().filter(|entry| !is_used(entry));
    unused.map(|entry| Finding::new(entry.file, 0, format!("allows nothing: {:?}", entry.phrase))).collect()
}

fn count(text: &str) -> usize {
    let words = text.split(|c: char| !c.is_alphabetic());
    words.filter(|word| WORDS.iter().any(|wanted| word.eq_ignore_ascii_case(wanted))).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree() -> Tree {
        let text = "// Whoever reads this. Whose?\nfn nobody_answers() { \"who\" }";
        Tree { files: vec![File::new("a.rs", text), File::new("b.md", "wholly")] }
    }

    #[test]
    fn words_are_counted_in_names_and_comments_alike() {
        assert_eq!(outside(&tree(), &[]), [("a.rs".to_owned(), 3)].into());
    }

    #[test]
    fn a_phrase_is_allowed_in_its_file_and_an_unused_entry_is_found() {
        let allow = |file, phrase| Allowed { file, phrase, reason: "a test" };
        let phrase = [allow("a.rs", Some("Whoever reads"))];
        assert_eq!(outside(&tree(), &phrase), [("a.rs".to_owned(), 2)].into());
        assert!(outside(&tree(), &[allow("a.rs", None)]).is_empty());
        assert_eq!(stale_of(&tree(), &phrase), []);
        let unused = [allow("a.rs", Some("nobody knows")), allow("b.md", None), allow("c.rs", None)];
        assert_eq!(stale_of(&tree(), &unused).len(), 3);
    }
}
