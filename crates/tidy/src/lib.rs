//! Checks of the source tree that the compiler does not perform; `tests/tree.rs` applies them to this repository.
//!
//! Input: the text of the tree ([`tree::Tree`]). Output: [`Finding`]s, each with its position and advice. One module
//! per rule:
//!
//! * [`files`]: length of files, forbidden names, the opening comment, marks of unfinished work;
//! * [`crates`]: allowed arrows between crates;
//! * [`dependencies`]: crates that an application gets with the library; examples and the program use only the library;
//! * [`interface`], [`handed_on`]: the list of public items of the library is kept in the repository;
//! * [`mailboxes`]: the library can do all that the engine's mailboxes can do;
//! * [`errors`], [`sources`]: public error types of the library implement `Error` and return the errors in them;
//! * [`non_exhaustive`]: public types may grow without a break of the interface, or are closed for a reason;
//! * [`modules`]: allowed arrows between the modules of the engine;
//! * [`publishing`]: manifests of crates that are published;
//! * [`safety`]: files that may contain `unsafe`;
//! * [`protocol`]: cited sections and statements of `docs/protocol` exist;
//! * [`decisions`]: cited decisions have notes;
//! * [`covers`]: names of tests, and ids in their `// covers:` lines;
//! * [`features`]: tests cover every row of `docs/capabilities.md`, `docs/FEATURES.md` is its short form;
//! * [`deny`]: licences, versions and sources of crates match `deny.toml`;
//! * [`evidence`]: the lists of tests in `docs/` are current;
//! * [`explorers`]: the list of random scenarios in `ci/explorers.toml` is complete;
//! * [`paths`], [`links`]: the paths in `docs/ARCHITECTURE.md` exist, and what pages link to;
//! * [`toolchain`]: the same minimum Rust version everywhere;
//! * [`circles`]: the files of a crate name each other without circles, over [`names`] and [`arrows`];
//! * [`limits`]: lines of functions and files, columns of lines, names of tests;
//! * [`words`]: words for people in place of devices.
//!
//! The last three count ([`rules`]); `known.toml` lists known violations and only shrinks ([`known`]). `cargo run -p
//! tidy` prints them, with the longest chain of files of each crate, `-- figures` figures and bars ([`bars`]), with the
//! lines of the engine by module and capability ([`engine_lines`]).
//! [`coverage`] lists the parts of the protocol without a test.
//!
//! [`tokens`] is a small Rust lexer for some of the modules, so that words in comments and strings are not read as
//! code; the newer modules use `syn`.
#![forbid(unsafe_code)]

pub mod arrows;
pub mod bars;
pub mod before_and_after;
pub mod circles;
pub mod coverage;
pub mod covers;
pub mod crates;
pub mod decisions;
pub mod deny;
pub mod dependencies;
pub mod engine_lines;
pub mod errors;
pub mod evidence;
pub mod explorers;
pub mod features;
pub mod files;
pub mod handed_on;
pub mod interface;
pub mod known;
pub mod limits;
pub mod links;
pub mod mailboxes;
pub mod modules;
pub mod names;
pub mod non_exhaustive;
pub mod paths;
pub mod protocol;
pub mod publishing;
pub mod reports;
pub mod rules;
pub mod safety;
pub mod sources;
pub mod tokens;
pub mod toolchain;
pub mod tree;
pub mod words;

use std::fmt;

/// A violation of a rule, or a warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// File, relative to the root of the repository, with `/` between its parts.
    pub file: String,
    /// Line, counted from 1; 0 is the whole file.
    pub line: usize,
    /// The violation and advice.
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
