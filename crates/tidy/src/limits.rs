//! Size limits: lines of a function and of a file, columns of a line, characters of a test name.
//!
//! Input: a tree. Output: [`Counts`] of items beyond a limit.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use crate::known::{self, Counts};
use crate::tree::{File, Tree};
use crate::{Finding, interface};

/// Lines of a function, from `fn` to its closing brace: it fits a screen.
pub const FUNCTION_LINES: usize = 60;
/// Lines of a file, except tests.
pub const FILE_LINES: usize = 500;
/// Columns of a line.
pub const COLUMNS: usize = 120;

/// Functions with more than [`FUNCTION_LINES`] lines, with their lengths; tests are included.
pub fn long_functions(tree: &Tree) -> Result<Counts, Finding> {
    Ok(functions(tree)?.into_iter().filter(|(_, lines)| *lines > FUNCTION_LINES).collect())
}

/// The longest function, with its length; tests are included.
pub fn longest_function(tree: &Tree) -> Result<Option<(String, usize)>, Finding> {
    Ok(functions(tree)?.into_iter().max_by_key(|(_, lines)| *lines))
}

/// All functions with their lengths.
fn functions(tree: &Tree) -> Result<Vec<(String, usize)>, Finding> {
    let mut all = Vec::new();
    for file in tree.rust() {
        let syntax = syn::parse_file(&file.text)
            .map_err(|error| Finding::new(&file.path, error.span().start().line, format!("does not parse: {error}")))?;
        let mut lengths = Lengths(Vec::new());
        lengths.visit_file(&syntax);
        all.extend(lengths.0.into_iter().map(|(name, lines)| (format!("{}: {name}", file.path), lines)));
    }
    for file in tree.files.iter().filter(|file| file.path.ends_with(".c")) {
        all.extend(
            functions_of_c(&file.text).into_iter().map(|(name, lines)| (format!("{}: {name}", file.path), lines)),
        );
    }
    Ok(all)
}

/// Functions of C with their lines, from the line of the name to the closing brace. Both braces of a body are at the
/// beginning of a line.
fn functions_of_c(text: &str) -> Vec<(String, usize)> {
    let (mut found, mut head): (_, Option<(String, usize)>) = (Vec::new(), None);
    for (at, line) in text.lines().enumerate() {
        let name = line.split('(').next().and_then(|before| before.rsplit([' ', '*']).next()).unwrap_or_default();
        let is_head = line.starts_with(char::is_alphabetic) && line.contains('(') && !line.ends_with(';');
        match (line, &head) {
            ("}", Some((name, from))) => {
                found.push((name.clone(), at + 1 - from));
                head = None;
            }
            _ if is_head => head = Some((name.to_owned(), at)),
            _ => {}
        }
    }
    found
}

/// Name and lines of each function.
struct Lengths(Vec<(String, usize)>);

impl Lengths {
    fn add(&mut self, signature: &syn::Signature, block: &syn::Block) {
        let lines = block.span().end().line + 1 - signature.fn_token.span.start().line;
        self.0.push((signature.ident.to_string(), lines));
    }

    /// Functions between the brackets of a macro: `fn`, a name, and a body before the next semicolon.
    fn add_tokens(&mut self, tokens: TokenStream) {
        let mut begun: Option<(String, usize)> = None;
        let mut tokens = tokens.into_iter().peekable();
        while let Some(token) = tokens.next() {
            match token {
                TokenTree::Ident(word) if word == "fn" => {
                    let name = tokens.peek().map(ToString::to_string);
                    begun = name.map(|name| (name, word.span().start().line));
                }
                TokenTree::Punct(sign) if sign.as_char() == ';' => begun = None,
                TokenTree::Group(group) => {
                    if group.delimiter() == Delimiter::Brace
                        && let Some((name, from)) = begun.take()
                    {
                        self.0.push((name, group.span_close().end().line + 1 - from));
                    }
                    self.add_tokens(group.stream());
                }
                _ => {}
            }
        }
    }
}

impl<'ast> Visit<'ast> for Lengths {
    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.add(&item.sig, &item.block);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.add(&item.sig, &item.block);
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        if let Some(block) = &item.default {
            self.add(&item.sig, block);
        }
        visit::visit_trait_item_fn(self, item);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.add_tokens(item.tokens.clone());
    }
}

/// Sources with more than [`FILE_LINES`] lines.
pub fn long_files(tree: &Tree) -> Counts {
    files(tree).filter(|(_, lines)| *lines > FILE_LINES).collect()
}

/// The longest source, with its lines.
pub fn longest_file(tree: &Tree) -> Option<(String, usize)> {
    files(tree).max_by_key(|(_, lines)| *lines)
}

/// Sources and scripts with their lines, except tests.
fn files(tree: &Tree) -> impl Iterator<Item = (String, usize)> {
    let lines = |file: &File| (file.path.clone(), file.text.lines().count());
    tree.files.iter().filter(|file| is_program(&file.path) && !is_test(&file.path)).map(lines)
}

