//! Public types that may grow are `#[non_exhaustive]`: options, errors, events, statuses, counters, results.
//!
//! Input: the tree. Output: a finding for each public struct with public fields and each public enum without the
//! attribute, of the library `ringcat`, of `ringcat-gateway`, and of the lower crates where the library re-exports the
//! type by name; in all of these crates also for each public type with such a name as `Error`. A newtype is its value.
//! `EXEMPT` lists the types that are closed, with the reason.
//!
//! The lines of the tool (`daemon::known`, a module) are made by the library and printed by `ethercat` of the same
//! version: messages of another version are refused (decision 0105), and a new key must be printed, not overlooked.
//!
//! Of `wire`, `sim` and `config`, which are re-exported as a whole, only types with such names: the others change with
//! the protocol, with what is simulated, and with the format of the file.

use crate::Finding;
use crate::handed_on::re_exported;
use crate::tree::{File, Tree};

/// Crates whose public types are all meant for applications.
const OWN: [&str; 2] = ["ringcat", "gateway"];
/// Crates with types that the library re-exports by name.
const LOWER: [&str; 4] = ["engine", "config", "link", "control"];
/// Crates of which only types with such [`NAMES`] are meant.
const BY_NAME: [&str; 2] = ["sim", "wire"];

/// Endings of names that are meant in any crate.
const NAMES: [&str; 8] = ["Error", "Failure", "Problem", "Warning", "Event", "Counters", "Options", "Limits"];

/// Types that may be without it, with the reason.
#[rustfmt::skip]
const EXEMPT: &[(&str, &str)] = &[
    ("Address", "an index in the declaration or a position on the bus"),
    ("Cable", "a cable has two ends"),
    ("Class", "cyclic or acyclic"),
    ("CyclicEvent", "between the halves of the engine"),
    ("CyclicStandbyEvent", "between the halves of the engine"),
    ("Direction", "outputs or inputs"),
    ("DomainState", "the three results of a working counter"),
    ("EitherLinks", "the two kinds that it is made of"),
    ("Entry", "domain, first bit and number of bits"),
    ("ErrorCounters", "the registers of a controller"),
    ("Freshness", "an application has to handle each"),
    ("Half", "acyclic or cyclic"),
    ("HandedSocket", "made by the process that has received the descriptor"),
    ("Handover", "in order or after a crash: a new owner has to know which"),
    ("Link", "a ring has two links"),
    ("MessageError", "a server answers each with a code of its own"),
    ("PayloadError", "a server answers each with a code of its own"),
    ("RegisterAccess", "a register is written or checked"),
    ("RequestState", "a request of the cyclic thread is polled: an application has to handle each"),
    ("Right", "to read, or to change: a server decides about each"),
    ("RingState", "closed, open, or not yet proved"),
    ("SdoAddress", "index and subindex"),
    ("SoeAddress", "drive and IDN"),
    ("SyncManagerRole", "mailboxes and process data, each in two directions"),
    ("Transition", "those of the EtherCAT state machine"),
    ("Voe", "a VoE message: vendor, type and data"),
    ("WatchdogCounters", "the registers of a controller"),
];

/// Types without the attribute.
pub fn missing(tree: &Tree) -> Vec<Finding> {
    let of_lower = LOWER.iter().flat_map(|name| {
        let names = re_exported(tree, name);
        of_crate(tree, name, &|it| names.contains(it))
    });
    let own = OWN.iter().flat_map(|name| of_crate(tree, name, &|_| true));
    let by_name = BY_NAME.iter().flat_map(|name| of_crate(tree, name, &|_| false));
    own.chain(of_lower).chain(by_name).collect()
}

fn of_crate(tree: &Tree, name: &str, is_for_applications: &dyn Fn(&str) -> bool) -> Vec<Finding> {
    let sources = format!("crates/{name}/src/");
    let files = tree.rust().filter(|file| file.path.starts_with(&sources));
    let types = files.flat_map(|file| open_types(file).into_iter().map(move |(line, name)| (file, line, name)));
    let wanted = |name: &str| {
        let is_closed = EXEMPT.iter().any(|(other, _)| *other == name);
        !is_closed && (is_for_applications(name) || NAMES.iter().any(|ending| name.ends_with(ending)))
    };
    let finding = |(file, line, name): (&File, usize, String)| {
        wanted(&name).then(|| {
            let text = format!("`{name}` may grow: it needs `#[non_exhaustive]`");
            Finding::new(&file.path, line, text)
        })
    };
    types.filter_map(finding).collect()
}

