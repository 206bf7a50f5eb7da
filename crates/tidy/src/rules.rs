//! Rules that count, with their names in `known.toml`.
//!
//! Input: a tree. Output: the [`Counts`] of each rule, for the test and for the report of the program `tidy`.

use crate::known::{Counts, Mended};
use crate::tree::Tree;
use crate::{Finding, circles, limits, words};

/// A rule that counts.
pub struct Rule {
    /// Its table in `known.toml`.
    pub name: &'static str,
    /// The counter.
    pub count: fn(&Tree) -> Result<Counts, Finding>,
    /// Consequence of an entry that is larger than the count.
    pub mended: Mended,
}

/// All rules.
pub const RULES: [Rule; 5] = [
    Rule { name: "circles", count: circles::sizes, mended: Mended::MustShrink },
    Rule { name: "long-functions", count: limits::long_functions, mended: Mended::MustShrink },
    Rule { name: "long-files", count: |tree| Ok(limits::long_files(tree)), mended: Mended::MustShrink },
    Rule { name: "wide-lines", count: |tree| Ok(limits::wide_lines(tree)), mended: Mended::MayShrink },
    Rule { name: "words", count: |tree| Ok(words::for_people(tree)), mended: Mended::MayShrink },
];
