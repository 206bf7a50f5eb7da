//! The minimum Rust version is the same in the workspace, the README, every crate and CI.
//!
//! Input: a tree. Output: findings. A version that no build has used is a guess, so `.ci/run` compares the compiler
//! with `rust-version`, and clippy's `incompatible_msrv` checks the use of the standard library.

use crate::Finding;
use crate::tree::Tree;

/// Files that contain the version.
const WORKSPACE: &str = "Cargo.toml";
const README: &str = "README.md";
/// The script that builds, which has to check it.
const CI: &str = ".ci/steps.sh";

/// Files that name another version, or none.
pub fn disagreements(tree: &Tree) -> Vec<Finding> {
    let Some(version) = tree.file(WORKSPACE).and_then(|file| version_of(&file.text)) else {
        return vec![Finding::new(WORKSPACE, 0, "[workspace.package] has no rust-version")];
    };
    let mut findings = Vec::new();
    let mut expect = |path: &str, text: &str, words: &str| {
        if !text.contains(words) {
            findings.push(Finding::new(path, 0, format!("expected `{words}`, as rust-version in {WORKSPACE} says")));
        }
    };
    let text = |path: &str| tree.file(path).map_or("", |file| file.text.as_str());
    expect(README, text(README), &format!("Rust {version} or newer"));
    expect(CI, text(CI), "rust-version");
    for file in &tree.files {
        let words = match file.path.strip_suffix("/Cargo.toml") {
            Some(directory) if directory.starts_with("crates/") => "rust-version.workspace = true".to_owned(),
            Some(_) => format!("rust-version = \"{version}\""),
            None => continue,
        };
        expect(&file.path, &file.text, &words);
    }
    findings
}

fn version_of(text: &str) -> Option<String> {
    let table: toml::Table = text.parse().ok()?;
    Some(table.get("workspace")?.get("package")?.get("rust-version")?.as_str()?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    fn tree(readme: &str, member: &str, proof: &str) -> Tree {
        let files = [
            (".ci/steps.sh", "rust-version"),
            ("Cargo.toml", "[workspace.package]\nrust-version = \"1.95\"\n"),
            ("README.md", readme),
            ("ci/proof/Cargo.toml", proof),
            ("crates/a/Cargo.toml", member),
        ];
        Tree { files: files.map(|(path, text)| File::new(path, text)).to_vec() }
    }

    #[test]
    fn every_place_names_the_version_of_the_workspace() {
        let (readme, member, proof) =
            ("Rust 1.95 or newer", "rust-version.workspace = true", "rust-version = \"1.95\"");
        assert_eq!(disagreements(&tree(readme, member, proof)), []);
        for (tree, place) in [
            (tree("Rust 1.90 or newer", member, proof), "README.md"),
            (tree(readme, "rust-version = \"1.95\"", proof), "crates/a/Cargo.toml"),
            (tree(readme, member, ""), "ci/proof/Cargo.toml"),
        ] {
            let findings = disagreements(&tree);
            assert!(findings.len() == 1 && findings[0].file == place, "{findings:?}");
        }
        assert_eq!(disagreements(&Tree::default())[0].file, "Cargo.toml");
    }
}
