//! The modules of one program or library, their names, and the targets of paths.
//!
//! Input: a tree and the path of a root (`src/lib.rs`, `src/main.rs`). Output: a [`Program`]: the parsed files that
//! `mod` lines reach, and [`Program::resolve`] from a path to its items, through imports, re-exports, renamed names and
//! globs. Test-only code is left out.
//!
//! A name without a declaration, in a module that the path names, counts as an item of that module: a macro created it.
//! Names of other crates have no target. Targets of method calls and fields are not searched.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{TokenStream, TokenTree};
use syn::{Attribute, Item, ItemMod, UseTree};

use crate::Finding;
use crate::tree::Tree;

/// Index of a module in `Program::modules`.
pub type ModuleId = usize;
/// Index of a file in [`Program::sources`].
pub type FileId = usize;

/// A parsed file and its module.
pub struct Source {
    /// Relative to the root of the repository.
    pub path: String,
    /// Its module.
    pub module: ModuleId,
    /// Its content.
    pub syntax: syn::File,
}

/// A module, a file or `mod name { ... }` in one.
struct Module {
    file: FileId,
    parent: Option<ModuleId>,
    names: BTreeMap<String, Vec<Name>>,
    globs: Vec<Vec<String>>,
    /// Words in macro invocations among the items: a macro may have created an item of that name.
    made_by_macros: BTreeSet<String>,
}

/// Meaning of a name in its module.
enum Name {
    Module(ModuleId),
    Item(Definition),
    /// Index in [`Program::aliases`].
    Alias(usize),
}

/// An item, its file, and the names that can follow it in a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Definition {
    /// Its file.
    pub file: FileId,
    /// Its kind.
    pub kind: Kind,
}

/// Kinds of items.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Function, constant, static, macro: a path ends there.
    Value,
    /// A type; of an enum, the names of its variants.
    Type(Vec<String>),
    /// A trait: its methods need an import without naming it.
    Trait,
}

/// Target of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// A module.
    Module(ModuleId),
    /// An item, or a part of it (variant, associated function).
    Item(Definition),
}

/// A `use` leaf.
#[derive(Clone, Debug)]
pub enum Import {
    /// A path and its local name.
    Named(Vec<String>, String),
    /// All names of the path's target.
    Glob(Vec<String>),
}

/// The modules reached from one root.
pub struct Program {
    /// Parsed files; the root is the first.
    pub sources: Vec<Source>,
    modules: Vec<Module>,
    aliases: Vec<(ModuleId, Vec<String>)>,
    /// `macro_rules!` by name, which need no path.
    macros: BTreeMap<String, Definition>,
}

impl Program {
    /// Reads the modules, starting with the file at `root`.
    pub fn read(tree: &Tree, root: &str) -> Result<Program, Finding> {
        let mut program =
            Program { sources: Vec::new(), modules: Vec::new(), aliases: Vec::new(), macros: BTreeMap::new() };
        let directory = root.rsplit_once('/').map_or("", |(directory, _)| directory);
        program.add_file(tree, root, directory, None)?;
        Ok(program)
    }

    fn add_file(
        &mut self,
        tree: &Tree,
        path: &str,
        directory: &str,
        parent: Option<ModuleId>,
    ) -> Result<ModuleId, Finding> {
        let text = tree.file(path).ok_or_else(|| Finding::new(path, 0, "is not there"))?.text.as_str();
        let syntax = syn::parse_file(text)
            .map_err(|error| Finding::new(path, error.span().start().line, format!("does not parse: {error}")))?;
        let (file, module) = (self.sources.len(), self.modules.len());
        self.modules.push(Module::new(file, parent));
        let items = syntax.items.clone();
        self.sources.push(Source { path: path.to_owned(), module, syntax });
        self.add_items(tree, module, directory, &items)?;
        Ok(module)
    }

    fn add_items(&mut self, tree: &Tree, module: ModuleId, directory: &str, items: &[Item]) -> Result<(), Finding> {
        for item in items.iter().filter(|item| !attributes_of(item).iter().any(is_for_tests)) {
            match item {
                Item::Mod(item) => self.add_module(tree, module, directory, item)?,
                Item::Use(item) => {
                    for import in imports(&item.tree) {
                        self.add_import(module, import);
                    }
                }
                Item::Macro(item) => self.add_macro(module, item),
                other => self.add_definition(module, other),
            }
        }
        Ok(())
    }

    fn add_module(&mut self, tree: &Tree, parent: ModuleId, directory: &str, item: &ItemMod) -> Result<(), Finding> {
        let name = item.ident.to_string();
        let below = format!("{directory}/{name}");
        let module = if let Some((_, items)) = &item.content {
            let module = self.modules.len();
            self.modules.push(Module::new(self.modules[parent].file, Some(parent)));
            self.add_items(tree, module, &below, items)?;
            module
        } else {
            let inside = format!("{below}/mod.rs");
            let beside = format!("{below}.rs");
            let path = if tree.file(&inside).is_some() { inside } else { beside };
            self.add_file(tree, &path, &below, Some(parent))?
        };
        self.modules[parent].add(name, Name::Module(module));
        Ok(())
    }

