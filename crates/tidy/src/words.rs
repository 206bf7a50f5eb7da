//! Words for people, which the field does not use for devices and frames.
//!
//! Input: a tree. Output: [`Counts`] of such words per file. Data sheets name the acting device: "the SubDevice that
//! processes the frame".

use crate::known::{self, Counts};
use crate::tree::Tree;

/// Words that no data sheet has.
pub const WORDS: [&str; 6] = ["who", "whoever", "whom", "somebody", "nobody", "everybody"];

/// Files that may contain these words.
const ALLOWED: [&str; 2] = [known::PATH, "crates/tidy/src/words.rs"];

/// How often each file uses one of [`WORDS`].
pub fn for_people(tree: &Tree) -> Counts {
    let files = tree.files.iter().filter(|file| !ALLOWED.contains(&file.path.as_str()));
    files.map(|file| (file.path.clone(), count(&file.text))).filter(|(_, count)| *count > 0).collect()
}

fn count(text: &str) -> usize {
    let words = text.split(|c: char| !c.is_alphabetic());
    words.filter(|word| WORDS.iter().any(|wanted| word.eq_ignore_ascii_case(wanted))).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    #[test]
    fn words_are_counted_in_names_and_comments_alike() {
        let text = "// Whoever reads this. Whose?\nfn nobody_answers() { \"who\" }";
        let tree = Tree { files: vec![File::new("a.rs", text), File::new("b.md", "wholly")] };
        assert_eq!(for_people(&tree), [("a.rs".to_owned(), 3)].into());
    }
}
