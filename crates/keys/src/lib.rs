//! Keys of JSON that programs print, for tests: the types of a program are held against the page that documents them,
//! and its output is held against the page.
//!
//! The types are structures with a schema (`schemars`); their comments are the meanings on the page. A key that the
//! page lacks, or a key of the page that no type has, fails the test. `RINGCAT_WRITE_JSON_KEYS=1` writes the tables.
#![forbid(unsafe_code)]

mod page;

use std::fmt::Write as _;
use std::path::Path;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde_json::Value;

pub use page::Page;

/// The line behind the tables of a page.
const END: &str = "<!-- End of what is written. -->\n";

/// A key: its path, its type and its meaning.
#[derive(Debug, PartialEq, Eq)]
pub struct Key {
    path: String,
    kind: String,
    meaning: String,
}

/// A heading of a page, and the keys below it.
pub type Table = (&'static str, Vec<Key>);

fn schema_of<T: JsonSchema>() -> Schema {
    let settings = SchemaSettings::draft2020_12().for_serialize().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>()
}

/// The keys of a type and of what it contains.
pub fn keys<T: JsonSchema>() -> Vec<Key> {
    let mut keys = Vec::new();
    note_keys("", &schema_of::<T>().to_value(), &mut keys);
    keys
}

/// Notes the keys of an object and of what it contains, in the order of the type.
fn note_keys(before: &str, schema: &Value, keys: &mut Vec<Key>) {
    let schema = without_null(schema);
    if let Some(items) = schema.get("items") {
        return note_keys(&format!("{before}[]"), items, keys);
    }
    let Some(properties) = schema.get("properties").and_then(Value::as_object) else { return };
    // Every key is always there, so this list has all of them, in the order of the type.
    let names: Vec<&str> = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    assert_eq!(names.len(), properties.len(), "a key may be absent: {names:?} of {properties:?}");
    for name in names {
        let property = &properties[name];
        let path = if before.is_empty() { name.to_owned() } else { format!("{before}.{name}") };
        let meaning = property.get("description").and_then(Value::as_str).unwrap_or_default().replace('\n', " ");
        keys.push(Key { path: path.clone(), kind: kind(property), meaning });
        note_keys(&path, property, keys);
    }
}

/// What a value is where it is not null.
fn without_null(schema: &Value) -> &Value {
    let alternatives = schema.get("anyOf").and_then(Value::as_array);
    let value = alternatives.and_then(|all| all.iter().find(|one| one.get("type") != Some(&Value::from("null"))));
    value.unwrap_or(schema)
}

/// The type in words.
fn kind(schema: &Value) -> String {
    if schema.get("anyOf").is_some() {
        return format!("{} or null", kind(without_null(schema)));
    }
    if schema.get("oneOf").is_some() || schema.get("enum").is_some() {
        return "string".to_owned();
    }
    let words = |name: &str| match (name, schema.get("items")) {
        ("array", Some(items)) => format!("array of {}s", kind(items)),
        _ => name.to_owned(),
    };
    match &schema["type"] {
        Value::Array(types) => types.iter().filter_map(Value::as_str).map(words).collect::<Vec<_>>().join(" or "),
        other => words(other.as_str().expect("every value has a type")),
    }
}

fn text(tables: &[Table]) -> String {
    let mut text = String::new();
    for (heading, keys) in tables {
        // Writing into a String cannot fail.
        let _ = write!(text, "\n### {heading}\n\n| key | type | meaning |\n|---|---|---|\n");
        for Key { path, kind, meaning } in keys {
            let _ = writeln!(text, "| `{path}` | {kind} | {meaning} |");
        }
    }
    text.push('\n');
    text
}

/// Holds the page against the tables, or writes them into it; `begin` is the line before them.
///
/// # Panics
/// The page and the tables differ.
pub fn check_page(path: &Path, begin: &str, tables: &[Table]) {
    if !path.with_file_name("FEATURES.md").exists() {
        println!("skipped: a package has no pages, {} is not there", path.display());
        return;
    }
    let name = path.display();
    let page = std::fs::read_to_string(path).expect("the page is there");
    let (before, rest) = page.split_once(begin).expect("the page has a line where the tables begin");
    let (written, after) = rest.split_once(END).expect("the page has a line where the tables end");
    if std::env::var("RINGCAT_WRITE_JSON_KEYS").is_ok_and(|value| value == "1") {
        std::fs::write(path, format!("{before}{begin}{}{END}{after}", text(tables))).expect("the page is writable");
        return;
    }
    let (written, expected): (Vec<&str>, String) = (written.lines().collect(), text(tables));
    let expected: Vec<&str> = expected.lines().collect();
    let lacking: Vec<&&str> = expected.iter().filter(|line| !written.contains(line)).collect();
    let surplus: Vec<&&str> = written.iter().filter(|line| !expected.contains(line)).collect();
    assert!(lacking.is_empty() && surplus.is_empty(), "{name} lacks {lacking:#?}, and has besides {surplus:#?}");
    assert_eq!(written, expected, "the order of {name}");
}

/// Every key has a type, a meaning and a unit.
///
/// # Panics
/// A key lacks one of these.
pub fn check_keys(tables: &[Table]) {
    for (heading, keys) in tables {
        for Key { path, kind, meaning } in keys {
            let key = format!("{heading} {path}");
            assert!(!meaning.is_empty() && !meaning.ends_with('.'), "{key}: {meaning}");
            assert!(path.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || "_.[]".contains(c)), "{key}");
            let unit = [("_ns", "nanoseconds"), ("_hz", "hertz"), ("_ppb", "arts per billion")];
            for (ending, words) in unit.into_iter().filter(|(ending, _)| path.ends_with(ending)) {
                assert!(meaning.contains(words), "{key} ends with {ending}: {meaning}");
            }
            assert_eq!(kind.ends_with("or null"), meaning.contains("null"), "{key}: when it is null: {meaning}");
        }
    }
}
