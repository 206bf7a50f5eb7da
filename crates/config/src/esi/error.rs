//! Errors and notices of a file, with their position.

use std::collections::HashMap;
use std::fmt;

use crate::xml::{Place, XmlError, XmlProblem, packed};

/// Roots of files to which descriptions refer, and what they are.
pub(super) const COMPANIONS: [(&str, &str); 2] = [
    ("EtherCATDict", "an object dictionary that a device description refers to"),
    ("EtherCATDiag", "a list of diagnosis messages that a device description refers to"),
];
/// Different notices of a file; further ones are counted.
const MAX_NOTICES: usize = 200;

/// Why a device description cannot be read, or cannot be used as requested.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EsiError {
    /// The file, as the caller named it.
    pub file: Box<str>,
    /// Position, if the error has one.
    pub place: Option<Place>,
    /// `Type` of the device or module concerned; may be empty.
    pub device: Box<str>,
    /// The element, from the root; empty if no element is at fault.
    pub element: Box<str>,
    /// The error.
    pub problem: EsiProblem,
}

/// The kind of error.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EsiProblem {
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
        /// What it is.
        kind: String,
    },
    /// A required element or attribute is missing.
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
    /// Something is defined twice.
    Duplicate {
        /// The definition.
        what: String,
        /// Line of the first one.
        first_line: u32,
    },
    /// A file to which the description refers cannot be used.
    Referred {
        /// Why, with file and line.
        error: Box<EsiError>,
    },
    /// A rule of ETG.2000 or ETG.2010 does not hold, or a choice contradicts the file.
    Rule {
        /// What does not hold.
        reason: String,
    },
}

impl EsiError {
    /// Whether the file is no description itself, but belongs to one that refers to it: a dictionary, or texts of
    /// diagnosis messages.
    pub fn is_companion(&self) -> bool {
        matches!(&self.problem, EsiProblem::WrongFile { kind } if COMPANIONS.iter().any(|(_, it)| kind == it))
    }

    /// An error about the bytes or the XML of a file; files that are encrypted or packed are named as such.
    pub(crate) fn of_xml(file: &str, error: XmlError, bytes: &[u8]) -> EsiError {
        let problem = match error.problem {
            XmlProblem::TooMuch { what, limit } => EsiProblem::TooMuch { what, limit },
            XmlProblem::Encoding { reason } => EsiProblem::Encoding { reason },
            XmlProblem::Syntax { reason } => EsiProblem::Xml { reason },
            XmlProblem::NotXml => {
                let what = packed(bytes).map(|what| format!("an encrypted or packed file ({what})"));
                EsiProblem::WrongFile { kind: what.unwrap_or_else(|| "no XML file".to_owned()) }
            }
        };
        EsiError { place: error.place, ..EsiError::at_line(file, 0, "", problem) }
    }

    /// A rule that does not hold for a device, at a line of its file.
    pub(crate) fn rule(file: &str, line: u32, device: &str, reason: impl Into<String>) -> EsiError {
        EsiError::at_line(file, line, device, EsiProblem::Rule { reason: reason.into() })
    }

    /// An error about a file to which a device or module refers at a line of a file.
    pub(crate) fn referred(file: &str, line: u32, device: &str, error: EsiError) -> EsiError {
        EsiError::at_line(file, line, device, EsiProblem::Referred { error: Box::new(error) })
    }

    /// An error about a device or module at a line of a file; 0 is no line.
    pub fn at_line(file: &str, line: u32, device: &str, problem: EsiProblem) -> EsiError {
        let place = (line > 0).then_some(Place { line, column: 1 });
        EsiError { file: file.into(), place, device: device.into(), element: "".into(), problem }
    }
}

impl fmt::Display for EsiProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EsiProblem::TooMuch { what, limit } => {
                write!(f, "too much for a device description: more than {limit} {what}")
            }
            EsiProblem::Encoding { reason } => write!(f, "not readable as text: {reason}"),
            EsiProblem::Xml { reason } => write!(f, "not well-formed XML: {reason}"),
            EsiProblem::WrongFile { kind } => {
                write!(f, "this is {kind}; a device description (ESI) has the root EtherCATInfo")
            }
            EsiProblem::Missing { element } => write!(f, "{element} is missing"),
            EsiProblem::Value { expected, got } => write!(f, "expected {expected}, got {got}"),
            EsiProblem::Duplicate { what, first_line } => write!(f, "{what} is defined in line {first_line} already"),
            EsiProblem::Referred { error } => write!(f, "a file that it refers to: {error}"),
            EsiProblem::Rule { reason } => f.write_str(reason),
        }
    }
}

impl fmt::Display for EsiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(place) = self.place {
            write!(f, ":{}", place.line)?;
        }
        f.write_str(": ")?;
        if !self.device.is_empty() {
            write!(f, "device \"{}\": ", self.device)?;
        }
        if !self.element.is_empty() {
            write!(f, "{}: ", self.element)?;
        }
        self.problem.fmt(f)
    }
}

impl std::error::Error for EsiError {}

/// Something in a file that is not used, or is used in another way than written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// Line of the first occurrence.
    pub line: u32,
    /// What, and how it is used.
    pub text: String,
    /// Number of occurrences.
    pub times: usize,
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.text)?;
        if self.times > 1 { write!(f, " ({} times)", self.times) } else { Ok(()) }
    }
}

/// Collects notices; equal ones are combined.
#[derive(Debug, Default)]
pub(super) struct Notices {
    list: Vec<Notice>,
    known: HashMap<String, usize>,
    more: usize,
}

impl Notices {
    pub fn add(&mut self, line: u32, text: String) {
        if let Some(number) = self.known.get(&text) {
            self.list[*number].times += 1;
        } else if self.list.len() < MAX_NOTICES {
            self.known.insert(text.clone(), self.list.len());
            self.list.push(Notice { line, text, times: 1 });
        } else {
            self.more += 1;
        }
    }

    pub fn into_list(mut self) -> Vec<Notice> {
        if self.more > 0 {
            self.list.push(Notice { line: 1, text: "more notices, not listed".to_owned(), times: self.more });
        }
        self.list
    }
}
