//! Manifests of crates that are published have what the registry requires, and one version.
//!
//! Input: a tree. Output: findings; `ci/package` builds the packages themselves.

use toml::{Table, Value};

use crate::Finding;
use crate::tree::Tree;

/// The manifest of the workspace.
const WORKSPACE: &str = "Cargo.toml";
/// Fields that a published crate has.
const FIELDS: [&str; 5] = ["description", "license", "readme", "keywords", "categories"];
/// Limits of the registry: entries in a list, characters of a keyword.
const MOST: usize = 5;
const KEYWORD: usize = 20;

/// Crates that are neither private nor fit to be published.
pub fn faults(tree: &Tree) -> Vec<Finding> {
    let Some(workspace) = table(tree, WORKSPACE) else {
        return vec![Finding::new(WORKSPACE, 0, "cannot be read")];
    };
    let part = |key: &str| workspace.get("workspace").and_then(|it| it.get(key)).and_then(Value::as_table);
    let version = part("package").and_then(|it| it.get("version")).and_then(Value::as_str).unwrap_or_default();
    let mut findings = Vec::new();
    for (name, dependency) in part("dependencies").into_iter().flatten() {
        let given = dependency.get("version").and_then(Value::as_str).unwrap_or_default();
        if dependency.get("path").is_some() && given != version {
            findings.push(Finding::new(WORKSPACE, 0, format!("{name} has version \"{given}\", not \"{version}\"")));
        }
    }
    let manifests = tree.files.iter().map(|file| file.path.as_str());
    for path in manifests.filter(|path| path.starts_with("crates/") && path.ends_with("/Cargo.toml")) {
        let manifest = table(tree, path).unwrap_or_default();
        let package = manifest.get("package").and_then(Value::as_table).cloned().unwrap_or_default();
        findings.extend(of_package(tree, path, &package).into_iter().map(|text| Finding::new(path, 0, text)));
    }
    findings
}

fn table(tree: &Tree, path: &str) -> Option<Table> {
    tree.file(path)?.text.parse().ok()
}

/// What is wrong with the table `package` of a crate.
fn of_package(tree: &Tree, path: &str, package: &Table) -> Vec<String> {
    if package.get("publish").and_then(Value::as_bool) == Some(false) {
        return Vec::new();
    }
    let missing = FIELDS.iter().filter(|field| !package.contains_key(**field));
    let mut faults: Vec<String> = missing.map(|field| format!("`publish = false`, or `{field}`")).collect();
    let readme = path.replace("Cargo.toml", "README.md");
    if tree.file(&readme).is_none() {
        faults.push(format!("{readme} is missing"));
    }
    let list = |key: &str| package.get(key).and_then(Value::as_array).cloned().unwrap_or_default();
    if list("keywords").len() > MOST || list("categories").len() > MOST {
        faults.push(format!("the registry takes {MOST} keywords and {MOST} categories"));
    }
    let is_keyword = |word: &Value| word.as_str().is_some_and(|word| (1..=KEYWORD).contains(&word.len()));
    if !list("keywords").iter().all(is_keyword) {
        faults.push(format!("a keyword has 1 to {KEYWORD} characters"));
    }
    let settings = package.get("metadata").and_then(|it| it.get("docs")?.get("rs"));
    let has_targets = settings.and_then(|it| it.get("targets")).and_then(Value::as_array).is_some();
    if tree.file(&path.replace("Cargo.toml", "src/lib.rs")).is_some() && !has_targets {
        faults.push("a library has `targets` in `[package.metadata.docs.rs]`".to_owned());
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    const FIT: &str = "[package]\ndescription = \"d\"\nlicense.workspace = true\nreadme = \"README.md\"\n\
                       keywords = [\"k\"]\ncategories = [\"c\"]\n";

    fn findings(version: &str, manifest: &str) -> usize {
        let workspace = format!(
            "[workspace.package]\nversion = \"1.0.0\"\n[workspace.dependencies]\n\
             a = {{ path = \"crates/a\", {version} }}\n"
        );
        let files = [
            (WORKSPACE, workspace.as_str()),
            ("crates/a/Cargo.toml", manifest),
            ("crates/a/README.md", "# a\n"),
            ("crates/b/Cargo.toml", "[package]\npublish = false\n"),
        ];
        faults(&Tree { files: files.map(|(path, text)| File::new(path, text)).to_vec() }).len()
    }

    #[test]
    fn a_crate_is_private_or_has_what_the_registry_requires() {
        let good = "version = \"1.0.0\"";
        assert_eq!(findings(good, FIT), 0);
        assert_eq!(findings("version = \"0.9.0\"", FIT), 1);
        assert_eq!(findings("features = []", FIT), 1);
        assert_eq!(findings(good, &FIT.replace("description", "name")), 1);
        assert_eq!(findings(good, &FIT.replace("[\"k\"]", "[\"a\", \"b\", \"c\", \"d\", \"e\", \"f\"]")), 1);
        assert_eq!(findings(good, &FIT.replace("\"k\"", "\"a-keyword-that-is-too-long\"")), 1);
    }

    #[test]
    fn a_published_library_says_for_which_targets_it_is_documented() {
        let documented = format!("{FIT}[package.metadata.docs.rs]\ntargets = [\"x86_64-unknown-linux-gnu\"]\n");
        for (manifest, faults) in [(FIT, 1), (documented.as_str(), 0)] {
            let files = [("crates/a/README.md", "# a\n"), ("crates/a/src/lib.rs", "//! A.\n")];
            let tree = Tree { files: files.map(|(path, text)| File::new(path, text)).to_vec() };
            let package: Table = manifest.parse().expect("it is TOML");
            let package = package["package"].as_table().expect("a table");
            assert_eq!(of_package(&tree, "crates/a/Cargo.toml", package).len(), faults, "{manifest}");
        }
    }
}