/// Public enums, and public structs with public fields, without the attribute: line and name.
fn open_types(file: &File) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut has_attribute = false;
    let lines: Vec<&str> = file.text.lines().collect();
    for (at, line) in lines.iter().enumerate() {
        if line.starts_with("#[") || line.starts_with("//") {
            has_attribute |= line.starts_with("#[non_exhaustive");
            continue;
        }
        let of_enum = line.strip_prefix("pub enum ");
        let of_struct = line.strip_prefix("pub struct ").filter(|_| has_public_fields(&lines[at..]));
        if let Some(rest) = of_enum.or(of_struct).filter(|_| !has_attribute) {
            let name = rest.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
            found.push((at + 1, name.to_owned()));
        }
        // Attributes of several lines are passed by.
        has_attribute &= line.starts_with(' ') || line.starts_with(")]");
    }
    found
}

/// Whether the struct that begins here has a public field and is no newtype.
fn has_public_fields(lines: &[&str]) -> bool {
    if lines[0].ends_with(';') {
        return lines[0].matches("pub ").count() > 2;
    }
    let body = lines[1..].iter().take_while(|line| !line.starts_with('}'));
    !lines[0].ends_with('}') && body.into_iter().any(|line| line.starts_with("    pub "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let tree = Tree { files: files.iter().map(|(path, text)| File::new(path, text)).collect() };
        missing(&tree).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn each_open_type_of_the_library_is_found() {
        let text = "//! It.\n\n/// A.\n#[derive(Debug)]\npub enum A {\n    One,\n}\n\n\
                    #[non_exhaustive]\npub struct B {\n    pub it: u8,\n}\n\npub struct Unit;\n\n\
                    pub struct Id(pub u8);\n\npub struct Closed {\n    it: u8,\n}\n\npub struct C<T> {\n    \
                    /// It.\n    pub it: T,\n}\n\nenum Own {}\n\npub enum Link {\n    Main,\n}\n\n\
                    pub struct Pair(pub u8, pub u8);\n";
        let expected = ["`A`", "`C`", "`Pair`"].map(|name| format!("{name} may grow: it needs `#[non_exhaustive]`"));
        let found = found(&[("crates/ringcat/src/a.rs", text)]);
        let texts: Vec<&str> = found.iter().filter_map(|line| line.splitn(3, ':').nth(2)).map(str::trim).collect();
        assert_eq!(texts, expected);
    }

    #[test]
    fn of_lower_crates_re_exported_types_and_errors_are_found() {
        let lower = "//! It.\n\npub enum AError {\n    One,\n}\n\npub enum B {\n    One,\n}\n\npub enum C {\n    \
                     One,\n}\n\npub enum CyclicEvent {\n    One,\n}\n";
        let library = "//! It.\n\npub use ringcat_engine::a::B;\n";
        let found = found(&[("crates/engine/src/a.rs", lower), ("crates/ringcat/src/lib.rs", library)]);
        let expected = [
            "crates/engine/src/a.rs:3: `AError` may grow: it needs `#[non_exhaustive]`",
            "crates/engine/src/a.rs:7: `B` may grow: it needs `#[non_exhaustive]`",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn each_exempt_name_belongs_to_a_type_of_the_tree() {
        let tree = Tree::of_this_repository().expect("the tree can be read");
        let declared = |name: &str| {
            let ways = ["enum", "struct"].map(|kind| [' ', '<'].map(|end| format!("pub {kind} {name}{end}"))).concat();
            tree.rust().any(|file| file.text.lines().any(|line| ways.iter().any(|way| line.starts_with(way))))
        };
        let missing: Vec<&str> = EXEMPT.iter().map(|(name, _)| *name).filter(|name| !declared(name)).collect();
        assert_eq!(missing, [""; 0]);
    }
}
