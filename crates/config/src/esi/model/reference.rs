//! A reference of a description.

/// A reference to another file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reference {
    /// Line in the file.
    pub line: u32,
    /// The path as written.
    pub path: String,
}
