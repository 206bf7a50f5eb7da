//! Allowed arrows between the modules of the engine.
//!
//! Input: the source of `crates/engine/src`. Output: a finding for every path through `crate` or `super` from one
//! top-level module to another that [`ENGINE`] does not list. Tests may name anything. A name that the crate root
//! re-exports counts as its source module. The check finds `use` inside the body of a macro, but no paths that a macro
//! composes.

use std::collections::BTreeMap;

use crate::Finding;
use crate::tokens::{Token, separator_at, tokens};
use crate::tree::{File, Tree};

/// Top-level modules of the engine, lower ones first, and the modules that each may name.
///
/// Edit only this table when a module is added; `docs/ARCHITECTURE.md` states why the arrows have these directions. The
/// two halves, `exchange` (cyclic) and `supervisor` with its procedures (acyclic), never name each other.
#[rustfmt::skip]
pub const ENGINE: &[(&str, &[&str])] = &[
    // ground
    ("time", &[]),
    ("link", &[]),
    ("queue", &[]),
    ("order", &[]),
    ("direction", &[]),
    ("domain", &[]),
    ("declared", &[]),
    ("request_counter", &[]),
    ("request", &["declared", "request_counter"]),
    ("junction", &["declared"]),
    ("role", &[]),
    // frames
    ("ring", &["time", "link"]),
    ("board", &["order", "time", "link", "ring"]),
    ("standby", &["time", "link", "ring"]),
    // knowledge of the bus
    ("info", &["direction"]),
    ("topology", &["order", "info", "link"]),
    ("ring_status", &["declared", "time", "link", "ring", "topology"]),
    ("config", &["order", "declared", "info"]),
    ("clocks", &["order", "topology"]),
    ("knowledge", &["order", "direction", "info", "ring", "topology", "clocks"]),
    ("plan", &["order", "info", "topology", "config"]),
    ("layout", &["order", "declared", "link", "ring", "direction", "domain"]),
    // what happened
    ("event", &["declared", "time", "link", "queue", "ring", "domain", "info", "topology", "ring_status", "clocks",
        "role"]),
    // what is known of the segment, and what follows from what is seen
    ("segment", &["order", "declared", "time", "link", "ring", "board", "info", "topology", "ring_status", "config",
        "clocks", "plan", "layout", "event", "junction"]),
    // cyclic half
    ("exchange", &["order", "direction", "declared", "time", "link", "queue", "domain", "role", "ring", "board",
        "clocks", "layout", "event"]),
    // acyclic half
    ("supervisor", &["time", "request_counter", "link", "queue", "ring", "board", "event", "role"]),
    ("mail", &["declared", "time", "info", "config", "event", "knowledge", "supervisor", "role"]),
    ("procedures", &["order", "declared", "domain", "time", "request_counter", "link", "queue", "ring", "board", "info",
        "topology", "ring_status", "config", "clocks", "plan", "layout", "event", "knowledge", "segment",
        "supervisor", "mail", "request", "junction", "role"]),
    // both together
    ("main_device", &["order", "declared", "direction", "time", "request_counter", "link", "queue", "domain", "ring",
        "board", "info", "topology", "ring_status", "config", "plan", "layout", "event", "knowledge", "segment",
        "exchange", "supervisor", "mail", "request", "junction", "role", "procedures", "standby"]),
];

/// The engine's sources.
const ENGINE_SOURCES: &str = "crates/engine/src/";

/// Arrows in the engine that are not in [`ENGINE`], and modules that it does not list.
pub fn forbidden_arrows_in_engine(tree: &Tree) -> Vec<Finding> {
    forbidden_arrows(tree, ENGINE_SOURCES, ENGINE)
}

/// Arrows below `sources` that are not in `table`, and top-level modules that it does not list.
fn forbidden_arrows(tree: &Tree, sources: &str, table: &[(&str, &[&str])]) -> Vec<Finding> {
    let root = tree.file(&format!("{sources}lib.rs")).map(|file| tokens(&file.text)).unwrap_or_default();
    let exports = re_exports(&root);
    let mut findings = Vec::new();
    for file in tree.rust() {
        let Some(module) = file.path.strip_prefix(sources).and_then(module_path) else { continue };
        let Some(from) = module.first() else { continue };
        let Some((_, allowed)) = table.iter().find(|(name, _)| name == from) else {
            findings.push(Finding::new(&file.path, 0, format!("`{from}` is not in the table: {TABLE}")));
            continue;
        };
        for arrow in arrows(file, &module) {
            let to = exports.get(&arrow.to).unwrap_or(&arrow.to);
            if to != from && !allowed.contains(&to.as_str()) {
                let text = format!("`{from}` must not name `{to}` ({TABLE})");
                findings.push(Finding::new(&file.path, arrow.line, text));
            }
        }
    }
    findings.dedup();
    findings
}

