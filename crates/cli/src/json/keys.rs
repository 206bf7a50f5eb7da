//! The documentation of all keys, made from the types: `docs/json.md` has to agree with them.
//!
//! A key that the page lacks, or a key of the page that no type has, fails the test. `RINGCAT_WRITE_JSON_KEYS=1` writes
//! the tables of the page.

use std::fmt::Write as _;
use std::path::PathBuf;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde_json::Value;

use super::{bench, capture, clocks, demo, doctor, eni, esi, line, network, ring, run, scan, sii, sim, standby};

/// Lines around the tables.
const BEGIN: &str =
    "<!-- Written from crates/cli/src/json: RINGCAT_WRITE_JSON_KEYS=1 cargo test -p ringcat-cli keys -->\n";
const END: &str = "<!-- End of what is written. -->\n";

/// A key: its path, its type and its meaning.
#[derive(Debug, PartialEq, Eq)]
struct Key {
    path: String,
    kind: String,
    meaning: String,
}

fn schema_of<T: JsonSchema>() -> Schema {
    let settings = SchemaSettings::draft2020_12().for_serialize().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>()
}

fn keys<T: JsonSchema>() -> Vec<Key> {
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

/// All lines: a heading, and the keys.
fn all() -> Vec<(&'static str, Vec<Key>)> {
    vec![
        ("Every result", keys::<line::ResultLine>()),
        ("Event", keys::<line::EventLine>()),
        ("Answer", keys::<line::AnswerLine>()),
        ("`scan`", keys::<scan::Scan>()),
        ("`init`", keys::<network::Init>()),
        ("`compare`", keys::<network::Compare>()),
        ("`run`", keys::<run::Run>()),
        ("`ring`", keys::<ring::Ring>()),
        ("`clocks`", keys::<clocks::Clocks>()),
        ("`doctor`", keys::<doctor::Doctor>()),
        ("`capture`", keys::<capture::Capture>()),
        ("`standby`", keys::<standby::Standby>()),
        ("`sim`", keys::<sim::Sim>()),
        ("`eni`", keys::<eni::EniFile>()),
        ("`eni export`", keys::<eni::EniExport>()),
        ("`esi list`", keys::<esi::EsiList>()),
        ("`esi show`", keys::<esi::EsiShow>()),
        ("`esi declare`", keys::<esi::EsiDeclared>()),
        ("`sii build`", keys::<sii::SiiBuilt>()),
        ("`sii compare`", keys::<sii::SiiCompared>()),
        ("`sii skeleton`", keys::<sii::SiiSkeleton>()),
        ("`demo`", keys::<demo::Demo>()),
        ("`bench echo`", keys::<bench::Echo>()),
        ("`bench round-trip`", keys::<bench::RoundTrip>()),
        ("`bench cycles`", keys::<bench::Cycles>()),
        ("`bench rate`", keys::<bench::Rate>()),
    ]
}

fn tables() -> String {
    let mut text = String::new();
    for (heading, keys) in all() {
        // Writing into a String cannot fail.
        let _ = write!(text, "\n### {heading}\n\n| key | type | meaning |\n|---|---|---|\n");
        for Key { path, kind, meaning } in keys {
            let _ = writeln!(text, "| `{path}` | {kind} | {meaning} |");
        }
    }
    text.push('\n');
    text
}

// covers: json
#[test]
fn the_page_of_all_keys_agrees_with_the_types() {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/json.md"));
    if !path.with_file_name("FEATURES.md").exists() {
        println!("skipped: a package has no pages, {} is not there", path.display());
        return;
    }
    let page = std::fs::read_to_string(&path).expect("docs/json.md is there");
    let (before, rest) = page.split_once(BEGIN).expect("the page has a line where the tables begin");
    let (written, after) = rest.split_once(END).expect("the page has a line where the tables end");
    if std::env::var("RINGCAT_WRITE_JSON_KEYS").is_ok_and(|value| value == "1") {
        std::fs::write(&path, format!("{before}{BEGIN}{}{END}{after}", tables())).expect("the page is writable");
        return;
    }
    let (written, expected): (Vec<&str>, String) = (written.lines().collect(), tables());
    let expected: Vec<&str> = expected.lines().collect();
    let lacking: Vec<&&str> = expected.iter().filter(|line| !written.contains(line)).collect();
    let surplus: Vec<&&str> = written.iter().filter(|line| !expected.contains(line)).collect();
    assert!(lacking.is_empty() && surplus.is_empty(), "docs/json.md lacks {lacking:#?}, and has besides {surplus:#?}");
    assert_eq!(written, expected, "the order of docs/json.md");
}

// covers: json
#[test]
fn every_key_has_a_type_a_meaning_and_a_unit() {
    for (heading, keys) in all() {
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
