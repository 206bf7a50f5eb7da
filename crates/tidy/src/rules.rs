//! Rules that count, by their name in `known.toml`.
//!
//! In goes a tree, out come the [`Counts`] of each rule, for the test and for the report of the program `tidy`.

use crate::known::{Counts, Mended};
use crate::tree::Tree;
use crate::{Finding, circles, limits, words};

/// A rule that counts.
pub struct Rule {
    /// Its table in `known.toml`.
    pub name: &'static str,
    /// What it counts.
    pub count: fn(&Tree) -> Result<Counts, Finding>,
    /// What follows from an entry that is mended.
    pub mended: Mended,
}

/// All of them.
pub const RULES: [Rule; 5] = [
    Rule { name: "circles", count: circles::sizes, mended: Mended::MustShrink },
    Rule { name: "long-functions", count: limits::long_functions, mended: Mended::MustShrink },
    Rule { name: "long-files", count: |tree| Ok(limits::long_files(tree)), mended: Mended::MustShrink },
    Rule { name: "wide-lines", count: |tree| Ok(limits::wide_lines(tree)), mended: Mended::MayShrink },
    Rule { name: "words", count: |tree| Ok(words::for_people(tree)), mended: Mended::MayShrink },
];
