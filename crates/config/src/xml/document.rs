//! From text to a tree of elements.

use roxmltree::{Document, Error, ParsingOptions};

use super::error::{Place, XmlError, XmlProblem};
use super::limits::MAX_NODES;
use super::lines::Lines;

/// Parses a text that [`super::check`] accepted. No document type definition is read, so no entity is expanded.
pub(crate) fn parse(text: &str) -> Result<Document<'_>, XmlError> {
    let options = ParsingOptions { allow_dtd: false, nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| not_xml(text, &error))
}

fn not_xml(text: &str, error: &Error) -> XmlError {
    if !text.trim_start().starts_with('<') {
        return XmlError::of_file(XmlProblem::NotXml);
    }
    if matches!(error, Error::NodesLimitReached) {
        return XmlError::of_file(XmlProblem::TooMuch { what: "XML nodes", limit: MAX_NODES as usize });
    }
    if matches!(error, Error::UnclosedRootNode | Error::UnexpectedEndOfStream) {
        let reason = "the file is truncated: an element has no end; copy or export the file again".to_owned();
        return XmlError::at(Lines::new(text).place(text.len()), XmlProblem::Syntax { reason });
    }
    let at = error.pos();
    let mut reason = match error {
        Error::DtdDetected => super::guard::NO_DOCUMENT_TYPE.to_owned(),
        other => other.to_string(),
    };
    // The message already contains the position at its beginning.
    if let Some(begin) = reason.rfind(" at ") {
        reason.truncate(begin);
    }
    XmlError::at(Place { line: at.row, column: at.col }, XmlProblem::Syntax { reason })
}
