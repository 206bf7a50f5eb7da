//! Arrows between the files of one crate: a file names an item of another file.
//!
//! Input: a tree and a directory below `crates/`. Output: the [`Arrow`]s of its library and its programs together.
//! Every path in the code counts, also in macro invocations, and points to the file that contains the item, through any
//! number of re-exports. `mod` lines and re-exports (`pub use`, `pub(crate) use`) are no arrows; an import is one,
//! because the methods of a trait need it without naming it. Test code may name anything.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, Block, Expr, ExprCall, ImplItem, Item, ItemMod, ItemUse, Pat, Stmt, TraitItem, Visibility};

use crate::Finding;
use crate::names::{Import, ModuleId, Program, Target, attributes_of, imports, is_for_tests};
use crate::tree::Tree;

/// One file names an item of another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrow {
    /// The path as written.
    pub path: String,
    /// Line in the file that names it.
    pub line: usize,
}

/// The first arrow from each file to each other file, by both paths.
pub type Arrows = BTreeMap<(String, String), Arrow>;

/// Arrows within the crate at `crates/NAME`.
pub fn of_crate(tree: &Tree, name: &str) -> Result<Arrows, Finding> {
    let mut arrows = Arrows::new();
    for root in roots(tree, name) {
        let program = Program::read(tree, &root)?;
        for source in &program.sources {
            let mut walk = Walk {
                program: &program,
                from: &source.path,
                module: source.module,
                scopes: Vec::new(),
                arrows: &mut arrows,
            };
            walk.visit_file(&source.syntax);
        }
    }
    Ok(arrows)
}

/// The roots of a crate's library and programs.
fn roots(tree: &Tree, name: &str) -> Vec<String> {
    let sources = format!("crates/{name}/src/");
    let is_root = |path: &str| match path.strip_prefix(&sources) {
        Some("lib.rs" | "main.rs") => true,
        Some(path) => match path.strip_prefix("bin/") {
            Some(path) => path.ends_with("/main.rs") || !path.contains('/'),
            None => false,
        },
        None => false,
    };
    tree.rust().filter(|file| is_root(&file.path)).map(|file| file.path.clone()).collect()
}

/// Names valid only in a block or a function.
#[derive(Default)]
struct Scope {
    imports: Vec<Import>,
    /// Variables, parameters and items of the block.
    own: BTreeSet<String>,
}

struct Walk<'a> {
    program: &'a Program,
    from: &'a str,
    module: ModuleId,
    scopes: Vec<Scope>,
    arrows: &'a mut Arrows,
}

