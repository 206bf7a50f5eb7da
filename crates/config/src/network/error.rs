//! Errors of network files: file, line, key, and what was expected.

use std::fmt;

/// Maximum number of bytes of a network file. A thousand SubDevices take less than 2 MB; one byte of text can take a
/// hundred bytes of memory.
pub const MAX_NETWORK_BYTES: usize = 8 << 20;

/// An error in a network file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NetworkError {
    /// The file, as the caller named it.
    pub file: String,
    /// Line, from 1; `None` for an error of the whole file.
    pub line: Option<usize>,
    /// The key, from the root: `subdevice[3].sync_manager[0].number`. Empty for an error of the whole file.
    pub key: String,
    /// Name of the SubDevice concerned; empty if there is none.
    pub subdevice: String,
    /// Expected and actual value.
    pub message: String,
}

impl NetworkError {
    /// The error of a file of `got` bytes, which is longer than [`MAX_NETWORK_BYTES`].
    pub fn too_long(file: &str, got: u64) -> NetworkError {
        NetworkError {
            file: file.to_owned(),
            line: None,
            key: String::new(),
            subdevice: String::new(),
            message: format!("expected at most {MAX_NETWORK_BYTES} bytes, got {got}"),
        }
    }
}

impl fmt::Display for NetworkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        f.write_str(": ")?;
        if !self.subdevice.is_empty() {
            write!(f, "SubDevice \"{}\": ", self.subdevice.escape_debug())?;
        }
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for NetworkError {}

/// A value that does not fit, by the path of its key.
#[derive(Debug)]
pub(super) struct Fault {
    /// The key.
    pub(super) path: Vec<Step>,
    /// Expected and actual value.
    pub(super) message: String,
}

/// Whether a part of a file is valid.
pub(super) type Checked = Result<(), Fault>;

/// A fault at a path.
pub(super) fn fault<const N: usize>(path: [Step; N], message: impl Into<String>) -> Checked {
    Err(Fault { path: path.into(), message: message.into() })
}

/// A step to a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// A key of a table.
    Key(String),
    /// An element of an array, from 0.
    Index(usize),
}

impl From<&str> for Step {
    fn from(key: &str) -> Step {
        Step::Key(key.to_owned())
    }
}

impl From<usize> for Step {
    fn from(index: usize) -> Step {
        Step::Index(index)
    }
}

/// A path as text.
pub(super) fn path_text(path: &[Step]) -> String {
    let mut text = String::new();
    for step in path {
        match step {
            Step::Key(key) if text.is_empty() => text.push_str(&short(key)),
            Step::Key(key) => {
                text.push('.');
                text.push_str(&short(key));
            }
            Step::Index(index) => text.push_str(&format!("[{index}]")),
        }
    }
    text
}

/// A name of the file as a message shows it.
pub(super) fn short(name: &str) -> String {
    /// Characters that are shown.
    const SHOWN: usize = 80;
    let mut text: String = name.chars().take(SHOWN).collect();
    if name.chars().nth(SHOWN).is_some() {
        text.push_str("...");
    }
    text
}
