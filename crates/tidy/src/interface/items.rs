//! Public items of the files of one crate.
//!
//! Input: files. Output: their items in the order of the source. The text of an item is that of the source in one line,
//! without its body.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::Span;
use syn::spanned::Spanned;
use syn::{Attribute, Fields, ImplItem, Item as Syntax, TraitItem, UseTree, Visibility};

use super::macros::{self, Made};
use super::one_line::one_line;
use crate::Finding;
use crate::tree::File;

/// A public item.
pub(crate) struct Item {
    /// Module path of its file below `src`.
    pub module: String,
    /// The types that it is about: its own name, that of its owner, those that a macro makes.
    pub owners: BTreeSet<String>,
    /// Signature, with that of its owner before it.
    pub text: String,
}

/// The items of all files of a crate.
pub(super) fn of_files(files: &[&File], sources: &str) -> Result<Vec<Item>, Finding> {
    let mut parsed = Vec::new();
    for file in files {
        let syntax = syn::parse_file(&file.text)
            .map_err(|error| Finding::new(&file.path, error.span().start().line, format!("does not parse: {error}")))?;
        parsed.push((file.path.trim_start_matches(sources).trim_end_matches(".rs").replace('/', "::"), syntax));
    }
    let mut names = Names::default();
    for (_, syntax) in &parsed {
        names.add(&syntax.items, true);
    }
    let macros = Macros::of(parsed.iter().flat_map(|(_, syntax)| &syntax.items), &names);
    let mut found = Vec::new();
    for (module, syntax) in &parsed {
        Walk { names: &names, macros: &macros, module, found: &mut found }.items(&syntax.items);
    }
    Ok(found)
}

/// Names of types and traits that a crate declares.
#[derive(Default)]
struct Names {
    public: BTreeSet<String>,
    private: BTreeSet<String>,
}

impl Names {
    fn add(&mut self, items: &[Syntax], is_reachable: bool) {
        for item in items {
            let (name, visibility) = match item {
                Syntax::Struct(it) => (&it.ident, &it.vis),
                Syntax::Enum(it) => (&it.ident, &it.vis),
                Syntax::Trait(it) => (&it.ident, &it.vis),
                Syntax::Type(it) => (&it.ident, &it.vis),
                Syntax::Mod(it) => {
                    let inner = it.content.as_ref().map_or(&[][..], |(_, items)| items);
                    self.add(inner, is_reachable && is_public(&it.vis));
                    continue;
                }
                _ => continue,
            };
            let is_public = is_reachable && is_public(visibility);
            let names = if is_public { &mut self.public } else { &mut self.private };
            names.insert(name.to_string());
        }
    }

    /// Whether no public type or trait has this name, and a private one has.
    fn is_private(&self, name: &str) -> bool {
        self.private.contains(name) && !self.public.contains(name)
    }
}

/// Macros of a crate that make public items, by their names.
struct Macros(BTreeMap<String, Macro>);

#[derive(Default)]
struct Macro {
    /// What its body makes.
    made: Vec<Made>,
    /// Names in its calls.
    called_with: BTreeSet<String>,
}

impl Macros {
    fn of<'a>(items: impl Iterator<Item = &'a Syntax> + Clone, names: &Names) -> Macros {
        let mut all: BTreeMap<String, Macro> = BTreeMap::new();
        for item in items {
            let Syntax::Macro(it) = item else { continue };
            let (name, is_definition) = name_of_macro(it);
            let entry = all.entry(name).or_default();
            if is_definition {
                entry.made = macros::made(&it.mac.tokens, &|name| names.is_private(name));
            } else if let Ok(file) = syn::parse2::<syn::File>(it.mac.tokens.clone()) {
                let mut declared = Names::default();
                declared.add(&file.items, true);
                entry.called_with.extend(declared.public);
            } else {
                let parts = macros::parts(it.mac.tokens.clone());
                entry.called_with.extend(parts.iter().flat_map(|part| macros::words(part)));
            }
        }
        all.retain(|_, entry| !entry.made.is_empty());
        Macros(all)
    }
}

/// The name of a macro, and whether the item defines it.
fn name_of_macro(it: &syn::ItemMacro) -> (String, bool) {
    let called = it.mac.path.segments.last().map(|last| last.ident.to_string());
    match it.ident.as_ref().filter(|_| it.mac.path.is_ident("macro_rules")) {
        Some(name) => (name.to_string(), true),
        None => (called.unwrap_or_default(), false),
    }
}

