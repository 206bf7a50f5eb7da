//! What the engine's mailboxes can do, the library can do with the handle of a SubDevice, in each of its forms.
//!
//! Input: the tree. Output: a finding for each public function over a `Mailbox` in `crates/engine/src/mail`, and each
//! public method of `Mailbox`, that no method in `crates/ringcat/src/subdevice` calls. A method of
//! `SubDevice<S: Services>` exists in all forms, and its errors name the SubDevice. `EXEMPT` lists what an application
//! does not need, with the reason.

use std::collections::BTreeSet;

use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{FnArg, ImplItem, Item, Type, Visibility};

use crate::Finding;
use crate::limits::is_test;
use crate::tree::{File, Tree};

const ENGINE: &str = "crates/engine/src/mail/";
/// Messages of gateway clients come from the gateway.
const GATEWAY: &str = "crates/engine/src/mail/relay/";
const HANDLE: &str = "crates/ringcat/src/subdevice/";
/// The type that the functions take.
const TYPE: &str = "Mailbox";

/// Functions without a method of the handle, with the reason.
#[rustfmt::skip]
const EXEMPT: &[(&str, &str)] = &[
    ("Dictionaries::of", "`sdo_object` and `sdo_entry` pass the mailbox: `ask_dictionary`"),
    ("information::object", "`sdo_object`, of the type where it is known"),
    ("information::entry", "`sdo_entry`, of the type where it is known"),
    ("Mailbox::bus", "the handle has the limit of a service, other tasks are those of the engine"),
    ("Mailbox::conversation", "messages one by one, as procedures of the engine need them: `raw` is for applications"),
    ("Mailbox::emergencies", "a service of the MainDevice: the ring exists before the mailbox"),
    ("Mailbox::new", "the MainDevice makes it"),
    ("Mailbox::pop_emergency", "`EmergencyRing::pop`"),
    ("Mailbox::station", "in the name of the SubDevice"),
    ("EthernetPort::open", "frames pass through an interface of the application: `HostInterface`"),
];

/// A public function of the engine.
struct Function {
    /// Type or names of modules, any of which may be before the name.
    owners: Vec<String>,
    name: String,
    line: usize,
}

/// Functions without a method, and exemptions without a function.
pub fn without_method(tree: &Tree) -> Result<Vec<Finding>, Finding> {
    let mut called = Calls::default();
    for file in tree.rust().filter(|file| file.path.starts_with(HANDLE)) {
        called.visit_file(&parsed(file)?);
    }
    let (mut findings, mut exempt) = (Vec::new(), BTreeSet::new());
    let is_source =
        |file: &&File| file.path.starts_with(ENGINE) && !file.path.starts_with(GATEWAY) && !is_test(&file.path);
    for file in tree.rust().filter(is_source) {
        for Function { owners, name, line } in functions(file, &parsed(file)?) {
            let full = format!("{}::{name}", owners[0]);
            if EXEMPT.iter().any(|(other, _)| *other == full) {
                exempt.insert(full);
                continue;
            }
            let is_method = owners[0] == TYPE && called.methods.contains(&name);
            if !is_method && !owners.iter().any(|owner| called.paths.contains(&format!("{owner}::{name}"))) {
                findings.push(Finding::new(&file.path, line, format!("`{full}` is no method of `ringcat::SubDevice`")));
            }
        }
    }
    let is_left = |(name, _): &&(&str, &str)| !exempt.contains(*name);
    let stale = EXEMPT.iter().filter(is_left);
    findings.extend(stale.map(|(name, _)| Finding::new(ENGINE, 0, format!("`{name}` is exempt and does not exist"))));
    Ok(findings)
}

fn parsed(file: &File) -> Result<syn::File, Finding> {
    syn::parse_file(&file.text)
        .map_err(|error| Finding::new(&file.path, error.span().start().line, format!("does not parse: {error}")))
}