/// Whether a file has source code, or is a script without an extension.
fn is_program(path: &str) -> bool {
    let name = path.rsplit('/').next().unwrap_or(path);
    name.rsplit_once('.').is_none_or(|(_, extension)| ["c", "py", "rs", "sh"].contains(&extension))
}

/// Whether a file has nothing but tests.
pub fn is_test(path: &str) -> bool {
    path.contains("/tests/") || path.ends_with("/tests.rs")
}

/// Files with one line for each entry, which programs write.
const LISTS: [&str; 2] = [known::PATH, interface::LIST];
/// Directory in which proptest keeps cases, one line each.
const CASES: &str = "/proptest-regressions/";

/// Number of lines of each file wider than [`COLUMNS`]. Tables and links in Markdown cannot be wrapped.
pub fn wide_lines(tree: &Tree) -> Counts {
    let width = |file: &File| {
        let markdown = file.path.ends_with(".md");
        let cannot_wrap = |line: &str| markdown && (line.starts_with('|') || is_one_word(line));
        let wide = |line: &&str| line.chars().count() > COLUMNS && !cannot_wrap(line);
        (file.path.clone(), file.text.lines().filter(wide).count())
    };
    let written = tree.files.iter().filter(|file| !LISTS.contains(&file.path.as_str()) && !file.path.contains(CASES));
    written.map(width).filter(|(_, lines)| *lines > 0).collect()
}

/// Whether a line of Markdown cannot be wrapped after its list mark.
fn is_one_word(line: &str) -> bool {
    !line.trim_start_matches([' ', '-', '*', '>']).contains(' ')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(path: &str, text: &str) -> Tree {
        Tree { files: vec![File::new(path, text)] }
    }

    #[test]
    fn functions_of_all_kinds_are_measured() {
        let body = "\n    f();".repeat(58);
        let fits = tree("a.rs", &format!("#[test]\nfn fits() {{{body}\n}}\n"));
        assert_eq!(long_functions(&fits), Ok(Counts::new()));
        let body = "\n    f();".repeat(60);
        let text = format!(
            "impl A {{ fn a() {{{body}\n}} }} trait T {{ fn t() {{{body} }} }} fn o() {{ fn i() {{{body} }} }}"
        );
        let long = long_functions(&tree("a.rs", &text)).expect("parses");
        let expected = [("a.rs: a", 62), ("a.rs: i", 61), ("a.rs: o", 61), ("a.rs: t", 61)];
        assert_eq!(long, expected.map(|(name, lines)| (name.to_owned(), lines)).into());
        let longest = longest_function(&tree("a.rs", &text)).expect("parses");
        assert_eq!(longest, Some(("a.rs: a".to_owned(), 62)));
    }

    #[test]
    fn functions_in_macros_and_in_c_are_measured() {
        let body = "\n    f();".repeat(60);
        let text =
            format!("proptest! {{\n    #[test]\n    fn a(b in c()) {{{body}\n    }}\n\n    fn d() {{\n    }}\n}}\n");
        let long = long_functions(&tree("a.rs", &text)).expect("parses");
        assert_eq!(long, [("a.rs: a".to_owned(), 62)].into());
        let head = "static int long_one(void)\n{";
        let text =
            format!("int declared(void);\nint (*pointer)(void) = 0;\n\n{head}{body}\n}}\nint main(void)\n{{\n}}\n");
        let all = functions(&tree("a.c", &text)).expect("parses");
        assert_eq!(all, [("a.c: long_one".to_owned(), 63), ("a.c: main".to_owned(), 3)]);
    }

    #[test]
    fn files_of_tests_may_be_longer() {
        assert_eq!(long_files(&tree("a/src/b.rs", &"\n".repeat(501))).len(), 1);
        assert!(long_files(&tree("a/src/b.rs", &"\n".repeat(500))).is_empty());
        for script in ["ci/check", "a/b.py", "examples/c/d.c"] {
            assert_eq!(long_files(&tree(script, &"\n".repeat(501))).len(), 1, "{script}");
        }
        assert_eq!(longest_file(&tree("a/src/b.rs", "\n\n")), Some(("a/src/b.rs".to_owned(), 2)));
        assert_eq!(longest_file(&tree("a/tests/b.rs", "\n\n")), None);
        for path in ["a/src/tests.rs", "a/tests/b.rs", "a/b.md"] {
            assert!(long_files(&tree(path, &"\n".repeat(501))).is_empty(), "{path}");
        }
    }

    #[test]
    fn columns_are_characters() {
        assert!(wide_lines(&tree("a.rs", &"ä".repeat(120))).is_empty());
        assert_eq!(wide_lines(&tree("a.rs", &"ä".repeat(121))).len(), 1);
    }

    #[test]
    fn lines_that_cannot_be_wrapped_are_excepted_in_markdown_only() {
        let link = format!("- https://{}", "a".repeat(120));
        let table = format!("| {} |", "a ".repeat(60));
        for line in [&link, &table] {
            assert!(wide_lines(&tree("a.md", line)).is_empty());
            assert_eq!(wide_lines(&tree("a.rs", line)).len(), 1);
        }
        assert_eq!(wide_lines(&tree("a.md", &"ab ".repeat(41))).len(), 1);
    }
}