/// The way through the items of one file.
struct Walk<'a> {
    names: &'a Names,
    macros: &'a Macros,
    module: &'a str,
    found: &'a mut Vec<Item>,
}

impl Walk<'_> {
    fn push(&mut self, owner: &str, text: String) {
        self.push_for([owner.to_owned()].into(), text);
    }

    fn push_for(&mut self, owners: BTreeSet<String>, text: String) {
        self.found.push(Item { module: self.module.to_owned(), owners, text });
    }

    fn items(&mut self, items: &[Syntax]) {
        for item in items {
            self.item(item);
        }
    }

    fn item(&mut self, item: &Syntax) {
        match item {
            Syntax::Struct(it) if is_public(&it.vis) && !is_test(&it.attrs) => self.structure(it),
            Syntax::Enum(it) if is_public(&it.vis) && !is_test(&it.attrs) => self.choice(it),
            Syntax::Trait(it) if is_public(&it.vis) && !is_test(&it.attrs) => self.of_trait(it),
            Syntax::Impl(it) if !is_test(&it.attrs) => self.of_impl(it),
            Syntax::Fn(it) if is_public(&it.vis) && !is_test(&it.attrs) => {
                self.push(&it.sig.ident.to_string(), between(it.vis.span(), it.sig.span()));
            }
            Syntax::Const(it) if is_public(&it.vis) && !is_test(&it.attrs) => {
                self.push(&it.ident.to_string(), between(it.vis.span(), it.expr.span()));
            }
            Syntax::Static(it) if is_public(&it.vis) => {
                self.push(&it.ident.to_string(), between(it.vis.span(), it.ty.span()));
            }
            Syntax::Type(it) if is_public(&it.vis) => {
                self.push(&it.ident.to_string(), between(it.vis.span(), it.ty.span()));
            }
            Syntax::Use(it) if is_public(&it.vis) => self.used(&it.tree, "pub use "),
            Syntax::Mod(it) if is_public(&it.vis) && !is_test(&it.attrs) => {
                self.push("", between(it.vis.span(), it.ident.span()));
                let inner = it.content.as_ref().map_or(&[][..], |(_, items)| items);
                let module = format!("{}::{}", self.module, it.ident);
                Walk { names: self.names, macros: self.macros, module: &module, found: self.found }.items(inner);
            }
            Syntax::Macro(it) => self.of_macro(it),
            _ => {}
        }
    }

    /// A line for each name, so that a change of one is a change of one line.
    fn used(&mut self, tree: &UseTree, before: &str) {
        match tree {
            UseTree::Path(path) => self.used(&path.tree, &format!("{before}{}::", path.ident)),
            UseTree::Group(group) => group.items.iter().for_each(|inner| self.used(inner, before)),
            UseTree::Name(name) => self.push("", format!("{before}{}", name.ident)),
            UseTree::Rename(name) => self.push("", format!("{before}{} as {}", name.ident, name.rename)),
            UseTree::Glob(_) => self.push("", format!("{before}*")),
        }
    }

    fn structure(&mut self, it: &syn::ItemStruct) {
        let name = it.ident.to_string();
        let body = match &it.fields {
            Fields::Named(fields) => Some(fields.brace_token.span.open()),
            Fields::Unnamed(_) | Fields::Unit => None,
        };
        let end = it.semi_token.map(|semicolon| semicolon.span());
        let head = before(it.vis.span(), body.or(end));
        self.push(&name, format!("{head}{}", notes(&it.attrs)));
        if let Fields::Named(fields) = &it.fields {
            for field in fields.named.iter().filter(|field| is_public(&field.vis)) {
                self.push(&name, format!("{head}: {}", between(field.vis.span(), field.ty.span())));
            }
        }
    }

    fn choice(&mut self, it: &syn::ItemEnum) {
        let name = it.ident.to_string();
        let head = before(it.vis.span(), Some(it.brace_token.span.open()));
        self.push(&name, format!("{head}{}", notes(&it.attrs)));
        for variant in &it.variants {
            let end = match (&variant.discriminant, &variant.fields) {
                (Some((_, value)), _) => value.span(),
                (None, Fields::Unit) => variant.ident.span(),
                (None, fields) => fields.span(),
            };
            self.push(&name, format!("{head}: {}", between(variant.ident.span(), end)));
        }
    }

    fn of_trait(&mut self, it: &syn::ItemTrait) {
        let name = it.ident.to_string();
        let head = before(it.vis.span(), Some(it.brace_token.span.open()));
        self.push(&name, head.clone());
        for item in &it.items {
            let text = match item {
                TraitItem::Fn(it) => one_line_of(it.sig.span()),
                TraitItem::Const(it) => between(it.const_token.span, it.ty.span()),
                TraitItem::Type(it) => before(it.type_token.span, Some(it.semi_token.span)),
                _ => continue,
            };
            self.push(&name, format!("{head}: {text}"));
        }
    }

    fn of_impl(&mut self, it: &syn::ItemImpl) {
        let Some(name) = name_of(&it.self_ty) else { return };
        let of_trait = it.trait_.as_ref().map(|(path, _)| path);
        let trait_name = of_trait.and_then(|path| path.segments.last()).map(|last| last.ident.to_string());
        let is_hidden = trait_name.is_some_and(|name| self.names.is_private(&name));
        if is_hidden || self.names.is_private(&name) {
            return;
        }
        let head = before(it.impl_token.span, Some(it.brace_token.span.open()));
        if of_trait.is_some() {
            return self.push(&name, head);
        }
        for item in &it.items {
            let text = match item {
                ImplItem::Fn(it) if is_public(&it.vis) && !is_test(&it.attrs) => between(it.vis.span(), it.sig.span()),
                ImplItem::Const(it) if is_public(&it.vis) => between(it.vis.span(), it.expr.span()),
                _ => continue,
            };
            self.push(&name, format!("{head}: {text}"));
        }
    }

    fn of_macro(&mut self, it: &syn::ItemMacro) {
        let (name, is_definition) = name_of_macro(it);
        let Some(Macro { made, called_with }) = self.macros.0.get(&name) else { return };
        if is_definition {
            for Made { owner, text } in made {
                let fixed = || [owner.clone()].into();
                let owners = if owner.starts_with('$') { called_with.clone() } else { fixed() };
                self.push_for(owners, format!("{name}!: {text}"));
            }
            return;
        }
        // Items between the brackets are those of the source, with what the macro adds.
        if let Ok(file) = syn::parse2::<syn::File>(it.mac.tokens.clone()) {
            return self.items(&file.items);
        }
        let fixed = made.iter().map(|made| made.owner.clone()).filter(|owner| !owner.starts_with('$'));
        let fixed: BTreeSet<String> = fixed.collect();
        let is_named = made.iter().any(|made| made.owner.starts_with('$'));
        for part in macros::parts(it.mac.tokens.clone()) {
            let named = macros::words(&part).into_iter().filter(|_| is_named);
            self.push_for(fixed.iter().cloned().chain(named).collect(), format!("{name}!: {part}"));
        }
    }
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