const TABLE: &str = "crates/tidy/src/modules.rs, table ENGINE";

/// Module path of a source file below the crate root; `None` for files of tests, empty for the root itself.
fn module_path(path: &str) -> Option<Vec<String>> {
    let path = path.strip_suffix(".rs")?;
    let mut parts: Vec<String> = path.split('/').map(str::to_owned).collect();
    if parts.iter().any(|part| part == "tests") {
        return None;
    }
    if matches!(parts.last().map(String::as_str), Some("mod" | "lib")) {
        parts.pop();
    }
    Some(parts)
}

/// A top-level name used by a file.
struct Arrow {
    to: String,
    line: usize,
}

fn arrows(file: &File, module: &[String]) -> Vec<Arrow> {
    let tokens = tokens(&file.text);
    let mut walk = Walk { tokens: &tokens, module: module.to_vec(), inline: Vec::new(), depth: 0, arrows: Vec::new() };
    let mut at = 0;
    while at < tokens.len() {
        at = walk.step(at);
    }
    walk.arrows
}

/// A walk through a file that tracks the current module.
struct Walk<'a> {
    tokens: &'a [Token],
    module: Vec<String>,
    /// Brace depth outside of each enclosing inline module.
    inline: Vec<usize>,
    depth: usize,
    arrows: Vec<Arrow>,
}

impl Walk<'_> {
    fn step(&mut self, at: usize) -> usize {
        let token = &self.tokens[at];
        if token.is('{') {
            self.depth += 1;
        } else if token.is('}') {
            self.depth = self.depth.saturating_sub(1);
            if self.inline.last() == Some(&self.depth) {
                self.inline.pop();
                self.module.pop();
            }
        } else if token.is_ident("mod") && self.tokens.get(at + 2).is_some_and(|t| t.is('{')) {
            return self.enter(at);
        } else if let Some(root) = self.root_of_path(at) {
            return self.path(root, at);
        }
        at + 1
    }

    fn enter(&mut self, at: usize) -> usize {
        let name = self.tokens[at + 1].ident().unwrap_or_default();
        if name == "tests" {
            return self.behind_braces(at + 2);
        }
        self.module.push(name.to_owned());
        self.inline.push(self.depth);
        self.depth += 1;
        at + 3
    }

    fn behind_braces(&self, open: usize) -> usize {
        let mut depth = 0;
        for (at, token) in self.tokens.iter().enumerate().skip(open) {
            if token.is('{') {
                depth += 1;
            } else if token.is('}') {
                depth -= 1;
                if depth == 0 {
                    return at + 1;
                }
            }
        }
        self.tokens.len()
    }

    /// Number of remaining levels of the current module for a path that starts here with `crate`, `self` or `super`.
    fn root_of_path(&self, at: usize) -> Option<usize> {
        let inside_path = at >= 2 && separator_at(self.tokens, at - 2);
        if inside_path || !separator_at(self.tokens, at + 1) {
            return None;
        }
        match self.tokens[at].ident() {
            Some("crate") => Some(0),
            Some("self") => Some(self.module.len()),
            Some("super") => Some(self.module.len().saturating_sub(1)),
            _ => None,
        }
    }

    /// Follows a path with its first segment at `at`; only paths that start in the crate root can leave the module.
    fn path(&mut self, mut root: usize, mut at: usize) -> usize {
        at += 3;
        while self.tokens.get(at).is_some_and(|t| t.is_ident("super")) && separator_at(self.tokens, at + 1) {
            root = root.saturating_sub(1);
            at += 3;
        }
        if root > 0 {
            return at;
        }
        let names = first_names(self.tokens, at);
        self.arrows.extend(names.into_iter().map(|(name, line)| Arrow { to: name.to_owned(), line }));
        at
    }
}

/// First names at `at`: one name, or those of each branch of a `{...}`.
fn first_names(tokens: &[Token], at: usize) -> Vec<(&str, usize)> {
    let Some(first) = tokens.get(at) else { return Vec::new() };
    if let Some(name) = first.ident() {
        return vec![(name, first.line)];
    }
    if !first.is('{') {
        return Vec::new();
    }
    let mut names = Vec::new();
    let mut depth = 0;
    for pair in tokens[at..].windows(2) {
        if pair[0].is('{') {
            depth += 1;
        } else if pair[0].is('}') {
            depth -= 1;
            if depth == 0 {
                break;
            }
        }
        if depth == 1
            && (pair[0].is('{') || pair[0].is(','))
            && let Some(name) = pair[1].ident()
        {
            names.push((name, pair[1].line));
        }
    }
    names
}

