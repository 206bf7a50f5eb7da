//! `cargo run -p tidy`: findings of the rules in this repository, with the longest chain of files of each crate.
//!
//! `cargo run -p tidy -- coverage` lists the parts of `docs/protocol` without a test, `-- tests` writes the lists of
//! tests of each feature and each part of the protocol, `-- figures` prints figures of the tree with their bars;
//! `-- figures DIRECTORY` counts the files of another commit there.
//! `cargo run -p tidy -- shrink` lowers `known.toml` to the current counts; it refuses if a count has grown.

use std::fmt::Display;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use tidy::circles::{Graph, crates};
use tidy::known::{Counts, Known, PATH, file_of};
use tidy::rules::RULES;
use tidy::tree::Tree;
use tidy::{Finding, arrows, bars, coverage, dependencies, engine_lines, evidence, words};

fn main() -> ExitCode {
    let done = match std::env::args().nth(1).as_deref() {
        None => run(false),
        Some("shrink") => run(true),
        Some("coverage") => tree().map(|tree| put(coverage::report(&tree))),
        Some("figures") => match std::env::args().nth(2) {
            None => tree().and_then(|tree| figures(&tree)),
            Some(directory) => counted(Path::new(&directory)),
        },
        Some("tests") => tree().and_then(|tree| write_evidence(&tree)),
        Some(_) => {
            eprintln!("usage: cargo run -p tidy [-- coverage | figures [DIRECTORY] | tests | shrink]");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(finding) => {
            eprintln!("{finding}");
            ExitCode::FAILURE
        }
    }
}

fn tree() -> Result<Tree, Finding> {
    Tree::of_this_repository().map_err(|error| Finding::new(".", 0, error.to_string()))
}

fn write_evidence(tree: &Tree) -> Result<(), Finding> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for (path, text) in evidence::pages(tree) {
        std::fs::write(root.join(path), text).map_err(|error| Finding::new(path, 0, error.to_string()))?;
        put(format_args!("wrote {path}\n"));
    }
    Ok(())
}

/// Figures of the tree; what is missed is printed and fails nothing, since the rules' tests do.
fn figures(tree: &Tree) -> Result<(), Finding> {
    let packet = dependencies::cargo_tree("packet").map_err(|error| Finding::new("Cargo.toml", 0, error))?;
    let (text, holds) = bars::text(&bars::rows(tree, &packet)?);
    put(text);
    put(engine_lines::text(tree));
    put(format_args!("        before: commit {}\n", bars::COMMIT_BEFORE));
    for allowed in words::ALLOWED {
        put(format_args!("        allowed words in {}: {}\n", allowed.file, allowed.reason));
    }
    for (what, bar, command) in bars::ELSEWHERE {
        put(format_args!("        {what}: {command} (bar: {bar})\n"));
    }
    put(format_args!("{}\n", if holds { "all bars of the tree hold" } else { "bars are missed" }));
    Ok(())
}

/// What can be counted in the files of any commit.
fn counted(directory: &Path) -> Result<(), Finding> {
    let name = directory.display().to_string();
    let tree = Tree::read(directory).map_err(|error| Finding::new(&name, 0, error.to_string()))?;
    put(format_args!("{}{}", bars::Counted::of(&tree)?, engine_lines::Lines::of(&tree)));
    Ok(())
}

fn run(shrink: bool) -> Result<(), Finding> {
    let tree = tree()?;
    if !shrink {
        chains(&tree)?;
    }
    let known = Known::read(&tree)?;
    let mut found: Vec<(&str, Counts)> = Vec::new();
    for rule in &RULES {
        let counts = (rule.count)(&tree)?;
        let (places, sum) = (counts.len(), counts.values().sum::<usize>());
        put(format_args!("{}: {places} places, {sum} in all, {} known\n", rule.name, known.total(rule.name)));
        if shrink && tree.file(PATH).is_some() && sum > known.total(rule.name) {
            return Err(Finding::new(PATH, 0, format!("{} has grown: correct it", rule.name)));
        }
        found.push((rule.name, counts));
    }
    if shrink {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("known.toml");
        std::fs::write(path, file_of(&found)).map_err(|error| Finding::new(PATH, 0, error.to_string()))?;
    }
    Ok(())
}

fn chains(tree: &Tree) -> Result<(), Finding> {
    for name in crates(tree) {
        let graph = Graph::new(&arrows::of_crate(tree, &name)?);
        let chain = graph.longest_chain();
        put(format_args!("{name}: longest chain of {} files\n", chain.len()));
        let below = format!("crates/{name}/src/");
        let names: Vec<&str> = chain.iter().map(|file| file.trim_start_matches(&below)).collect();
        put(format_args!("    {}\n", names.join(" > ")));
        for circle in graph.circles() {
            put(format_args!("    circle of {}: {}\n", circle.len(), circle.join(", ")));
        }
    }
    Ok(())
}

/// Prints a text. Its reader may have left: `cargo run -p tidy -- figures | head`.
fn put(text: impl Display) {
    let _ = std::io::stdout().write_all(text.to_string().as_bytes());
}
