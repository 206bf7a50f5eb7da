//! Errors of a file, with their position.

use std::fmt;

use super::kind::FileKind;
use crate::xml::{Place, XmlError, XmlProblem};

/// Why a file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EniError {
    /// Position, if the error has one.
    pub place: Option<Place>,
    /// The element, from the root: `Config/Slave[2] "EL2008"/Info/PhysAddr`. Empty if no element is at fault.
    pub element: String,
    /// The error.
    pub problem: Problem,
}

/// The kind of error.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Problem {
    /// A limit is exceeded.
    TooMuch {
        /// The counted items.
        what: &'static str,
        /// The limit.
        limit: usize,
    },
    /// The bytes are no text in the declared encoding.
    Encoding {
        /// The reason.
        reason: String,
    },
    /// Not well-formed XML.
    Xml {
        /// The message of the XML reader.
        reason: String,
    },
    /// A file of another kind.
    WrongFile {
        /// The detected kind.
        kind: FileKind,
    },
    /// A required element is missing.
    Missing {
        /// Its name.
        element: &'static str,
    },
    /// An invalid value.
    Value {
        /// The valid values.
        expected: String,
        /// The value in the file.
        got: String,
    },
    /// Two parts of the file contradict each other, or the file contradicts what is possible.
    Contradiction(Box<Contradiction>),
}

/// A contradiction between two parts of the file, or between the file and what is possible.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contradiction {
    /// The setting.
    pub what: String,
    /// The value in one part of the file, or the required value.
    pub expected: String,
    /// The value in the other part.
    pub got: String,
    /// Advice; may be empty.
    pub hint: String,
}

impl EniError {
    /// An error about the whole file.
    pub(crate) fn of_file(problem: Problem) -> EniError {
        EniError { place: None, element: String::new(), problem }
    }

    /// An error at a position, without an element.
    pub(crate) fn at(place: Place, problem: Problem) -> EniError {
        EniError { place: Some(place), element: String::new(), problem }
    }

    /// An error about the bytes or the XML of a file; files that are not XML are named by their kind.
    pub(crate) fn of_xml(error: XmlError, bytes: &[u8]) -> EniError {
        let problem = match error.problem {
            XmlProblem::TooMuch { what, limit } => Problem::TooMuch { what, limit },
            XmlProblem::Encoding { reason } => Problem::Encoding { reason },
            XmlProblem::Syntax { reason } => Problem::Xml { reason },
            XmlProblem::NotXml => Problem::WrongFile { kind: FileKind::of_bytes(bytes) },
        };
        EniError { place: error.place, element: String::new(), problem }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::TooMuch { what, limit } => write!(f, "too much for an ENI: more than {limit} {what}"),
            Problem::Encoding { reason } => write!(f, "not readable as text: {reason}"),
            Problem::Xml { reason } => write!(f, "not well-formed XML: {reason}"),
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
