//! Errors of a file before its content is interpreted.

use std::fmt;

/// A position in a file. Lines and columns start at 1; columns count characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column.
    pub column: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// Why bytes are not an XML file within the limits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct XmlError {
    /// Position, if the error has one.
    pub place: Option<Place>,
    /// The error.
    pub problem: XmlProblem,
}

/// The kind of error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum XmlProblem {
    /// More of something than `limit`.
    TooMuch { what: &'static str, limit: usize },
    /// The bytes are no text in the declared encoding.
    Encoding { reason: String },
    /// Not well-formed.
    Syntax { reason: String },
    /// No `<` at the beginning.
    NotXml,
}

impl XmlError {
    /// An error about the whole file.
    pub fn of_file(problem: XmlProblem) -> XmlError {
        XmlError { place: None, problem }
    }

    /// An error at a position.
    pub fn at(place: Place, problem: XmlProblem) -> XmlError {
        XmlError { place: Some(place), problem }
    }
}