fn is_test(attributes: &[Attribute]) -> bool {
    attributes
        .iter()
        .any(|attribute| attribute.path().is_ident("cfg") && one_line_of(attribute.meta.span()).contains("test"))
}

/// Attributes that are part of the interface: derived traits, and that a type may grow.
fn notes(attributes: &[Attribute]) -> String {
    let is_noted = |text: &String| match text.as_str() {
        "non_exhaustive" => true,
        text => ["derive(", "repr(", "cfg_attr(feature"].iter().any(|start| text.starts_with(start)),
    };
    let texts = attributes.iter().map(|attribute| one_line_of(attribute.meta.span())).filter(is_noted);
    texts.map(|text| format!(" #[{text}]")).collect()
}

/// The name of the type that an impl is for.
fn name_of(of: &syn::Type) -> Option<String> {
    match of {
        syn::Type::Path(path) => Some(path.path.segments.last()?.ident.to_string()),
        syn::Type::Reference(to) => name_of(&to.elem),
        _ => Some(String::new()),
    }
}

fn one_line_of(span: Span) -> String {
    one_line(&span.source_text().unwrap_or_default())
}

/// The source from the beginning of one part to the end of another.
fn between(start: Span, end: Span) -> String {
    start.join(end).map(one_line_of).unwrap_or_default()
}