/// Public functions over a mailbox.
fn functions(file: &File, syntax: &syn::File) -> Vec<Function> {
    let mut modules: Vec<String> = file.path.trim_end_matches(".rs").rsplit('/').take(2).map(str::to_owned).collect();
    modules.retain(|name| name != "mail");
    let mut found = Vec::new();
    for item in &syntax.items {
        match item {
            Item::Fn(it) if is_public(&it.vis) && has_mailbox(&it.sig) => {
                found.push(Function {
                    owners: modules.clone(),
                    name: it.sig.ident.to_string(),
                    line: it.sig.span().start().line,
                });
            }
            Item::Impl(it) if it.trait_.is_none() => {
                let owner = name_of(&it.self_ty);
                for item in &it.items {
                    let ImplItem::Fn(it) = item else { continue };
                    if is_public(&it.vis) && (owner == TYPE || has_mailbox(&it.sig)) {
                        let (owners, line) = (vec![owner.clone()], it.sig.span().start().line);
                        found.push(Function { owners, name: it.sig.ident.to_string(), line });
                    }
                }
            }
            _ => {}
        }
    }
    found
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

fn has_mailbox(signature: &syn::Signature) -> bool {
    signature.inputs.iter().any(|input| matches!(input, FnArg::Typed(input) if name_of(&input.ty) == TYPE))
}

/// The last name of a type, without a reference.
fn name_of(of: &Type) -> String {
    match of {
        Type::Reference(to) => name_of(&to.elem),
        Type::Path(path) => path.path.segments.last().map_or_else(String::new, |last| last.ident.to_string()),
        _ => String::new(),
    }
}

/// Paths of two names, and names of methods, that are called.
#[derive(Default)]
struct Calls {
    paths: BTreeSet<String>,
    methods: BTreeSet<String>,
}

impl<'ast> Visit<'ast> for Calls {
    fn visit_expr_path(&mut self, path: &'ast syn::ExprPath) {
        let names: Vec<String> = path.path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if let [.., owner, name] = names.as_slice() {
            self.paths.insert(format!("{owner}::{name}"));
        }
        visit::visit_expr_path(self, path);
    }

    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        self.methods.insert(call.method.to_string());
        visit::visit_expr_method_call(self, call);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_and_methods_of_mailboxes_without_a_method_of_the_handle_are_found() {
        let mailbox = "//! It.\n\nimpl Mailbox {\n    pub fn counters(&self) {}\n    pub fn is_idle(&self) {}\n    \
                       pub(crate) fn near(&self) {}\n}\n";
        let upload = "//! It.\n\npub async fn upload(mailbox: &Mailbox) {}\n\npub async fn read(mailbox: &Mailbox) {}\n\
                      pub fn other(bytes: &[u8]) {}\n";
        let handle = "//! It.\n\nfn f(mailbox: Mailbox) {\n    mailbox.counters();\n    coe::upload(&mailbox);\n}\n";
        let file = |name: &str, text: &str| File::new(&format!("{ENGINE}{name}"), text);
        let files = vec![
            file("mailbox.rs", mailbox),
            file("coe/upload.rs", upload),
            file("relay/a.rs", upload),
            file("coe/tests.rs", upload),
            File::new(&format!("{HANDLE}a.rs"), handle),
        ];
        let found = without_method(&Tree { files }).expect("parses");
        let texts: Vec<String> =
            found.iter().map(ToString::to_string).filter(|text| text.contains("no method")).collect();
        let expected = [
            "crates/engine/src/mail/mailbox.rs:5: `Mailbox::is_idle` is no method of `ringcat::SubDevice`",
            "crates/engine/src/mail/coe/upload.rs:5: `upload::read` is no method of `ringcat::SubDevice`",
        ];
        assert_eq!(texts, expected);
        assert_eq!(found.len(), expected.len() + EXEMPT.len(), "each exemption needs its function");
    }
}
