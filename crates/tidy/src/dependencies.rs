//! Crates that an application gets with the library, per feature, and crates that examples name.
//!
//! Input: the output of `cargo tree` for a set of features. Output: a finding for every crate that is not allowed, and
//! for exceeding the limit.

use std::collections::BTreeSet;
use std::process::Command;

use crate::Finding;
use crate::tokens::tokens;
use crate::tree::Tree;

/// Features of `ringcat`, each one alone.
pub const FEATURE_SETS: [&str; 12] =
    ["", "packet", "sim", "eni", "network", "esi", "gateway", "eoe", "daemon", "tracing", "serde", "standby"];

/// Sets for an application on network interfaces, with few dependencies.
const SMALL: [&str; 2] = ["", "packet"];
/// Maximum number of crates from the registry in one of the small sets.
pub const MAX_CRATES: usize = 12;
/// Crates of the program, the simulator, files and the gateway.
const NOT_IN_SMALL: [&str; 9] =
    ["clap", "mio", "roxmltree", "serde_json", "signal-hook", "smoltcp", "strsim", "toml", "tracing"];

/// Sources that may name only the library of this repository, and exceptions.
const USERS: [(&str, &[&str]); 3] = [
    ("crates/ringcat/examples/", &[]),
    // It measures the cyclic half of the engine.
    ("crates/cli/src/bench/", &["ringcat_engine", "ringcat_link"]),
    // Information of the kernel about interfaces is not EtherCAT.
    ("crates/cli/", &["ringcat_link"]),
];

/// Output of `cargo tree` for an application with these features of the library.
pub fn cargo_tree(features: &str) -> Result<String, String> {
    let mut cargo = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()));
    cargo.args(["tree", "--offline", "--package", "ringcat", "--edges", "normal", "--prefix", "none"]);
    cargo.args(["--no-default-features", "--features", features]);
    let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).output().map_err(|error| error.to_string())?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if output.status.success() { Ok(text(&output.stdout)) } else { Err(text(&output.stderr)) }
}

/// Names of crates from the registry in the output of `cargo tree --prefix none`, and of crates of this repository.
pub fn crates_in(tree: &str) -> (BTreeSet<&str>, BTreeSet<&str>) {
    let lines = tree.lines().filter(|line| !line.trim().is_empty());
    let (ours, others): (Vec<&str>, Vec<&str>) = lines.partition(|line| line.contains("(/"));
    (others.into_iter().filter_map(first_word).collect(), ours.into_iter().filter_map(first_word).collect())
}

fn first_word(line: &str) -> Option<&str> {
    line.split(' ').next()
}

/// Findings about the crates of a set of features.
pub fn not_in(features: &str, tree: &str) -> Vec<Finding> {
    if !SMALL.contains(&features) {
        return Vec::new();
    }
    let (others, _) = crates_in(tree);
    let finding =
        |text: String| Finding::new("crates/ringcat/Cargo.toml", 0, format!("features \"{features}\": {text}"));
    let mut findings: Vec<Finding> = NOT_IN_SMALL
        .iter()
        .filter(|name| others.contains(**name))
        .map(|name| finding(format!("{name} comes in")))
        .collect();
    if others.len() > MAX_CRATES {
        findings.push(finding(format!("{} crates from the registry, at most {MAX_CRATES} may be", others.len())));
    }
    findings
}

/// Examples and sources of the program that name another crate of this repository than allowed: an application depends
/// only on `ringcat`.
pub fn beside_the_library(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for file in tree.rust() {
        let Some((_, allowed)) = USERS.iter().find(|(place, _)| file.path.starts_with(place)) else { continue };
        for token in tokens(&file.text) {
            let Some(name) = token.ident().filter(|name| name.starts_with("ringcat_")) else { continue };
            if !allowed.contains(&name) {
                findings.push(Finding::new(&file.path, token.line, format!("names {name}: take it from ringcat")));
            }
        }
    }
    findings
}

/// Programs and examples: the library's own functions are enough for them.
const PROGRAMS: [&str; 5] =
    ["crates/cli/src/", "crates/ethercat/src/", "crates/ffi/src/", "crates/ringcat/examples/", "crates/ringcatd/src/"];

/// Programs and examples that reach through the library to its engine (feature `engine`): only checkers and tests do.
pub fn reach_the_engine(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    let is_program = |path: &str| PROGRAMS.iter().any(|program| path.starts_with(program));
    for file in tree.rust().filter(|file| is_program(&file.path)) {
        for token in tokens(&file.text) {
            if let Some(name @ ("engine" | "engine_mut" | "exchange_mut" | "Engine" | "EngineKey")) = token.ident() {
                let text = format!("{name}: what a program needs of the engine is a function of the library");
                findings.push(Finding::new(&file.path, token.line, text));
            }
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    #[test]
    fn a_program_that_reaches_the_engine_is_found() {
        let found = |path: &str, text| reach_the_engine(&Tree { files: vec![File::new(path, text)] }).len();
        let text = "fn f() { supervisor.with(|engine| engine.poll(now)); }";
        assert_eq!(found("crates/cli/src/a.rs", text), 2);
        assert_eq!(found("crates/ringcatd/src/a.rs", "application.engine_mut().stop();"), 1);
        assert_eq!(found("crates/ringcatd/tests/a.rs", text), 0);
        assert_eq!(found("crates/cli/src/a.rs", "supervisor.clocks_locked() // as the engine says"), 0);
    }

    const PACKET: &str = "ringcat v0.1.0 (/r/crates/ringcat)\nringcat-link v0.1.0 (/r/crates/link)\nlibc v0.2.1\n\
                          ringcat-link v0.1.0 (/r/crates/link) (*)\n";

    #[test]
    fn crates_of_the_registry_and_of_the_repository_are_distinguished() {
        let (others, ours) = crates_in(PACKET);
        assert_eq!(others.into_iter().collect::<Vec<_>>(), ["libc"]);
        assert_eq!(ours.into_iter().collect::<Vec<_>>(), ["ringcat", "ringcat-link"]);
        assert!(not_in("packet", PACKET).is_empty());
    }

    #[test]
    fn a_crate_of_the_program_and_one_too_many_are_found() {
        let tree = format!("{PACKET}clap v4.0.0\n");
        let found: Vec<String> = not_in("packet", &tree).iter().map(ToString::to_string).collect();
        assert_eq!(found, ["crates/ringcat/Cargo.toml: features \"packet\": clap comes in"]);
        assert!(not_in("sim", &tree).is_empty());
        let many: String = (0..MAX_CRATES).map(|number| format!("crate-{number} v1.0.0\n")).collect();
        assert!(not_in("", &many).is_empty());
        assert_eq!(not_in("", &format!("{PACKET}{many}")).len(), 1);
    }

    #[test]
    fn an_example_or_a_command_that_names_the_engine_is_found() {
        let found = |path: &str, text| beside_the_library(&Tree { files: vec![File::new(path, text)] }).len();
        let engine = "use ringcat::Link;\nuse ringcat_engine::link::Link;";
        assert_eq!(found("crates/ringcat/examples/a.rs", "use ringcat::Link; // ringcat_engine"), 0);
        assert_eq!(found("crates/ringcat/examples/a.rs", engine), 1);
        assert_eq!(found("crates/cli/src/scan.rs", engine), 1);
        assert_eq!(found("crates/cli/src/scan.rs", "use ringcat_link::interface;"), 0);
        assert_eq!(found("crates/cli/src/bench/round_trip.rs", engine), 0);
        assert_eq!(found("crates/scenarios/src/lib.rs", engine), 0);
    }
}
