//! Lines and columns of offsets in a text.

use super::error::Place;

/// The lines of a text.
pub(crate) struct Lines<'a> {
    text: &'a str,
    /// Offset of the first byte of each line.
    begins: Vec<usize>,
}

impl<'a> Lines<'a> {
    pub fn new(text: &'a str) -> Lines<'a> {
        let behind_breaks = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
        Lines { text, begins: std::iter::once(0).chain(behind_breaks).collect() }
    }

    /// The line of an offset, from 1.
    pub fn line(&self, at: usize) -> u32 {
        self.begins.partition_point(|begin| *begin <= at) as u32
    }

    pub fn place(&self, at: usize) -> Place {
        let line = self.line(at);
        let begin = self.begins.get((line as usize).saturating_sub(1)).copied().unwrap_or(0);
        // The column of a file without line breaks can be in the millions: characters are counted only in short lines.
        let before = self.text.get(begin..at).unwrap_or_default();
        let column = if before.len() > 4096 { before.len() } else { before.chars().count() };
        Place { line, column: (column + 1) as u32 }
    }
}
