//! An error that contains another error returns it from `source()`.
//!
//! Input: the tree. Output: a finding for each variant and each struct of an error type with a field that is an error,
//! if the body of its `source` does not name the variant or the field. Error types are those with an `impl Error` in
//! any crate that is published, and `std::io::Error`. Test-only code is left out.

use std::collections::{BTreeMap, BTreeSet};

use syn::visit::Visit;
use syn::{Fields, GenericArgument, Item, PathArguments, Type};

use crate::Finding;
use crate::tree::Tree;

/// Crates without a library for applications.
const OTHERS: [&str; 2] = ["crates/tidy/", "crates/scenarios/"];

/// What the sources of all crates declare.
#[derive(Default)]
struct Found {
    /// Types that implement `Error`, by crate and name, with the names in the body of `source`.
    errors: BTreeMap<(String, String), BTreeSet<String>>,
    /// Places that contain a type: file, line, crate, type, place, names of the types in it.
    places: Vec<Place>,
}

/// A variant or a field of a type.
struct Place {
    file: String,
    line: usize,
    krate: String,
    owner: String,
    /// Variant, or field of a struct.
    name: String,
    /// Its types, without boxes and options around them.
    types: Vec<String>,
}

/// Places with an error that `source()` does not return.
pub fn missing(tree: &Tree) -> Result<Vec<Finding>, Finding> {
    let mut found = Found::default();
    for file in tree.rust() {
        let mut parts = file.path.split('/');
        let is_source = parts.next() == Some("crates") && file.path.contains("/src/");
        if !is_source || OTHERS.iter().any(|other| file.path.starts_with(other)) {
            continue;
        }
        let krate = parts.next().unwrap_or_default().to_owned();
        let syntax = syn::parse_file(&file.text)
            .map_err(|error| Finding::new(&file.path, error.span().start().line, format!("does not parse: {error}")))?;
        for item in &syntax.items {
            found.take(item, &krate, &file.path);
        }
    }
    Ok(found.findings())
}

impl Found {
    fn take(&mut self, item: &Item, krate: &str, file: &str) {
        match item {
            Item::Impl(of) => self.take_impl(of, krate),
            Item::Enum(of) => {
                for variant in &of.variants {
                    self.take_place(&of.ident, &variant.ident, types_of(&variant.fields), krate, file);
                }
            }
            Item::Struct(of) => {
                for field in of.fields.iter().filter(|field| field.ident.is_some()) {
                    let name = field.ident.as_ref().unwrap_or(&of.ident);
                    self.take_place(&of.ident, name, innermost(&field.ty).into_iter().collect(), krate, file);
                }
            }
            _ => {}
        }
    }

    fn take_place(&mut self, owner: &syn::Ident, name: &syn::Ident, types: Vec<String>, krate: &str, file: &str) {
        let (owner, line) = (owner.to_string(), name.span().start().line);
        let (file, krate, name) = (file.to_owned(), krate.to_owned(), name.to_string());
        self.places.push(Place { file, line, krate, owner, name, types });
    }

    fn take_impl(&mut self, of: &syn::ItemImpl, krate: &str) {
        let Some((path, _)) = &of.trait_ else { return };
        let is_error = path.segments.last().is_some_and(|last| last.ident == "Error" || last.ident == "StdError");
        if let (true, Some(name)) = (is_error, innermost(&of.self_ty)) {
            let mut names = BTreeSet::new();
            for item in &of.items {
                if let syn::ImplItem::Fn(function) = item {
                    Names(&mut names).visit_block(&function.block);
                }
            }
            self.errors.insert((krate.to_owned(), name), names);
        }
    }

    fn findings(&self) -> Vec<Finding> {
        let is_error = |name: &str| name == "io::Error" || self.errors.keys().any(|(_, error)| error == name);
        let wrong = self.places.iter().filter(|place| {
            let names = self.errors.get(&(place.krate.clone(), place.owner.clone()));
            names.is_some_and(|names| !names.contains(&place.name)) && place.types.iter().any(|name| is_error(name))
        });
        let text = |place: &Place| format!("source() of {} does not return the error in {}", place.owner, place.name);
        wrong.map(|place| Finding::new(&place.file, place.line, text(place))).collect()
    }
}

fn types_of(fields: &Fields) -> Vec<String> {
    fields.iter().filter_map(|field| innermost(&field.ty)).collect()
}

/// The name of a type without `Box` and `Option` around it; `io::Error` with its module.
fn innermost(of: &Type) -> Option<String> {
    let Type::Path(path) = of else { return None };
    let last = path.path.segments.last()?;
    if last.ident == "Box" || last.ident == "Option" {
        let PathArguments::AngleBracketed(inner) = &last.arguments else { return None };
        let GenericArgument::Type(inner) = inner.args.first()? else { return None };
        return innermost(inner);
    }
    let before = path.path.segments.iter().rev().nth(1);
    let is_of_io = last.ident == "Error" && before.is_some_and(|module| module.ident == "io");
    Some(if is_of_io { "io::Error".to_owned() } else { last.ident.to_string() })
}

/// All names in a body.
struct Names<'a>(&'a mut BTreeSet<String>);

impl<'ast> Visit<'ast> for Names<'_> {
    fn visit_ident(&mut self, ident: &'ast syn::Ident) {
        self.0.insert(ident.to_string());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    #[test]
    fn an_error_in_an_error_is_found_where_source_does_not_name_it() {
        let text = "//! It.\n\npub enum OneError {\n    Plain,\n    Two(TwoError),\n    \
                    Io { cause: std::io::Error },\n    \
                    Boxed(Box<TwoError>),\n}\n\npub struct TwoError {\n    cause: Option<ThreeError>,\n}\n\n\
                    pub struct ThreeError;\n\npub enum Event {\n    Two(TwoError),\n}\n\n\
                    impl std::error::Error for OneError {\n    \
                    fn source(&self) -> Option<&(dyn Error + 'static)> {\n        match self {\n            \
                    OneError::Two(error) => Some(error),\n            _ => None,\n        }\n    }\n}\n\n\
                    impl Error for TwoError {}\n\nimpl Error for ThreeError {}\n";
        let tree = Tree { files: vec![File::new("crates/link/src/a.rs", text)] };
        let found: Vec<String> = missing(&tree).expect("it parses").iter().map(ToString::to_string).collect();
        let expected = [
            "crates/link/src/a.rs:6: source() of OneError does not return the error in Io",
            "crates/link/src/a.rs:7: source() of OneError does not return the error in Boxed",
            "crates/link/src/a.rs:11: source() of TwoError does not return the error in cause",
        ];
        assert_eq!(found, expected);
    }
}
