//! The tests of the tree and their coverage: names of at most 80 characters, ids on a `// covers:` line above.
//!
//! Input: a tree. Output: [`Test`]s and findings. Ids are statements (CR-12) and sections (7.1) of `docs/protocol`, and
//! rows of `docs/capabilities.md` (`ring-cut`), separated by commas; several lines may follow each other.

use std::collections::BTreeSet;

use crate::Finding;
use crate::protocol::Pages;
use crate::tokens::{Token, separator_at, tokens};
use crate::tree::{File, Tree};

/// Maximum length of a name.
pub const MAX_NAME: usize = 80;
/// Prefix of a line with ids.
const MARK: &str = "// covers:";
/// Prefixes of ids that names contained before `covers` lines existed; two digits follow.
const FORMER_IDS: [&str; 8] = ["cr", "jr", "lc", "mr", "sm", "cf", "fr", "ac"];

/// A function with `#[test]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Test {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// Line of its `#[test]`.
    pub line: usize,
    /// Ids that it covers.
    pub covers: Vec<String>,
}

impl Test {
    /// Directory of its crate.
    pub fn home(&self) -> &str {
        self.file.strip_prefix("crates/").and_then(|path| path.split('/').next()).unwrap_or(&self.file)
    }
}

/// All tests of a tree.
pub fn all(tree: &Tree) -> Vec<Test> {
    tree.rust().flat_map(in_file).collect()
}

fn in_file(file: &File) -> Vec<Test> {
    let lines: Vec<&str> = file.text.lines().map(str::trim).collect();
    let test = |(name, line): (String, usize)| {
        let above = lines[..line - 1].iter().rev().take_while(|text| text.starts_with("//") || text.starts_with("#["));
        let covers = above.filter_map(|text| text.strip_prefix(MARK)).flat_map(ids).map(str::to_owned).collect();
        Test { name, file: file.path.clone(), line, covers }
    };
    named(&tokens(&file.text)).into_iter().map(test).collect()
}

fn ids(list: &str) -> impl Iterator<Item = &str> {
    list.split(',').map(str::trim)
}

/// Names of the functions with `#[test]`, also inside `proptest!`, and the line of the attribute.
fn named(tokens: &[Token]) -> Vec<(String, usize)> {
    let mut names = Vec::new();
    let mut marked = None;
    for (at, token) in tokens.iter().enumerate() {
        let attribute = at >= 2 && tokens[at - 1].is('[') && tokens[at - 2].is('#');
        if token.is_ident("test") && attribute && !separator_at(tokens, at + 1) {
            marked = Some(token.line);
        } else if token.is_ident("fn")
            && let Some(line) = marked.take()
        {
            names.extend(tokens.get(at + 1).and_then(Token::ident).map(|name| (name.to_owned(), line)));
        }
    }
    names
}

/// Names that are too long or contain ids.
pub fn unfit_names(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for test in all(tree) {
        let name = &test.name;
        if name.len() > MAX_NAME {
            let text = format!("`{name}` has {} characters, more than {MAX_NAME}: say what holds", name.len());
            findings.push(Finding::new(&test.file, test.line, text));
        }
        if carries_id(name) {
            findings.push(Finding::new(&test.file, test.line, format!("`{name}`: ids go to a line `{MARK} ...`")));
        }
    }
    findings
}

fn carries_id(name: &str) -> bool {
    let parts: Vec<&str> = name.split('_').collect();
    parts.windows(2).any(|pair| {
        let number = pair[1].bytes().all(|b| b.is_ascii_digit());
        number && (pair[0] == "facts" || FORMER_IDS.contains(&pair[0]) && pair[1].len() == 2)
    })
}

/// Unknown ids, and `covers` lines without a test.
pub fn unresolved_covers(tree: &Tree, features: &BTreeSet<String>) -> Vec<Finding> {
    let pages = Pages::of(tree);
    let mut findings = Vec::new();
    for file in tree.rust() {
        let tests = in_file(file);
        for test in &tests {
            for id in test.covers.iter().filter(|id| !pages.know(id) && !features.contains(*id)) {
                let text = format!("`{id}` is neither in docs/protocol nor a row of docs/capabilities.md");
                findings.push(Finding::new(&file.path, test.line, text));
            }
        }
        let written = file.text.lines().filter_map(|line| line.trim().strip_prefix(MARK)).flat_map(ids).count();
        let attached: usize = tests.iter().map(|test| test.covers.len()).sum();
        if written != attached {
            findings.push(Finding::new(&file.path, 0, format!("a line `{MARK}` does not stand above a test")));
        }
    }
    findings
}

