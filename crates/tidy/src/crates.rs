//! Allowed arrows between crates.
//!
//! Input: the manifests `crates/*/Cargo.toml`. Output: a finding for every dependency that `RULES` does not list.
//! Normal, build and development dependencies are treated equally: a test must not depend on crates that its crate must
//! not depend on.

use toml::{Table, Value};

use crate::Finding;
use crate::tree::{File, Tree};

/// Allowed dependencies of one crate.
struct CrateRule {
    /// Directory below `crates/`.
    directory: &'static str,
    /// Crates of this repository.
    internal: Internal,
    /// Crates from the registry, except in tests.
    external: External,
}

enum Internal {
    Only(&'static [&'static str]),
    Any,
}

enum External {
    Only(&'static [&'static str]),
    Any,
}

/// The map of `docs/ARCHITECTURE.md`; a new crate gets a line here and there.
const RULES: &[CrateRule] = &[
    CrateRule { directory: "wire", internal: Internal::Only(&[]), external: External::Only(&[]) },
    CrateRule {
        directory: "engine",
        internal: Internal::Only(&["ringcat-wire"]),
        external: External::Only(&["serde"]),
    },
    CrateRule {
        directory: "config",
        internal: Internal::Only(&["ringcat-engine", "ringcat-wire"]),
        external: External::Only(&["encoding_rs", "quick-xml", "roxmltree", "serde", "sha2", "toml"]),
    },
    CrateRule {
        directory: "sim",
        internal: Internal::Only(&["ringcat-wire"]),
        external: External::Only(&["serde", "smoltcp", "toml"]),
    },
    CrateRule {
        directory: "gateway",
        internal: Internal::Only(&["ringcat-engine", "ringcat-wire"]),
        external: External::Only(&["mio"]),
    },
    CrateRule {
        directory: "control",
        internal: Internal::Only(&["ringcat-engine", "ringcat-link"]),
        external: External::Only(&["ciborium", "serde"]),
    },
    CrateRule { directory: "link", internal: Internal::Only(&[]), external: External::Only(&["libc"]) },
    CrateRule {
        directory: "ringcat",
        // The crate itself: tests and examples enable all features.
        internal: Internal::Only(&[
            "ringcat",
            "ringcat-config",
            "ringcat-control",
            "ringcat-engine",
            "ringcat-gateway",
            "ringcat-link",
            "ringcat-sim",
            "ringcat-wire",
        ]),
        // Disabled unless an application enables its feature.
        external: External::Only(&["tracing"]),
    },
    CrateRule {
        directory: "ringcatd",
        // Its tests distinguish frames of both classes by the engine.
        internal: Internal::Only(&["ringcat", "ringcat-control", "ringcat-engine", "ringcat-link"]),
        external: External::Only(&["clap"]),
    },
    CrateRule {
        directory: "ethercat",
        // Its tests run it beside a daemon and an application.
        internal: Internal::Only(&[
            "ringcat",
            "ringcatd",
            "ringcat-control",
            "ringcat-engine",
            "ringcat-link",
            "json-keys",
            "ringcat-wire",
        ]),
        external: External::Only(&["serde"]),
    },
    CrateRule {
        directory: "ffi",
        // Its tests run programs beside a daemon.
        internal: Internal::Only(&["ringcat", "ringcatd"]),
        external: External::Only(&["libc"]),
    },
    CrateRule {
        directory: "cli",
        // Its tests run commands on the bus of a daemon.
        internal: Internal::Only(&["json-keys", "ringcat", "ringcat-engine", "ringcat-link", "ringcatd"]),
        external: External::Any,
    },
    CrateRule {
        directory: "keys",
        internal: Internal::Only(&[]),
        external: External::Only(&["schemars", "serde_json"]),
    },
    CrateRule { directory: "scenarios", internal: Internal::Any, external: External::Any },
    CrateRule {
        directory: "tidy",
        internal: Internal::Only(&[]),
        external: External::Only(&["proc-macro2", "serde_json", "syn", "toml"]),
    },
];

/// Tables of a manifest that list dependencies; the first two are part of the product.
const TABLES: [&str; 3] = ["dependencies", "build-dependencies", "dev-dependencies"];