impl Walk<'_> {
    fn path(&mut self, path: &[String], line: usize) {
        for target in self.targets(path) {
            self.target(&target, path, line);
        }
    }

    fn target(&mut self, target: &Target, path: &[String], line: usize) {
        let Target::Item(definition) = target else { return };
        let to = &self.program.sources[definition.file].path;
        if to != self.from {
            let key = (self.from.to_owned(), to.clone());
            self.arrows.entry(key).or_insert_with(|| Arrow { path: path.join("::"), line });
        }
    }

    /// The meaning of a path: imports of the enclosing blocks take precedence over names of the module.
    fn targets(&self, path: &[String]) -> Vec<Target> {
        let Some((first, rest)) = path.split_first() else { return Vec::new() };
        for scope in self.scopes.iter().rev() {
            for import in &scope.imports {
                match import {
                    Import::Named(whole, name) if name == first => {
                        let start = self.program.resolve(self.module, whole);
                        return self.program.resolve_behind(start, rest);
                    }
                    Import::Named(..) => {}
                    Import::Glob(whole) => {
                        let mut through = whole.clone();
                        through.push(first.clone());
                        let found = self.program.resolve(self.module, &through);
                        if !found.is_empty() {
                            return self.program.resolve_behind(found, rest);
                        }
                    }
                }
            }
        }
        self.program.resolve(self.module, path)
    }

    /// Whether a single name is a variable or an item of an enclosing block.
    fn is_own(&self, name: &str) -> bool {
        self.scopes.iter().any(|scope| scope.own.contains(name))
    }

    fn imported(&mut self, import: &Import, line: usize) {
        match import {
            Import::Named(path, _) => self.path(path, line),
            Import::Glob(path) => {
                for target in self.program.resolve(self.module, path) {
                    match target {
                        Target::Module(module) => {
                            for definition in self.program.traits_in(module) {
                                self.target(&Target::Item(definition), path, line);
                            }
                        }
                        Target::Item(_) => self.target(&target, path, line),
                    }
                }
            }
        }
    }

    fn in_scope(&mut self, scope: Scope, visit: impl FnOnce(&mut Self)) {
        self.scopes.push(scope);
        visit(self);
        self.scopes.pop();
    }

    /// Paths in the unparsed tokens of a macro.
    fn tokens(&mut self, tokens: TokenStream) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(_) if !continues(&tokens, at) => {
                    let line = tokens[at].span().start().line;
                    let (path, next) = path_at(&tokens, at);
                    self.path_in_tokens(&path, tokens.get(next), line);
                    at = next;
                    continue;
                }
                TokenTree::Ident(_) | TokenTree::Punct(_) | TokenTree::Literal(_) => {}
            }
            at += 1;
        }
    }

    fn path_in_tokens(&mut self, path: &[String], next: Option<&TokenTree>, line: usize) {
        let [name] = path else { return self.path(path, line) };
        match next {
            Some(TokenTree::Punct(punct)) if punct.as_char() == '!' => self.macro_named(name, path, line),
            Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Parenthesis => self.path(path, line),
            _ if !self.is_own(name) => self.path(path, line),
            _ => {}
        }
    }

    fn macro_named(&mut self, name: &str, path: &[String], line: usize) {
        let found = self.targets(path);
        if !found.is_empty() {
            found.iter().for_each(|target| self.target(target, path, line));
        } else if let Some(definition) = self.program.macro_named(name) {
            self.target(&Target::Item(definition.clone()), path, line);
        }
    }
}

/// Whether the word at `at` continues an expression: `a.b`, `a::b`, `::b`, `$b`.
fn continues(tokens: &[TokenTree], at: usize) -> bool {
    let before = |back: usize, wanted: char| {
        at >= back && matches!(&tokens[at - back], TokenTree::Punct(punct) if punct.as_char() == wanted)
    };
    let is_crate = matches!(&tokens[at], TokenTree::Ident(word) if word == "crate");
    let field = before(1, '.') && !before(2, '.');
    field || (before(1, ':') && before(2, ':')) || (before(1, '$') && !is_crate)
}

/// The path that begins at `at`, and the position of the tokens after it.
fn path_at(tokens: &[TokenTree], mut at: usize) -> (Vec<String>, usize) {
    let mut path = vec![tokens[at].to_string()];
    loop {
        let separator = match (tokens.get(at + 1), tokens.get(at + 2)) {
            (Some(TokenTree::Punct(first)), Some(TokenTree::Punct(second))) => {
                first.as_char() == ':' && first.spacing() == Spacing::Joint && second.as_char() == ':'
            }
            _ => false,
        };
        match tokens.get(at + 3) {
            Some(TokenTree::Ident(word)) if separator => path.push(word.to_string()),
            _ => return (path, at + 1),
        }
        at += 3;
    }
}

/// Names that patterns bind anywhere below a piece of code.
#[derive(Default)]
struct Bound(BTreeSet<String>);

impl<'ast> Visit<'ast> for Bound {
    fn visit_pat_ident(&mut self, pattern: &'ast syn::PatIdent) {
        self.0.insert(pattern.ident.to_string());
        visit::visit_pat_ident(self, pattern);
    }
}

fn function_scope(visit: impl FnOnce(&mut Bound)) -> Scope {
    let mut bound = Bound::default();
    visit(&mut bound);
    let is_variable = |name: &String| name.starts_with(|c: char| c.is_lowercase() || c == '_');
    Scope { imports: Vec::new(), own: bound.0.into_iter().filter(is_variable).collect() }
}