/// Prefix of the statements that each need a test: statements about descriptions of devices and networks.
const COVERED: &str = "ES-";

/// Claimed statements that no test covers.
pub fn uncovered_statements(tree: &Tree) -> Vec<Finding> {
    let covered: BTreeSet<String> = all(tree).into_iter().flat_map(|test| test.covers).collect();
    let claimed = Pages::of(tree).statements;
    let claimed = claimed.iter().filter(|id| id.starts_with(COVERED));
    let missing = claimed.filter(|id| !covered.contains(*id));
    missing.map(|id| Finding::new("docs/protocol", 0, format!("no test covers `{id}`"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claimed_statement_about_descriptions_needs_a_test() {
        let page = "| ES-12 | claimed |\n| ES-13 | claimed |\n| CR-12 | claimed |\n";
        let source = "// covers: ES-12\n#[test]\nfn it_holds() {}\n";
        let files = vec![File::new("docs/protocol/a.md", page), File::new("crates/a/src/b.rs", source)];
        let findings = uncovered_statements(&Tree { files });
        assert_eq!(
            findings.iter().map(ToString::to_string).collect::<Vec<_>>(),
            ["docs/protocol: no test covers `ES-13`"]
        );
    }

    fn tree(source: &str) -> Tree {
        let page = "## 7.1 Delays\n| CR-12 | reported once |\n";
        let files = vec![File::new("docs/protocol/a.md", page), File::new("crates/a/src/b.rs", source)];
        Tree { files }
    }

    const SOURCE: &str =
        "/// Why.\n// covers: CR-12, 7.1\n// covers: ring-cut\n#[test]\nfn it_holds() {}\nfn other() {}\n";

    #[test]
    fn a_test_covers_the_ids_in_the_lines_above_it() {
        let tests = all(&tree(SOURCE));
        assert_eq!(tests.len(), 1);
        assert_eq!((tests[0].name.as_str(), tests[0].line, tests[0].home()), ("it_holds", 4, "a"));
        assert_eq!(tests[0].covers, ["ring-cut", "CR-12", "7.1"]);
        let inside = "proptest! {\n    // covers: 7.1\n    #[test]\n    fn always(x in 0..1) {}\n}\n";
        assert_eq!(all(&tree(inside))[0].covers, ["7.1"]);
    }

    #[test]
    fn unknown_ids_are_found() {
        let features = BTreeSet::from(["ring-cut".to_owned()]);
        assert!(unresolved_covers(&tree(SOURCE), &features).is_empty());
        assert_eq!(unresolved_covers(&tree(SOURCE), &BTreeSet::new()).len(), 1);
        let source = concat!("// covers: CR", "-99, 7.9\n#[test]\nfn a() {}\n");
        assert_eq!(unresolved_covers(&tree(source), &features).len(), 2);
    }

    #[test]
    fn a_covers_line_above_no_test_is_found() {
        let source = "// covers: 7.1\nfn not_a_test() {}\n";
        assert_eq!(unresolved_covers(&tree(source), &BTreeSet::new()).len(), 1);
    }

    #[test]
    fn names_of_more_than_80_characters_or_with_ids_are_found() {
        let name = |name: &str| unfit_names(&tree(&format!("#[test]\nfn {name}() {{}}\n"))).len();
        assert_eq!(name(&"a".repeat(80)), 0);
        assert_eq!(name(&"a".repeat(81)), 1);
        assert_eq!(name(concat!("told_once_cr", "_12")), 1);
        assert_eq!(name(concat!("delays_are_exact_fac", "ts_7_1")), 1);
        assert_eq!(name("mailboxes_are_on_sm_0_and_sm_1"), 0);
    }
}