/// Names that the crate root re-exports with `pub use`, each with its source module.
fn re_exports(root: &[Token]) -> BTreeMap<String, String> {
    let mut exports = BTreeMap::new();
    let mut at = 0;
    while at < root.len() {
        let is_export = root[at].is_ident("pub") && root.get(at + 1).is_some_and(|t| t.is_ident("use"));
        if !is_export {
            at += 1;
            continue;
        }
        let end = (at..root.len()).find(|i| root[*i].is(';')).unwrap_or(root.len());
        let mut path = at + 2;
        while matches!(root.get(path).and_then(Token::ident), Some("crate" | "self")) {
            path += 3;
        }
        if let Some(module) = root.get(path).and_then(Token::ident) {
            for leaf in leaves(&root[path..end]) {
                exports.insert(leaf.to_owned(), module.to_owned());
            }
        }
        at = end;
    }
    exports
}

/// The names imported by a `use`: those before `,`, `}` and the end.
fn leaves(path: &[Token]) -> Vec<&str> {
    let is_end = |next: Option<&Token>| next.is_none_or(|t| t.is(',') || t.is('}'));
    path.iter().enumerate().filter(|(at, _)| is_end(path.get(at + 1))).filter_map(|(_, t)| t.ident()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &[(&str, &[&str])] = &[("low", &[]), ("middle", &["low"]), ("high", &["low", "middle"])];

    fn findings(path: &str, text: &str) -> Vec<String> {
        let root = "pub mod low; pub mod high; pub use high::{High, parts::{Wheel, Axle as Rod}}; pub use low::Low;";
        let files = vec![File::new("e/src/lib.rs", root), File::new(&format!("e/src/{path}"), text)];
        let tree = Tree { files };
        forbidden_arrows(&tree, "e/src/", TABLE).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn an_arrow_upwards_is_found_and_one_downwards_is_not() {
        assert!(findings("high.rs", "use crate::low::A; use crate::middle;").is_empty());
        let expected = "e/src/low.rs:2: `low` must not name `high` (crates/tidy/src/modules.rs, table ENGINE)";
        assert_eq!(findings("low.rs", "//! x\nuse crate::high::A;"), [expected]);
        assert_eq!(findings("low/part.rs", "fn f(_: crate::high::A) {}").len(), 1);
    }

    #[test]
    fn grouped_imports_are_followed() {
        let text = "use crate::{low::{A, B}, middle::C,\nhigh::{self, D}};";
        assert_eq!(findings("middle.rs", text).len(), 1);
        assert!(findings("high.rs", text).is_empty());
    }

    #[test]
    fn paths_through_super_are_followed() {
        assert_eq!(findings("low.rs", "use super::high::A;").len(), 1);
        assert_eq!(findings("low/part.rs", "use super::super::high::A;").len(), 1);
        assert!(findings("low/part.rs", "use super::high::A;").is_empty());
        assert!(findings("low.rs", "mod inner { use super::high::A; }").is_empty());
        assert_eq!(findings("low.rs", "mod inner { fn f() { {} } } use super::high::A;").len(), 1);
    }

    #[test]
    fn a_name_that_the_root_exports_counts_as_its_module() {
        assert_eq!(findings("low.rs", "use crate::High;").len(), 1);
        assert_eq!(findings("low.rs", "use crate::{Wheel,\nRod};").len(), 2);
        assert!(findings("middle.rs", "use crate::Low;").is_empty());
    }

    #[test]
    fn tests_may_name_anything() {
        assert!(findings("low/tests.rs", "use crate::high::A;").is_empty());
        assert!(findings("low.rs", "#[cfg(test)] mod tests { use crate::high::A; fn f() {} }").is_empty());
        assert_eq!(findings("low.rs", "mod tests { fn f() {} } use crate::high::A;").len(), 1);
    }

    #[test]
    fn a_module_without_a_row_is_found() {
        assert_eq!(findings("new.rs", "").len(), 1);
    }

    #[test]
    fn the_table_of_the_engine_has_no_cycle() {
        for (place, (module, allowed)) in ENGINE.iter().enumerate() {
            for name in *allowed {
                let lower = ENGINE[..place].iter().any(|(lower, _)| lower == name);
                assert!(lower, "`{module}` may name `{name}`, which is not a row above it");
            }
        }
    }

    #[test]
    fn the_two_halves_of_the_engine_do_not_name_each_other() {
        let row = |module: &str| ENGINE.iter().find(|(name, _)| *name == module).map(|(_, allowed)| *allowed);
        let exchange = row("exchange").expect("a row for exchange");
        for acyclic in ["supervisor", "procedures", "config", "info", "plan"] {
            assert!(!exchange.contains(&acyclic), "{acyclic}");
        }
        for acyclic in ["supervisor", "procedures"] {
            assert!(!row(acyclic).expect("a row").contains(&"exchange"), "{acyclic}");
        }
    }
}