fn segments(path: &syn::Path) -> Vec<String> {
    path.segments.iter().map(|segment| segment.ident.to_string()).collect()
}

impl<'ast> Visit<'ast> for Walk<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes_of(item).iter().any(is_for_tests) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        let attributes: &[Attribute] = match item {
            ImplItem::Const(item) => &item.attrs,
            ImplItem::Fn(item) => &item.attrs,
            ImplItem::Type(item) => &item.attrs,
            ImplItem::Macro(item) => &item.attrs,
            _ => &[],
        };
        if !attributes.iter().any(is_for_tests) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'ast ItemMod) {
        let Some((_, items)) = &item.content else { return };
        let Some(child) = self.program.child(self.module, &item.ident.to_string()) else { return };
        let outside = std::mem::replace(&mut self.module, child);
        items.iter().for_each(|item| self.visit_item(item));
        self.module = outside;
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        if matches!(item.vis, Visibility::Inherited) && item.leading_colon.is_none() {
            let line = item.span().start().line;
            imports(&item.tree).iter().for_each(|import| self.imported(import, line));
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        let scope = function_scope(|bound| bound.visit_item_fn(item));
        self.in_scope(scope, |walk| visit::visit_item_fn(walk, item));
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        let scope = function_scope(|bound| bound.visit_impl_item_fn(item));
        self.in_scope(scope, |walk| visit::visit_impl_item_fn(walk, item));
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        let scope = function_scope(|bound| bound.visit_trait_item_fn(item));
        self.in_scope(scope, |walk| visit::visit_trait_item_fn(walk, item));
    }

    fn visit_trait_item(&mut self, item: &'ast TraitItem) {
        visit::visit_trait_item(self, item);
    }

    fn visit_block(&mut self, block: &'ast Block) {
        let mut scope = Scope::default();
        for statement in &block.stmts {
            match statement {
                Stmt::Item(Item::Use(item)) => scope.imports.extend(imports(&item.tree)),
                Stmt::Item(Item::Fn(item)) => {
                    scope.own.insert(item.sig.ident.to_string());
                }
                Stmt::Item(Item::Const(item)) => {
                    scope.own.insert(item.ident.to_string());
                }
                Stmt::Item(Item::Struct(item)) => {
                    scope.own.insert(item.ident.to_string());
                }
                Stmt::Item(Item::Enum(item)) => {
                    scope.own.insert(item.ident.to_string());
                }
                _ => {}
            }
        }
        self.in_scope(scope, |walk| visit::visit_block(walk, block));
    }

    fn visit_expr_call(&mut self, call: &'ast ExprCall) {
        if let Expr::Path(function) = &*call.func
            && function.qself.is_none()
            && function.path.segments.len() == 1
        {
            let path = segments(&function.path);
            let of_block = self.scopes.iter().skip(1).any(|scope| scope.own.contains(&path[0]));
            if !of_block {
                self.path(&path, function.span().start().line);
            }
        }
        visit::visit_expr_call(self, call);
    }

    fn visit_pat(&mut self, pattern: &'ast Pat) {
        // A single name that begins with a capital letter is a constant or a unit struct.
        if let Pat::Ident(name) = pattern
            && name.subpat.is_none()
            && name.ident.to_string().starts_with(char::is_uppercase)
        {
            self.path(&[name.ident.to_string()], name.span().start().line);
        }
        visit::visit_pat(self, pattern);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names = segments(path);
        let own = names.len() == 1 && self.is_own(&names[0]);
        if path.leading_colon.is_none() && !own {
            self.path(&names, path.span().start().line);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        let path = segments(&call.path);
        let line = call.path.span().start().line;
        match path.as_slice() {
            [name] => self.macro_named(name, &path, line),
            path => self.path(path, line),
        }
        self.tokens(call.tokens.clone());
    }

    fn visit_visibility(&mut self, _: &'ast Visibility) {}

    fn visit_attribute(&mut self, _: &'ast Attribute) {}
}

#[cfg(test)]
mod tests;
