//! What an application takes in with the library, feature by feature, and what its examples name.
//!
//! In goes what `cargo tree` says of a set of features, out comes a finding for every crate that does not belong there
//! and for more crates than the bar.

use std::collections::BTreeSet;

use crate::Finding;
use crate::tokens::{Token, tokens};
use crate::tree::Tree;

/// Features of `ringcat`, each by itself.
pub const FEATURE_SETS: [&str; 6] = ["", "packet", "sim", "eni", "gateway", "eoe"];

/// Sets that an application on network interfaces needs; they bring as little as possible.
const SMALL: [&str; 2] = ["", "packet"];
/// Crates from the registry in one of the small sets.
pub const MAX_CRATES: usize = 12;
/// Crates of the program, of the simulator, of files and of the gateway.
const NOT_IN_SMALL: [&str; 8] = ["clap", "mio", "roxmltree", "serde_json", "signal-hook", "smoltcp", "strsim", "toml"];

/// Where the examples of the library are.
const EXAMPLES: &str = "crates/ringcat/examples/";

/// Names of crates from the registry in what `cargo tree --prefix none` prints, and of ours.
pub fn crates_in(tree: &str) -> (BTreeSet<&str>, BTreeSet<&str>) {
    let lines = tree.lines().filter(|line| !line.trim().is_empty());
    let (ours, others): (Vec<&str>, Vec<&str>) = lines.partition(|line| line.contains("(/"));
    (others.into_iter().filter_map(first_word).collect(), ours.into_iter().filter_map(first_word).collect())
}

fn first_word(line: &str) -> Option<&str> {
    line.split(' ').next()
}

/// What is wrong with the crates of a set of features.
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

/// Examples that name another crate of this repository than the library: an application has `ringcat` alone.
pub fn examples_beside_the_library(tree: &Tree) -> Vec<Finding> {
    let is_foreign = |token: &Token| token.ident().is_some_and(|name| name.starts_with("ringcat_"));
    let files = tree.rust().filter(|file| file.path.starts_with(EXAMPLES));
    let of_file = |file: &crate::tree::File| -> Vec<Finding> {
        let found = tokens(&file.text).into_iter().filter(is_foreign);
        let text = |token: Token| format!("names {}: take it from ringcat", token.ident().unwrap_or_default());
        found.map(|token| Finding::new(&file.path, token.line, text(token))).collect()
    };
    files.flat_map(of_file).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    const PACKET: &str = "ringcat v0.1.0 (/r/crates/ringcat)\nringcat-link v0.1.0 (/r/crates/link)\nlibc v0.2.1\n\
                          ringcat-link v0.1.0 (/r/crates/link) (*)\n";

    #[test]
    fn crates_of_the_registry_are_told_from_ours() {
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
    fn an_example_that_names_the_engine_is_found() {
        let example = |text| Tree { files: vec![File::new("crates/ringcat/examples/a.rs", text)] };
        assert!(examples_beside_the_library(&example("use ringcat::Link; // ringcat_engine")).is_empty());
        assert_eq!(
            examples_beside_the_library(&example("use ringcat::Link;\nuse ringcat_engine::link::Link;")).len(),
            1
        );
    }
}
