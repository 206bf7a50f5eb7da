//! Lines of JSON held against the tables of `docs/json.md`: no key more, no key less, each of its type.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

const PAGE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/json.md"));

/// Types of keys by their paths, for a heading of the page.
type Keys = BTreeMap<String, String>;

/// The tables of the page.
pub struct Page(BTreeMap<String, Keys>);

impl Page {
    /// Reads the page.
    pub fn read() -> Page {
        let mut tables: BTreeMap<String, Keys> = BTreeMap::new();
        let mut heading = String::new();
        for line in PAGE.lines() {
            if let Some(text) = line.strip_prefix("### ") {
                heading = text.trim_matches('`').to_owned();
            } else if let Some(row) = line.strip_prefix("| `") {
                let (path, rest) = row.split_once("` | ").expect("a row of a table");
                let (kind, _) = rest.split_once(" | ").expect("a row of a table");
                tables.entry(heading.clone()).or_default().insert(path.to_owned(), kind.to_owned());
            }
        }
        assert!(tables.len() >= 15, "{:?}", tables.keys());
        Page(tables)
    }

    /// All lines that a command has printed; the last one, which is its result.
    pub fn check(&self, command: &str, output: &str) -> Value {
        let mut lines = output.lines().map(|line| self.check_line(command, line)).collect::<Vec<_>>();
        let last = lines.pop().unwrap_or_else(|| panic!("`{command}` prints nothing"));
        assert_eq!(last["type"], "result", "the last line of `{command}`");
        assert!(lines.iter().all(|line| line["type"] != "result"), "`{command}` has one result");
        last
    }

    fn check_line(&self, command: &str, line: &str) -> Value {
        let value: Value = serde_json::from_str(line).unwrap_or_else(|error| panic!("`{command}`: {error}: {line}"));
        let object = value.as_object().unwrap_or_else(|| panic!("`{command}`: no object: {line}"));
        assert_eq!(value["schema_version"], 1, "{line}");
        let mut keys = match value["type"].as_str() {
            Some("event") => self.0["Event"].clone(),
            Some("answer") => self.0["Answer"].clone(),
            Some("result") => self.0["Every result"].clone(),
            _ => panic!("`{command}`: an unknown type: {line}"),
        };
        if value["type"] == "result" && value["result"]["outcome"] != "error" {
            assert_eq!(value["command"], command, "{line}");
            keys.extend(self.0[command].clone());
        }
        check_object("", object, &keys, line);
        value
    }
}

/// The keys of an object are those whose path is one step longer than its own.
fn check_object(path: &str, object: &Map<String, Value>, keys: &Keys, line: &str) {
    let prefix = if path.is_empty() { String::new() } else { format!("{path}.") };
    let is_child = |key: &&String| key.strip_prefix(&prefix).is_some_and(|rest| !rest.contains('.'));
    let documented: Vec<&String> = keys.keys().filter(is_child).collect();
    let present: Vec<String> = object.keys().map(|key| format!("{prefix}{key}")).collect();
    for key in &documented {
        assert!(present.contains(key), "{key} is missing in {line}");
    }
    for (key, path) in object.keys().zip(&present) {
        let kind = keys.get(path).unwrap_or_else(|| panic!("{path} is not in docs/json.md: {line}"));
        check_value(path, &object[key], kind, keys, line);
    }
}

fn check_value(path: &str, value: &Value, kind: &str, keys: &Keys, line: &str) {
    let (kind, may_be_null) = match kind.strip_suffix(" or null") {
        Some(kind) => (kind, true),
        None => (kind, false),
    };
    let fits = match kind {
        _ if value.is_null() => may_be_null,
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "object" => value.is_object(),
        kind => kind.starts_with("array of ") && value.is_array(),
    };
    assert!(fits, "{path} is {value}, documented as {kind}: {line}");
    match value {
        Value::Object(object) => check_object(path, object, keys, line),
        Value::Array(items) => {
            let kind = kind.strip_prefix("array of ").and_then(|kind| kind.strip_suffix('s')).expect("an array");
            items.iter().for_each(|item| check_value(&format!("{path}[]"), item, kind, keys, line));
        }
        _ => {}
    }
}