    fn add_import(&mut self, module: ModuleId, import: Import) {
        match import {
            Import::Named(path, name) => {
                self.aliases.push((module, path));
                let alias = Name::Alias(self.aliases.len() - 1);
                self.modules[module].add(name, alias);
            }
            Import::Glob(path) => self.modules[module].globs.push(path),
        }
    }

    fn add_macro(&mut self, module: ModuleId, item: &syn::ItemMacro) {
        let file = self.modules[module].file;
        match &item.ident {
            Some(name) => {
                let definition = Definition { file, kind: Kind::Value };
                self.modules[module].add(name.to_string(), Name::Item(definition.clone()));
                self.macros.insert(name.to_string(), definition);
            }
            None => words(item.mac.tokens.clone(), &mut self.modules[module].made_by_macros),
        }
    }

    fn add_definition(&mut self, module: ModuleId, item: &Item) {
        let (name, kind) = match item {
            Item::Const(item) => (&item.ident, Kind::Value),
            Item::Static(item) => (&item.ident, Kind::Value),
            Item::Fn(item) => (&item.sig.ident, Kind::Value),
            Item::Enum(item) => {
                (&item.ident, Kind::Type(item.variants.iter().map(|variant| variant.ident.to_string()).collect()))
            }
            Item::Struct(item) => (&item.ident, Kind::Type(Vec::new())),
            Item::Union(item) => (&item.ident, Kind::Type(Vec::new())),
            Item::Type(item) => (&item.ident, Kind::Type(Vec::new())),
            Item::Trait(item) => (&item.ident, Kind::Trait),
            _ => return,
        };
        let file = self.modules[module].file;
        self.modules[module].add(name.to_string(), Name::Item(Definition { file, kind }));
    }

    /// The module `name` in `module`.
    pub fn child(&self, module: ModuleId, name: &str) -> Option<ModuleId> {
        self.modules[module].names.get(name)?.iter().find_map(|name| match name {
            Name::Module(child) => Some(*child),
            Name::Item(_) | Name::Alias(_) => None,
        })
    }

    /// The macro of this name in any file.
    pub fn macro_named(&self, name: &str) -> Option<&Definition> {
        self.macros.get(name)
    }

    /// The targets of a path in a module; several if a name is a type and a value, none in other crates.
    pub fn resolve(&self, module: ModuleId, path: &[String]) -> Vec<Target> {
        self.follow(module, path, &mut Vec::new())
    }

    /// The targets of a path after `start`.
    pub fn resolve_behind(&self, start: Vec<Target>, path: &[String]) -> Vec<Target> {
        self.follow_behind(start, path, &mut Vec::new())
    }

    /// The traits among the names of a module.
    pub fn traits_in(&self, module: ModuleId) -> Vec<Definition> {
        let names = self.modules[module].names.keys();
        let targets = names.flat_map(|name| self.lookup(module, name, &mut Vec::new()));
        let items = targets.filter_map(|target| match target {
            Target::Item(definition) => Some(definition),
            Target::Module(_) => None,
        });
        items.filter(|definition| definition.kind == Kind::Trait).collect()
    }

    fn follow(&self, module: ModuleId, path: &[String], seen: &mut Vec<Seen>) -> Vec<Target> {
        let Some((first, rest)) = path.split_first() else { return Vec::new() };
        let start = match first.as_str() {
            "crate" => vec![Target::Module(0)],
            "self" => vec![Target::Module(module)],
            "super" => self.modules[module].parent.map(Target::Module).into_iter().collect(),
            name => self.lookup(module, name, seen),
        };
        self.follow_behind(start, rest, seen)
    }

    fn follow_behind(&self, start: Vec<Target>, path: &[String], seen: &mut Vec<Seen>) -> Vec<Target> {
        let mut targets = start;
        for name in path {
            let mut next = Vec::new();
            for target in targets {
                match target {
                    Target::Module(module) if name == "super" => {
                        next.extend(self.modules[module].parent.map(Target::Module));
                    }
                    Target::Module(module) if name == "self" => next.push(Target::Module(module)),
                    Target::Module(module) => next.extend(self.named_in(module, name, seen)),
                    Target::Item(Definition { kind: Kind::Value, .. }) => {}
                    Target::Item(definition) => next.push(Target::Item(definition)),
                }
            }
            targets = next;
        }
        targets
    }

    /// The targets of a name in a module; a name without a declaration was created by a macro.
    fn named_in(&self, module: ModuleId, name: &str, seen: &mut Vec<Seen>) -> Vec<Target> {
        let found = self.lookup(module, name, seen);
        if found.is_empty() && !self.modules[module].names.contains_key(name) && self.modules[module].globs.is_empty() {
            let file = self.modules[module].file;
            return vec![Target::Item(Definition { file, kind: Kind::Type(Vec::new()) })];
        }
        found
    }

