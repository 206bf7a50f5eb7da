use super::*;
use crate::tree::File;

/// Arrows between the files of a library, as `from -> to`, paths below `src/` without `.rs`.
fn arrows(files: &[(&str, &str)]) -> Vec<String> {
    let files = files.iter().map(|(path, text)| File::new(&format!("crates/x/src/{path}.rs"), text)).collect();
    let arrows = of_crate(&Tree { files }, "x").unwrap_or_else(|finding| panic!("{finding}"));
    let short = |path: &str| path.trim_start_matches("crates/x/src/").trim_end_matches(".rs").to_owned();
    arrows.keys().map(|(from, to)| format!("{} -> {}", short(from), short(to))).collect()
}

/// Arrows from `a` in a library of `a`, `b`, `b/c`; `b` re-exports what `c` has.
fn from_a(text: &str) -> Vec<String> {
    arrows(&[
        ("lib", "mod a; mod b; #[cfg(test)] mod only_in_tests;"),
        ("a", text),
        (
            "b",
            "mod c; pub use c::{Item, Item as Renamed, function, Way}; pub use c as other; pub const OWN: u8 = 0; \
             pub trait Act { fn act(&self); } pub mod inline { pub struct Inner; pub use super::c::Item as Deep; }",
        ),
        ("b/c", "pub struct Item; pub fn function() {} pub enum Way { In, Out } pub trait Go { fn go(&self); }"),
    ])
}

#[test]
fn a_re_exported_item_belongs_to_its_own_file() {
    for text in [
        "use crate::b::Item;",
        "use super::b::Item;",
        "use crate::b::{self, Item as Other}; fn f(_: Other) {}",
        "use crate::b::Renamed;",
        "fn f(_: crate::b::Item) {}",
        "fn f() { crate::b::function(); }",
        "fn f() { let x = crate::b::Way::In; }",
        "use crate::b::other; fn f(_: other::Item) {}",
        "use crate::b; fn f(_: &[b::Item]) {}",
        "use crate::b as z; impl From<z::Item> for u8 {}",
        "fn f() { use crate::b; b::function(); }",
        "use crate::b::inline::Deep;",
    ] {
        assert_eq!(from_a(text), ["a -> b/c"], "{text}");
    }
}

#[test]
fn an_item_of_the_parent_file_is_there() {
    for text in ["use crate::b::OWN;", "use crate::b::Act;", "fn f(_: crate::b::inline::Inner) {}"] {
        assert_eq!(from_a(text), ["a -> b"], "{text}");
    }
}

#[test]
fn modules_re_exports_and_tests_are_no_arrows() {
    for text in [
        "use crate::b;",
        "use crate::b::{self};",
        "pub use crate::b::Item;",
        "pub(crate) use crate::b::Item as Mine;",
        "#[cfg(test)] mod tests { use crate::b::Item; }",
        "#[cfg(test)] use crate::b::Item;",
        "#[cfg(all(test, unix))] fn f(_: crate::b::Item) {}",
        "struct S; impl S { #[cfg(test)] fn f(_: crate::b::Item) {} }",
        "use std::b::Item; use ::b::Item as Other;",
        "pub(in crate::b) fn f() {}",
        "/// [`crate::b::Item`]\nfn f() { \"crate::b::Item\"; }",
    ] {
        assert_eq!(from_a(text), Vec::<String>::new(), "{text}");
    }
    assert_eq!(from_a("#[cfg(not(test))] use crate::b::Item;"), ["a -> b/c"]);
}

#[test]
fn a_use_in_the_re_exporting_file_is_an_arrow() {
    let child = ("a/b", "pub struct Item; impl Item { pub fn new() -> Item { Item } }");
    let lib = ("lib", "mod a;");
    assert_eq!(arrows(&[lib, ("a", "mod b; pub use b::Item;"), child]), Vec::<String>::new());
    assert_eq!(arrows(&[lib, ("a", "mod b; pub use b::Item; fn f() { Item::new(); }"), child]), ["a -> a/b"]);
    assert_eq!(arrows(&[lib, ("a", "mod b; fn f() { b::Item::new(); }"), child]), ["a -> a/b"]);
}

#[test]
fn parent_and_child_that_use_each_other_are_a_circle() {
    let files = [
        ("lib", "mod a;"),
        ("a", "mod b; pub struct Whole { part: b::Part }"),
        ("a/b", "use super::Whole; pub struct Part; fn f(_: &Whole) {}"),
    ];
    assert_eq!(arrows(&files), ["a -> a/b", "a/b -> a"]);
}

#[test]
fn a_private_import_of_the_parent_is_followed() {
    let files = [
        ("lib", "mod a; mod d;"),
        ("a", "mod b; use crate::d::Thing; fn f(_: Thing) {}"),
        ("a/b", "use super::Thing; fn f(_: Thing) {}"),
        ("d", "pub struct Thing;"),
    ];
    assert_eq!(arrows(&files), ["a -> d", "a/b -> d"]);
}

