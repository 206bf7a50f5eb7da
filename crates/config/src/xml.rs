//! XML files of configuration tools: bytes to text, limits, positions, and elements to text. [`crate::eni`] and
//! [`crate::esi`] read them.

mod document;
mod error;
mod guard;
mod limits;
mod lines;
mod protected;
mod quoted;
mod text;
mod writer;

pub use error::Place;
pub use limits::{MAX_ATTRIBUTES, MAX_BYTES, MAX_DEPTH, MAX_NODES, MAX_SUBDEVICES, MAX_UNKNOWN};

pub(crate) use document::parse;
pub(crate) use error::{XmlError, XmlProblem};
pub(crate) use guard::check;
pub(crate) use lines::Lines;
pub(crate) use protected::{is_cipher, is_signature, packed};
pub(crate) use quoted::shown;
pub(crate) use text::{decode, decode_utf8_first};
pub(crate) use writer::{Elements, one_line};