/// The source from the beginning of one part to that of another.
fn before(start: Span, end: Option<Span>) -> String {
    let Some(end) = end else { return one_line_of(start) };
    let whole = start.join(end).and_then(|span| span.source_text()).unwrap_or_default();
    let last = end.source_text().unwrap_or_default();
    one_line(whole.strip_suffix(&last).unwrap_or(&whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn items_of(text: &str) -> Vec<String> {
        let file = File::new("src/links/name.rs", text);
        let items = of_files(&[&file], "src/").expect("parses");
        items.into_iter().map(|item| format!("{}: {}", item.module, item.text)).collect()
    }

    #[test]
    fn public_items_are_listed_with_their_signatures_and_no_others() {
        let text = "//! Text.\n\npub use crate::one::{\n    A, B as C,\n};\n\n/// It.\n#[derive(Clone)]\n\
                    pub struct It<T> {\n    /// A field.\n    pub field: u8,\n    hidden: T,\n    pub used: u8,\n    \
                    pub after: u8,\n}\n\nimpl<T> It<T> {\n    /// Long.\n    \
                    pub fn long(\n        &self,\n        more: (u8, u8),\n    ) -> bool {\n        \
                    pub_like()\n    }\n\n    fn own(&self) {}\n    pub(crate) fn near(&self) {}\n    \
                    pub fn using(&self) {}\n    pub const N: u8 = 3;\n}\n\nimpl<T> Copy for It<T> {\n}\n\n\
                    pub(crate) fn inner() {}\n\nstruct Own;\n\nimpl Clone for Own {\n    \
                    fn clone(&self) -> Own {\n        Own\n    }\n}\n\ntrait Code {}\n\nimpl<T> Code for It<T> {}\n\n\
                    /// It.\n#[non_exhaustive]\npub enum Either {\n    One,\n    Other { it: u8 },\n    \
                    Long {\n        /// A field.\n        first: u8,\n        second: u8,\n    },\n    Last = 3,\n}\n\n\
                    pub const fn f() -> u8 {\n    1\n}\n\npub struct Pair(pub u8, u8);\n\npub mod near {\n    \
                    pub fn g() {}\n}\n\n#[cfg(test)]\nmod tests {\n    pub fn not_this() {}\n}\n";
        let expected = [
            "links::name: pub use crate::one::A",
            "links::name: pub use crate::one::B as C",
            "links::name: pub struct It<T> #[derive(Clone)]",
            "links::name: pub struct It<T>: pub field: u8",
            "links::name: pub struct It<T>: pub used: u8",
            "links::name: pub struct It<T>: pub after: u8",
            "links::name: impl<T> It<T>: pub fn long(&self, more: (u8, u8)) -> bool",
            "links::name: impl<T> It<T>: pub fn using(&self)",
            "links::name: impl<T> It<T>: pub const N: u8 = 3",
            "links::name: impl<T> Copy for It<T>",
            "links::name: pub enum Either #[non_exhaustive]",
            "links::name: pub enum Either: One",
            "links::name: pub enum Either: Other { it: u8 }",
            "links::name: pub enum Either: Long { first: u8, second: u8 }",
            "links::name: pub enum Either: Last = 3",
            "links::name: pub const fn f() -> u8",
            "links::name: pub struct Pair(pub u8, u8)",
            "links::name: pub mod near",
            "links::name::near: pub fn g()",
        ];
        assert_eq!(items_of(text), expected);
    }

    #[test]
    fn macros_are_listed_where_they_make_public_items() {
        let text = "trait Own {}\nmacro_rules! own { ($a:ident) => { impl Own for $a {} }; }\nown!(It);\n\
                    macro_rules! ids {\n    ($($name:ident)*) => {$(\n        pub struct $name(pub u8);\n    )*};\n}\n\
                    ids! {\n    A B\n}\nmacro_rules! plain {\n    ($($item:item)*) => {$(\n        \
                    impl Copy for $item {}\n    )*};\n}\nplain! {\n    pub struct It {\n        \
                    pub it: u8,\n    }\n}\n";
        let expected = [
            "links::name: ids!: pub struct $name(pub u8)",
            "links::name: ids!: A B",
            "links::name: plain!: impl Copy for $item",
            "links::name: pub struct It",
            "links::name: pub struct It: pub it: u8",
        ];
        assert_eq!(items_of(text), expected);
    }
}