#[test]
fn globs_import_used_names_and_all_traits() {
    assert_eq!(from_a("use crate::b::*; fn f(_: Item) { }"), ["a -> b", "a -> b/c"]);
    assert_eq!(from_a("use crate::b::inline::*;"), Vec::<String>::new());
    assert_eq!(from_a("use crate::b::inline::*; fn f(_: Deep) {}"), ["a -> b/c"]);
    assert_eq!(from_a("use crate::b::Way::*; fn f() { In; }"), ["a -> b/c"]);
    assert_eq!(from_a("fn f() { use crate::b::inline::*; let x = Inner; }"), ["a -> b"]);
    let chained = [
        ("lib", "mod a; mod b; mod c;"),
        ("a", "use crate::b::Deep;"),
        ("b", "pub use crate::c::*; pub use crate::a::*;"),
        ("c", "pub use crate::b::*; pub struct Deep;"),
    ];
    assert_eq!(arrows(&chained), ["a -> c"]);
}

#[test]
fn circular_imports_terminate() {
    assert_eq!(
        arrows(&[("lib", "mod a;"), ("a", "pub use self::b; pub use b::b as b; fn f(_: b::X) {}")]),
        Vec::<String>::new()
    );
}

#[test]
fn a_name_may_be_a_module_and_a_function() {
    let files = [
        ("lib", "mod a; mod b;"),
        ("a", "use crate::b::part; fn f() { part(); part::inner(); }"),
        ("b", "pub mod part; pub fn part() {}"),
        ("b/part", "pub fn inner() {}"),
    ];
    assert_eq!(arrows(&files), ["a -> b", "a -> b/part"]);
}

#[test]
fn paths_in_macros_are_seen() {
    for text in [
        "fn f() { assert_eq!(1, crate::b::function()); }",
        "use crate::b; fn f() { vec![b::Way::In]; }",
        "macro_rules! m { () => { $crate::b::Item } }",
        "fn f() { matches!(x.b, super::b::Way::In | super::b::Way::Out); }",
    ] {
        assert_eq!(from_a(text), ["a -> b/c"], "{text}");
    }
    assert_eq!(
        from_a("use crate::b; fn f() { say!(x.b::<u8>(), y::b::Item, ::b::Item, $b::Item); }"),
        Vec::<String>::new()
    );
}

#[test]
fn macros_and_the_items_they_create_are_items() {
    let files = [
        ("lib", "#[macro_use] mod m; mod a; mod b; mod c;"),
        ("m", "macro_rules! number { ($name:ident) => { pub struct $name; } }"),
        ("a", "number!(Meter); number!(Gram);"),
        ("b", "use crate::a::Meter; fn f(_: crate::a::Gram) {}"),
        ("c", "use crate::a::*; fn f(_: Gram) {}"),
    ];
    assert_eq!(arrows(&files), ["a -> m", "b -> a", "c -> a"]);
}

#[test]
fn variables_are_not_functions_of_their_name() {
    let globs = "use crate::b::inline; pub use crate::b::function; ";
    assert_eq!(from_a(&format!("{globs} fn f(function: u8) -> u8 {{ function + 1 }}")), Vec::<String>::new());
    assert_eq!(from_a(&format!("{globs} fn f() {{ let function = 1; g!(function); }}")), Vec::<String>::new());
    assert_eq!(from_a(&format!("{globs} fn f() {{ let function = function(); }}")), ["a -> b/c"]);
    assert_eq!(from_a(&format!("{globs} fn f() {{ x.map(function); }}")), ["a -> b/c"]);
}

#[test]
fn constants_in_patterns_are_seen() {
    assert_eq!(from_a("pub use crate::b::OWN; fn f(x: u8) { match x { OWN => {} _ => {} } }"), ["a -> b"]);
}

#[test]
fn programs_of_a_crate_are_read_and_tests_beside_it_are_not() {
    let files = [
        ("lib", "pub mod a;"),
        ("a", "pub struct A;"),
        ("bin/tool", "mod part; fn f(_: part::P) {}"),
        ("bin/part", "pub struct P;"),
        ("main", "mod a; fn f(_: a::A) {}"),
        ("../tests/t", "mod missing;"),
    ];
    assert_eq!(arrows(&files), ["bin/tool -> bin/part", "main -> a"]);
}

#[test]
fn a_module_in_braces_has_its_own_names() {
    assert_eq!(
        from_a("mod i { use super::super::b::OWN; pub mod j { fn f(_: super::super::super::b::Item) {} } }"),
        ["a -> b", "a -> b/c"]
    );
    assert_eq!(from_a("mod b { pub struct Item; } fn f(_: b::Item) {}"), Vec::<String>::new());
}

#[test]
fn a_module_whose_file_is_missing_is_a_finding() {
    let tree = Tree { files: vec![File::new("crates/x/src/lib.rs", "mod gone;")] };
    assert!(of_crate(&tree, "x").is_err_and(|finding| finding.file.ends_with("src/gone.rs")));
    let tree = Tree { files: vec![File::new("crates/x/src/lib.rs", "fn (")] };
    assert!(of_crate(&tree, "x").is_err_and(|finding| finding.line == 1));
}
