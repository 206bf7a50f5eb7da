//! Checks of the source tree that the compiler does not make; `tests/tree.rs` runs them over this repository.
//!
//! In goes the text of the tree ([`tree::Tree`]), out come [`Finding`]s, each with the place and what to do about it.
//! One module per rule:
//!
//! * [`files`]: length of files, forbidden names, the opening comment, marks of unfinished work;
//! * [`crates`]: allowed arrows between crates;
//! * [`dependencies`]: what an application takes in with the library; examples and the program use it alone;
//! * [`interface`]: the list of public items of the library is kept in the repository;
//! * [`modules`]: allowed arrows between the modules of the engine;
//! * [`publishing`]: manifests of crates that are published;
//! * [`safety`]: where `unsafe` may be written;
//! * [`protocol`]: sections and statements of `docs/protocol` that are cited exist;
//! * [`covers`]: names of tests, and what their `// covers:` lines name;
//! * [`features`]: every row of `docs/FEATURES.md` is covered by tests;
//! * [`deny`]: licences, versions and sources of crates are as `deny.toml` wants them;
//! * [`evidence`]: the lists of tests in `docs/` are current;
//! * [`explorers`]: the list of random scenarios in `ci/explorers.toml` is complete;
//! * [`paths`]: the places that `docs/ARCHITECTURE.md` names exist;
//! * [`toolchain`]: one minimum Rust version in all places that name it;
//! * [`circles`]: the files of a crate name each other without circles, over [`names`] and [`arrows`];
//! * [`limits`]: lines of functions and files, columns of lines, names of tests;
//! * [`words`]: words for people, used for devices.
//!
//! The last three count ([`rules`]); what is not mended yet is in `known.toml`, which only shrinks ([`known`]).
//! `cargo run -p tidy` prints it, with the longest chain of files of each crate, `-- figures` the bars of issue 15
//! ([`bars`]). [`coverage`] lists what of the protocol no test covers.
//!
//! [`tokens`] is the little Rust lexer under some of them, so that words in comments and strings are not taken for
//! code; the younger ones read with `syn`.
#![forbid(unsafe_code)]

pub mod arrows;
pub mod bars;
pub mod circles;
pub mod coverage;
pub mod covers;
pub mod crates;
pub mod deny;
pub mod dependencies;
pub mod evidence;
pub mod explorers;
pub mod features;
pub mod files;
pub mod interface;
pub mod known;
pub mod limits;
pub mod modules;
pub mod names;
pub mod paths;
pub mod protocol;
pub mod publishing;
pub mod rules;
pub mod safety;
pub mod tokens;
pub mod toolchain;
pub mod tree;
pub mod words;

use std::fmt;

/// Something that breaks a rule, or is about to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// File, relative to the root of the repository, with `/` between its parts.
    pub file: String,
    /// Line, counted from 1; 0 is the whole file.
    pub line: usize,
    /// What is wrong and what to do.
    pub text: String,
}

impl Finding {
    /// A finding at a line of a file.
    pub fn new(file: &str, line: usize, text: impl Into<String>) -> Finding {
        Finding { file: file.to_owned(), line, text: text.into() }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Finding { file, line, text } = self;
        if *line == 0 { write!(f, "{file}: {text}") } else { write!(f, "{file}:{line}: {text}") }
    }
}
