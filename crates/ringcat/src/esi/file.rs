//! A description from a file, with the files to which it refers.

use std::cell::RefCell;
use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ringcat_config::eni::MAX_BYTES;
use ringcat_config::esi::{Esi, EsiError, References, read_with};

use crate::regular_file::read_at_most;

/// Why a description cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub enum EsiFailure {
    /// The file cannot be read.
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// Its content is not valid.
    Esi(Box<EsiError>),
}

impl fmt::Display for EsiFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EsiFailure::Read { path, error } => write!(f, "{}: cannot be read: {error}", path.display()),
            EsiFailure::Esi(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for EsiFailure {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            EsiFailure::Read { error, .. } => Some(error),
            EsiFailure::Esi(error) => Some(&**error),
        }
    }
}

/// Reads a file with its modules and dictionaries.
///
/// # Errors
/// [`EsiFailure`]: a file cannot be read, or its content is wrong; the error names file, line and device.
pub fn load(path: &Path) -> Result<Esi, EsiFailure> {
    load_noting(path).0
}

/// The same, with the paths of the files to which it refers, also of those that are not there.
pub(super) fn load_noting(path: &Path) -> (Result<Esi, EsiFailure>, Vec<PathBuf>) {
    let folder = Folder { path: path.parent().unwrap_or(Path::new("")), opened: RefCell::default() };
    let name = path.display().to_string();
    let bytes = bytes_of(path).map_err(|error| EsiFailure::Read { path: path.to_owned(), error });
    let read = |bytes: Vec<u8>| read_with(&name, &bytes, &folder).map_err(|error| EsiFailure::Esi(Box::new(error)));
    (bytes.and_then(read), folder.opened.into_inner())
}

/// Reads at most one byte more than the limit.
pub(super) fn bytes_of(path: &Path) -> io::Result<Vec<u8>> {
    read_at_most(path, MAX_BYTES as u64 + 1)
}

/// The folder of a description. File names are compared case-insensitively.
struct Folder<'a> {
    path: &'a Path,
    /// What was opened, or is not there.
    opened: RefCell<Vec<PathBuf>>,
}

impl References for Folder<'_> {
    fn open(&self, path: &str) -> Option<Vec<u8>> {
        let mut at = Some(self.path.to_owned());
        for part in path.split('/') {
            at = at.and_then(|at| Some(at.join(part)).filter(|exact| exact.exists()).or_else(|| named(&at, part)));
        }
        self.opened.borrow_mut().push(at.clone().unwrap_or_else(|| self.path.join(path)));
        bytes_of(&at?).ok()
    }
}

/// The entry of a folder with this name, case-insensitive.
fn named(folder: &Path, name: &str) -> Option<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = fs::read_dir(folder).ok()?.filter_map(Result::ok);
    let is_it = |entry: &fs::DirEntry| entry.file_name().to_string_lossy().to_lowercase() == name.to_lowercase();
    entries.into_iter().find(is_it).map(|entry| entry.path())
}
