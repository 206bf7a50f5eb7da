//! What is wrong with a file, and where.

use std::fmt;

use super::kind::FileKind;

/// A place in a file, both from 1; columns count characters.
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

/// Why a file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EniError {
    /// Where, if it is about a place.
    pub place: Option<Place>,
    /// The element, from the root: `Config/Slave[2] "EL2008"/Info/PhysAddr`. Empty where no element is at fault.
    pub element: String,
    /// What.
    pub problem: Problem,
}

/// What is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    /// More than is read: what, how many there may be.
    TooMuch {
        /// What there is too much of.
        what: &'static str,
        /// How much is read.
        limit: usize,
    },
    /// The bytes are no text in the encoding that they say they have.
    Encoding {
        /// Why.
        reason: String,
    },
    /// No well-formed XML.
    Xml {
        /// What the XML reader says.
        reason: String,
    },
    /// Another kind of file.
    WrongFile {
        /// What it looks like.
        kind: FileKind,
    },
    /// An element that must be there is not.
    Missing {
        /// Its name.
        element: &'static str,
    },
    /// A value that is none.
    Value {
        /// What may stand here.
        expected: String,
        /// What stands there.
        got: String,
    },
    /// Two places of the file, or the file and what can be, contradict each other.
    Contradiction(Box<Contradiction>),
}

/// Two places of the file, or the file and what can be, that contradict each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contradiction {
    /// What about.
    pub what: String,
    /// What one place says, or what must be.
    pub expected: String,
    /// What the other one says.
    pub got: String,
    /// What to do about it; may be empty.
    pub hint: String,
}

impl EniError {
    /// An error about the whole file.
    pub(crate) fn of_file(problem: Problem) -> EniError {
        EniError { place: None, element: String::new(), problem }
    }

    /// An error at a place, without an element.
    pub(crate) fn at(place: Place, problem: Problem) -> EniError {
        EniError { place: Some(place), element: String::new(), problem }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::TooMuch { what, limit } => write!(f, "too much for an ENI: more than {limit} {what}"),
            Problem::Encoding { reason } => write!(f, "not readable as text: {reason}"),
            Problem::Xml { reason } => write!(f, "no well-formed XML: {reason}"),
            Problem::WrongFile { kind } => write!(f, "this is {kind}"),
            Problem::Missing { element } => write!(f, "<{element}> is missing"),
            Problem::Value { expected, got } => write!(f, "expected {expected}, got {got}"),
            Problem::Contradiction(contradiction) => {
                let Contradiction { what, expected, got, hint } = &**contradiction;
                write!(f, "{what}: expected {expected}, got {got}")?;
                if hint.is_empty() { Ok(()) } else { write!(f, " ({hint})") }
            }
        }
    }
}

impl fmt::Display for EniError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = self.place {
            write!(f, "{place}: ")?;
        }
        if !self.element.is_empty() {
            write!(f, "{}: ", self.element)?;
        }
        self.problem.fmt(f)
    }
}

impl std::error::Error for EniError {}
