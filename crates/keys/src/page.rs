//! Lines of JSON held against the tables of a page: no key more, no key less, each of its type.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

/// Types of keys by their paths, for a heading of the page.
type Keys = BTreeMap<String, String>;

/// The tables of a page.
#[derive(Debug)]
pub struct Page(BTreeMap<String, Keys>);

impl Page {
    /// Reads the text of a page.
    ///
    /// # Panics
    /// A row has another form.
    pub fn read(text: &str) -> Page {
        let mut tables: BTreeMap<String, Keys> = BTreeMap::new();
        let mut heading = String::new();
        for line in text.lines() {
            if let Some(text) = line.strip_prefix("### ") {
                heading = text.trim_matches('`').to_owned();
            } else if let Some(row) = line.strip_prefix("| `") {
                let (path, rest) = row.split_once("` | ").expect("a row of a table");
                let (kind, _) = rest.split_once(" | ").expect("a row of a table");
                tables.entry(heading.clone()).or_default().insert(path.to_owned(), kind.to_owned());
            }
        }
        Page(tables)
    }

    /// Headings that have a table.
    pub fn headings(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Holds an object against the tables below these headings together.
    ///
    /// # Panics
    /// A key is missing, is not on the page, or has another type.
    pub fn check(&self, headings: &[&str], object: &Map<String, Value>) {
        let tables = headings.iter().map(|it| self.0.get(*it).unwrap_or_else(|| panic!("the page has no table {it}")));
        let keys: Keys = tables.flatten().map(|(path, kind)| (path.clone(), kind.clone())).collect();
        check_object("", object, &keys, &format!("{object:?}"));
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
        let kind = keys.get(path).unwrap_or_else(|| panic!("{path} is not on the page: {line}"));
        check_value(path, &object[key], kind, keys, line);
    }
}

fn check_value(path: &str, value: &Value, kind: &str, keys: &Keys, line: &str) {
    let fits = |kind: &str| match kind {
        "null" => value.is_null(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "object" => value.is_object(),
        kind => kind.starts_with("array of ") && value.is_array(),
    };
    assert!(kind.split(" or ").any(fits), "{path} is {value}, documented as {kind}: {line}");
    match value {
        Value::Object(object) => check_object(path, object, keys, line),
        Value::Array(items) => {
            let kind = kind.strip_suffix(" or null").unwrap_or(kind);
            let kind = kind.strip_prefix("array of ").and_then(|kind| kind.strip_suffix('s')).expect("an array");
            items.iter().for_each(|item| check_value(&format!("{path}[]"), item, kind, keys, line));
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;

    use super::*;

    const PAGE: &str = "### `slaves`\n\n| key | type | meaning |\n|---|---|---|\n| `a` | integer or null | A |\n\
                        | `b` | array of objects | B |\n| `b[].c` | array of strings or null | C |\n";

    fn fits(text: &str) -> bool {
        let page = Page::read(PAGE);
        let value: Value = serde_json::from_str(text).expect("it is JSON");
        catch_unwind(|| page.check(&["slaves"], value.as_object().expect("it is an object"))).is_ok()
    }

    // covers: json
    #[test]
    fn a_line_fits_a_page_with_all_its_keys_and_their_types_alone() {
        for text in [r#"{"a":1,"b":[]}"#, r#"{"a":null,"b":[{"c":null},{"c":["x"]}]}"#] {
            assert!(fits(text), "{text}");
        }
        for text in [
            r#"{"a":1}"#,
            r#"{"a":"1","b":[]}"#,
            r#"{"a":1.5,"b":[]}"#,
            r#"{"a":1,"b":null}"#,
            r#"{"a":1,"b":[],"d":1}"#,
            r#"{"a":1,"b":[{}]}"#,
            r#"{"a":1,"b":[{"c":[1]}]}"#,
            r#"{"a":1,"b":[1]}"#,
        ] {
            assert!(!fits(text), "{text}");
        }
    }
}