    fn lookup(&self, module: ModuleId, name: &str, seen: &mut Vec<Seen>) -> Vec<Target> {
        let here = &self.modules[module];
        let mut found = Vec::new();
        for meaning in here.names.get(name).into_iter().flatten() {
            match meaning {
                Name::Module(child) => found.push(Target::Module(*child)),
                Name::Item(definition) => found.push(Target::Item(definition.clone())),
                Name::Alias(alias) => {
                    let (module, path) = &self.aliases[*alias];
                    found.extend(unless_seen(seen, Seen::Alias(*alias), |seen| self.follow(*module, path, seen)));
                }
            }
        }
        if here.names.contains_key(name) {
            return found;
        }
        for (at, path) in here.globs.iter().enumerate() {
            let glob = Seen::Glob(module, at, name.to_owned());
            found.extend(unless_seen(seen, glob, |seen| self.through_glob(module, path, name, seen)));
        }
        if found.is_empty() && here.made_by_macros.contains(name) {
            found.push(Target::Item(Definition { file: here.file, kind: Kind::Type(Vec::new()) }));
        }
        found
    }

    fn through_glob(&self, module: ModuleId, path: &[String], name: &str, seen: &mut Vec<Seen>) -> Vec<Target> {
        let mut found = Vec::new();
        for target in self.follow(module, path, seen) {
            match target {
                Target::Module(from) => found.extend(self.lookup(from, name, seen)),
                Target::Item(Definition { kind: Kind::Type(ref variants), .. })
                    if variants.iter().any(|variant| variant == name) =>
                {
                    found.push(target);
                }
                Target::Item(_) => {}
            }
        }
        found
    }
}

impl Module {
    fn new(file: FileId, parent: Option<ModuleId>) -> Module {
        Module { file, parent, names: BTreeMap::new(), globs: Vec::new(), made_by_macros: BTreeSet::new() }
    }

    fn add(&mut self, name: String, meaning: Name) {
        self.names.entry(name).or_default().push(meaning);
    }
}

/// Steps currently being followed: imports may form circles.
#[derive(PartialEq, Eq)]
enum Seen {
    Alias(usize),
    Glob(ModuleId, usize, String),
}

fn unless_seen(seen: &mut Vec<Seen>, step: Seen, follow: impl FnOnce(&mut Vec<Seen>) -> Vec<Target>) -> Vec<Target> {
    if seen.contains(&step) {
        return Vec::new();
    }
    seen.push(step);
    let found = follow(seen);
    seen.pop();
    found
}

/// The leaves of a `use`.
pub fn imports(tree: &UseTree) -> Vec<Import> {
    let mut found = Vec::new();
    collect_imports(tree, &mut Vec::new(), &mut found);
    found
}

fn collect_imports(tree: &UseTree, path: &mut Vec<String>, found: &mut Vec<Import>) {
    let mut leaf = |name: String, alias: String| {
        let mut whole = path.clone();
        let alias = if name != "self" {
            whole.push(name);
            alias
        } else if alias == "self" {
            path.last().cloned().unwrap_or_default()
        } else {
            alias
        };
        found.push(Import::Named(whole, alias));
    };
    match tree {
        UseTree::Name(tree) => leaf(tree.ident.to_string(), tree.ident.to_string()),
        UseTree::Rename(tree) => leaf(tree.ident.to_string(), tree.rename.to_string()),
        UseTree::Glob(_) => found.push(Import::Glob(path.clone())),
        UseTree::Path(tree) => {
            path.push(tree.ident.to_string());
            collect_imports(&tree.tree, path, found);
            path.pop();
        }
        UseTree::Group(tree) => tree.items.iter().for_each(|tree| collect_imports(tree, path, found)),
    }
}

fn words(tokens: TokenStream, found: &mut BTreeSet<String>) {
    for token in tokens {
        match token {
            TokenTree::Ident(word) => {
                found.insert(word.to_string());
            }
            TokenTree::Group(group) => words(group.stream(), found),
            TokenTree::Punct(_) | TokenTree::Literal(_) => {}
        }
    }
}

/// Whether an attribute restricts code to test builds.
pub fn is_for_tests(attribute: &Attribute) -> bool {
    if attribute.path().is_ident("test") {
        return true;
    }
    let syn::Meta::List(list) = &attribute.meta else { return false };
    let words: Vec<String> = list.tokens.clone().into_iter().map(|token| token.to_string()).collect();
    let plain = words.first().is_some_and(|word| word == "test");
    let all = words.first().is_some_and(|word| word == "all")
        && list.tokens.clone().into_iter().any(|token| match token {
            TokenTree::Group(group) => group.stream().into_iter().any(|token| token.to_string() == "test"),
            _ => false,
        });
    list.path.is_ident("cfg") && (plain || all)
}

/// The attributes of an item.
pub fn attributes_of(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::ForeignMod(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}
