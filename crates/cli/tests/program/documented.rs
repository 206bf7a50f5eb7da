//! Lines of JSON held against the tables of `docs/json.md`: no key more, no key less, each of its type.

use serde_json::Value;

const PAGE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/json.md"));

/// The tables of the page.
pub struct Page(json_keys::Page);

impl Page {
    /// Reads the page.
    pub fn read() -> Page {
        let page = json_keys::Page::read(PAGE);
        assert!(page.headings().count() >= 15, "{page:?}");
        Page(page)
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
        let heading = match value["type"].as_str() {
            Some("event") => "Event",
            Some("answer") => "Answer",
            Some("result") => "Every result",
            _ => panic!("`{command}`: an unknown type: {line}"),
        };
        if value["type"] == "result" && value["result"]["outcome"] != "error" {
            assert_eq!(value["command"], command, "{line}");
            self.0.check(&[heading, command], object);
        } else {
            self.0.check(&[heading], object);
        }
        value
    }
}