/// Dependencies that are not allowed, and crates without a line in the table.
pub fn forbidden_arrows(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (directory, file) in manifests(tree) {
        match (RULES.iter().find(|rule| rule.directory == directory), file.text.parse::<Table>()) {
            (None, _) => findings.push(Finding::new(&file.path, 0, "no rule in crates/tidy/src/crates.rs: add it")),
            (_, Err(error)) => findings.push(Finding::new(&file.path, 0, format!("cannot be read: {error}"))),
            (Some(rule), Ok(manifest)) => check(rule, &file.path, &manifest, &internal_names(tree), &mut findings),
        }
    }
    findings
}

fn manifests(tree: &Tree) -> impl Iterator<Item = (&str, &File)> {
    tree.files.iter().filter_map(|file| {
        let directory = file.path.strip_prefix("crates/")?.strip_suffix("/Cargo.toml")?;
        (!directory.contains('/')).then_some((directory, file))
    })
}

fn internal_names(tree: &Tree) -> Vec<String> {
    let name = |file: &File| {
        let manifest = file.text.parse::<Table>().ok()?;
        Some(manifest.get("package")?.get("name")?.as_str()?.to_owned())
    };
    manifests(tree).filter_map(|(_, file)| name(file)).collect()
}

fn check(rule: &CrateRule, path: &str, manifest: &Table, internal: &[String], findings: &mut Vec<Finding>) {
    for (table, name) in dependencies(manifest) {
        let allowed = if internal.contains(&name) {
            match rule.internal {
                Internal::Only(names) => names.contains(&name.as_str()),
                Internal::Any => true,
            }
        } else {
            match rule.external {
                External::Only(names) => table == "dev-dependencies" || names.contains(&name.as_str()),
                External::Any => true,
            }
        };
        if !allowed {
            findings.push(Finding::new(path, 0, format!("must not depend on {name} ([{table}])")));
        }
    }
}

/// Table and name of every dependency, including target-specific and renamed ones.
fn dependencies(manifest: &Table) -> Vec<(&'static str, String)> {
    let targets = manifest.get("target").and_then(Value::as_table);
    let per_target = targets.into_iter().flat_map(|t| t.values()).filter_map(Value::as_table);
    let mut found = Vec::new();
    for section in std::iter::once(manifest).chain(per_target) {
        for table in TABLES {
            for (key, value) in section.get(table).and_then(Value::as_table).into_iter().flatten() {
                let name = value.get("package").and_then(Value::as_str).unwrap_or(key);
                found.push((table, name.to_owned()));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn findings(sim: &str) -> Vec<String> {
        let engine = "[package]\nname = \"ringcat-engine\"\n";
        let wire = "[package]\nname = \"ringcat-wire\"\n";
        let files = [("engine", engine), ("sim", sim), ("wire", wire)];
        let files = files.iter().map(|(name, text)| File::new(&format!("crates/{name}/Cargo.toml"), text)).collect();
        forbidden_arrows(&Tree { files }).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_simulator_may_know_the_codec_and_not_the_engine() {
        assert!(findings("[dependencies]\nringcat-wire.workspace = true\ntoml = \"1\"\n").is_empty());
        let engine = "crates/sim/Cargo.toml: must not depend on ringcat-engine ([dev-dependencies])";
        assert_eq!(findings("[dev-dependencies]\nringcat-engine.workspace = true\n"), [engine]);
    }

    #[test]
    fn renamed_and_target_dependencies_are_seen() {
        let renamed = "[target.'cfg(unix)'.dependencies]\nother = { package = \"ringcat-engine\", path = \"x\" }\n";
        assert_eq!(findings(renamed).len(), 1);
    }

    #[test]
    fn crates_from_the_registry_are_free_in_tests_only() {
        assert!(findings("[dev-dependencies]\nproptest = \"1\"\n").is_empty());
        assert_eq!(findings("[dependencies]\nrand = \"1\"\n").len(), 1);
    }

    #[test]
    fn a_crate_without_a_rule_is_found() {
        let tree = Tree { files: vec![File::new("crates/new/Cargo.toml", "")] };
        assert_eq!(forbidden_arrows(&tree).len(), 1);
    }
}
