//! Checks external crates against `deny.toml`: licences, one version of each, sources.
//!
//! Input: `deny.toml` and the output of `cargo metadata`. Output: findings. The file is in the format of cargo-deny, of
//! which this module implements `licenses.allow`, `bans.skip` and `sources.allow-registry`. It works offline; only
//! cargo-deny checks advisories.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;
use std::process::Command;

use serde_json::Value;
use toml::Table;

use crate::Finding;

/// The configuration file.
pub const PAGE: &str = "deny.toml";

/// A crate used by the workspace.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Package {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SPDX expression, or `/` between licences as in old manifests.
    pub licence: String,
    /// `registry+URL` or `git+URL`; empty for crates of this repository.
    pub source: String,
}

/// The crates used by the workspace at `root` on this platform, including tests.
pub fn packages(root: &Path) -> io::Result<Vec<Package>> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let arguments = ["metadata", "--format-version", "1", "--locked", "--offline", "--filter-platform"];
    let target = "x86_64-unknown-linux-gnu";
    let output = Command::new(cargo).args(arguments).arg(target).current_dir(root).output()?;
    if !output.status.success() {
        return Err(io::Error::other(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    let metadata: Value = serde_json::from_slice(&output.stdout)?;
    Ok(metadata["packages"].as_array().into_iter().flatten().map(package).collect())
}

fn package(value: &Value) -> Package {
    let text = |key: &str| value[key].as_str().unwrap_or_default().to_owned();
    Package { name: text("name"), version: text("version"), licence: text("license"), source: text("source") }
}

/// Packages that violate the text of `deny.toml`.
pub fn unwanted(wishes: &str, packages: &[Package]) -> Vec<Finding> {
    let table: Table = match wishes.parse() {
        Ok(table) => table,
        Err(error) => return vec![Finding::new(PAGE, 0, format!("cannot be read: {error}"))],
    };
    let licences = strings(&table, "licenses", "allow");
    let registries = strings(&table, "sources", "allow-registry");
    let skipped = skipped(&table);
    let mut findings = Vec::new();
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for package in packages {
        let Package { name, version, licence, source } = package;
        if !permitted(licence, &licences) {
            findings.push(Finding::new(PAGE, 0, format!("{name} {version} has the licence `{licence}`")));
        }
        let registry = source.split_once('+').map_or("", |(_, registry)| registry);
        if !source.is_empty() && !registries.contains(registry) {
            findings.push(Finding::new(PAGE, 0, format!("{name} {version} comes from `{source}`")));
        }
        if !skipped.contains(&format!("{name}@{version}")) {
            versions.entry(name).or_default().insert(version);
        }
    }
    for (name, versions) in versions.into_iter().filter(|(_, versions)| versions.len() > 1) {
        let versions: Vec<&str> = versions.into_iter().collect();
        let text = format!("{name} is there in versions {}: align them, or add one to `skip`", versions.join(", "));
        findings.push(Finding::new(PAGE, 0, text));
    }
    for gone in skipped.iter().filter(|skip| !packages.iter().any(|p| **skip == format!("{}@{}", p.name, p.version))) {
        findings.push(Finding::new(PAGE, 0, format!("skips {gone}, which is not used any more")));
    }
    findings
}

fn strings(table: &Table, section: &str, key: &str) -> BTreeSet<String> {
    let list = table.get(section).and_then(|section| section.get(key)).and_then(toml::Value::as_array);
    list.into_iter().flatten().filter_map(|value| value.as_str().map(str::to_owned)).collect()
}

fn skipped(table: &Table) -> BTreeSet<String> {
    let list = table.get("bans").and_then(|bans| bans.get("skip")).and_then(toml::Value::as_array);
    let name = |value: &toml::Value| value.get("crate").and_then(toml::Value::as_str).map(str::to_owned);
    list.into_iter().flatten().filter_map(name).collect()
}

/// Whether these licences satisfy an SPDX expression. `WITH` only adds permissions.
fn permitted(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut at = 0;
    alternatives(&words, &mut at, allowed) && at == words.len()
}

fn alternatives(words: &[&str], at: &mut usize, allowed: &BTreeSet<String>) -> bool {
    let mut met = requirements(words, at, allowed);
    while words.get(*at) == Some(&"OR") {
        *at += 1;
        met |= requirements(words, at, allowed);
    }
    met
}

fn requirements(words: &[&str], at: &mut usize, allowed: &BTreeSet<String>) -> bool {
    let mut met = one(words, at, allowed);
    while words.get(*at) == Some(&"AND") {
        *at += 1;
        met &= one(words, at, allowed);
    }
    met
}

fn one(words: &[&str], at: &mut usize, allowed: &BTreeSet<String>) -> bool {
    let Some(word) = words.get(*at) else { return false };
    *at += 1;
    if *word == "(" {
        let met = alternatives(words, at, allowed);
        *at += 1;
        return met;
    }
    if words.get(*at) == Some(&"WITH") {
        *at += 2;
    }
    allowed.contains(*word)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WISHES: &str = "[licenses]\nallow = [\"MIT\", \"Apache-2.0\"]\n[bans]\nskip = [{ crate = \"old@1.0.0\" }]\n\
                          [sources]\nallow-registry = [\"https://registry\"]\n";

    fn crate_of(name: &str, version: &str, licence: &str, source: &str) -> Package {
        let [name, version, licence, source] = [name, version, licence, source].map(str::to_owned);
        Package { name, version, licence, source }
    }

    #[test]
    fn licences_are_met_by_any_alternative_and_all_requirements() {
        let allowed = BTreeSet::from(["MIT".to_owned(), "Apache-2.0".to_owned()]);
        for good in ["MIT", "GPL-3.0 OR MIT", "Unlicense/MIT", "(MIT OR X) AND Apache-2.0", "MIT WITH some-exception"] {
            assert!(permitted(good, &allowed), "{good}");
        }
        for bad in ["", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR X) AND Y", "MIT MIT", "("] {
            assert!(!permitted(bad, &allowed), "{bad}");
        }
    }

    #[test]
    fn licences_sources_duplicates_and_stale_exceptions_are_found() {
        let old = crate_of("old", "1.0.0", "MIT", "registry+https://registry");
        let new = crate_of("old", "2.0.0", "MIT", "registry+https://registry");
        let own = crate_of("own", "0.1.0", "MIT", "");
        let good = [old, new.clone(), own];
        assert!(unwanted(WISHES, &good).is_empty());
        let with = |package: Package| unwanted(WISHES, &[&good[..], &[package]].concat()).len();
        assert_eq!(with(crate_of("a", "1.0.0", "GPL-3.0", "registry+https://registry")), 1);
        assert_eq!(with(crate_of("a", "1.0.0", "MIT", "git+https://elsewhere")), 1);
        assert_eq!(with(crate_of("old", "3.0.0", "MIT", "registry+https://registry")), 1);
        assert_eq!(unwanted(WISHES, &[new]).len(), 1);
        assert_eq!(unwanted("[licenses", &[]).len(), 1);
    }
}
