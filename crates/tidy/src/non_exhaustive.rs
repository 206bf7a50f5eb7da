//! Public errors, events, counters and options are `#[non_exhaustive]`, so that they may grow.
//!
//! Input: the tree. Output: a finding for each public type of the library or of a crate below it that has such a name
//! and not the attribute. `EXEMPT` lists types that represent a register or a message on the wire, and types that
//! applications do not get.

use crate::Finding;
use crate::tree::{File, Tree};

/// Crates whose types applications meet. `wire` is what registers and messages are: its types change with the
/// protocol.
const SOURCES: [&str; 5] =
    ["crates/ringcat/src/", "crates/engine/src/", "crates/config/src/", "crates/gateway/src/", "crates/link/src/"];

/// Endings of the names of such types.
const NAMES: [&str; 8] = ["Error", "Failure", "Problem", "Warning", "Event", "Counters", "Options", "Limits"];

/// Types that may be without it, with the reason.
#[rustfmt::skip]
const EXEMPT: &[(&str, &str)] = &[
    ("ScanOptions", "made by the engine from its own options"),
    ("PacketOptions", "of the kernel's sockets; applications name interfaces"),
    ("CyclicEvent", "between the halves of the engine"),
];

/// Types without the attribute.
pub fn missing(tree: &Tree) -> Vec<Finding> {
    let files = tree.rust().filter(|file| SOURCES.iter().any(|sources| file.path.starts_with(sources)));
    files.flat_map(of_file).collect()
}

fn of_file(file: &File) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut has_attribute = false;
    for (number, line) in file.text.lines().enumerate() {
        if line.starts_with("#[") || line.starts_with("//") {
            has_attribute |= line.starts_with("#[non_exhaustive");
            continue;
        }
        let declared = line.strip_prefix("pub struct ").or_else(|| line.strip_prefix("pub enum "));
        let name = declared.and_then(|rest| rest.split(|c: char| !c.is_alphanumeric()).next()).unwrap_or_default();
        let is_meant =
            NAMES.iter().any(|ending| name.ends_with(ending)) && EXEMPT.iter().all(|(other, _)| *other != name);
        // Private fields close a type as well.
        let is_closed = line.ends_with(");") && !line.contains("(pub ");
        if is_meant && !has_attribute && !is_closed {
            let text = format!("`{name}` may grow: it needs `#[non_exhaustive]`");
            findings.push(Finding::new(&file.path, number + 1, text));
        }
        // Attributes of several lines are passed by.
        has_attribute &= line.starts_with(' ') || line.starts_with(")]");
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_public_error_without_the_attribute_is_found_and_no_other_type() {
        let text = "//! It.\n\n/// A.\n#[derive(Debug)]\npub enum AError {\n    One,\n}\n\n\
                    #[non_exhaustive]\npub struct BOptions {\n    pub it: u8,\n}\n\npub struct Other;\n\n\
                    enum OwnError {}\n\npub enum CyclicEvent {\n";
        let tree = Tree { files: vec![File::new("crates/engine/src/a.rs", text)] };
        let found: Vec<String> = missing(&tree).iter().map(ToString::to_string).collect();
        assert_eq!(found, ["crates/engine/src/a.rs:5: `AError` may grow: it needs `#[non_exhaustive]`"]);
    }
}
