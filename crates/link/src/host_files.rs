//! Files and variables of a host, as far as they tell whether it suits a MainDevice. Nothing is changed.
//!
//! A host is a directory in which its files are; tests have one of their own. Files may hold anything and be of any
//! size: reading is limited, and bytes that are no text are replaced. What cannot be read is [`Unseen`] with its
//! reason, never a guess. Not for the cyclic path.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Longest file that is read as text: `/proc/interrupts` of a large machine has 2 MiB.
const LONGEST: usize = 4 << 20;
/// Longest file that is searched for a word: a program, a library.
const LONGEST_SEARCHED: usize = 128 << 20;
/// Most entries of a directory.
const MOST_ENTRIES: usize = 65_536;
/// Bytes that are searched at a time.
const PIECE: usize = 1 << 16;

/// Why something could not be seen.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unseen {
    /// There is no such file.
    Missing(String),
    /// This user may not enter a directory on the way to it.
    Unreachable(String),
    /// The file cannot be read, with the reason.
    Unreadable(String, String),
    /// The content is not what a kernel writes there.
    Strange(String),
}

impl Unseen {
    /// Why a file could not be seen, from the error of the system.
    pub fn of(path: &str, error: &io::Error) -> Unseen {
        match error.kind() {
            io::ErrorKind::NotFound => Unseen::Missing(path.to_owned()),
            _ => Unseen::Unreadable(path.to_owned(), error.to_string()),
        }
    }
}

impl fmt::Display for Unseen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Unseen::Missing(path) => write!(f, "{path} is not there"),
            Unseen::Unreachable(path) => write!(f, "{path} cannot be reached by this user"),
            Unseen::Unreadable(path, reason) => write!(f, "{path} cannot be read: {reason}"),
            Unseen::Strange(path) => write!(f, "{path} holds something unexpected"),
        }
    }
}

/// A host.
pub trait HostFiles {
    /// The directory that is its `/`.
    fn root(&self) -> &Path;

    /// An environment variable.
    fn variable(&self, name: &str) -> Option<String>;

    /// The path of something that is absolute on the host.
    fn place(&self, path: &str) -> PathBuf {
        self.root().join(path.trim_start_matches('/'))
    }

    /// The text of a file, without white space at its end.
    ///
    /// # Errors
    /// It cannot be seen, or is longer than 4 MiB.
    fn read(&self, path: &str) -> Result<String, Unseen> {
        let bytes = self.read_bytes(path)?;
        Ok(String::from_utf8_lossy(&bytes).trim_end().to_owned())
    }

    /// The bytes of a file.
    ///
    /// # Errors
    /// It cannot be seen, or is longer than 4 MiB.
    fn read_bytes(&self, path: &str) -> Result<Vec<u8>, Unseen> {
        let mut bytes = Vec::new();
        let read = self.open(path)?.take(LONGEST as u64 + 1).read_to_end(&mut bytes);
        read.map_err(|error| Unseen::of(path, &error))?;
        if bytes.len() > LONGEST {
            return Err(Unseen::Unreadable(path.to_owned(), "it is longer than 4 MiB".to_owned()));
        }
        Ok(bytes)
    }

    /// A file that is open. A pipe or a device could wait for ever.
    ///
    /// # Errors
    /// It cannot be seen, or is no file.
    fn open(&self, path: &str) -> Result<File, Unseen> {
        let place = self.place(path);
        let is_file = match fs::metadata(&place) {
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                return Err(Unseen::Unreachable(path.to_owned()));
            }
            metadata => metadata.map_err(|error| Unseen::of(path, &error))?.is_file(),
        };
        if !is_file {
            return Err(Unseen::Unreadable(path.to_owned(), "it is no file".to_owned()));
        }
        File::open(place).map_err(|error| Unseen::of(path, &error))
    }

    /// Names of the entries of a directory, in order.
    ///
    /// # Errors
    /// It cannot be seen.
    fn list(&self, path: &str) -> Result<Vec<String>, Unseen> {
        let entries = fs::read_dir(self.place(path)).map_err(|error| Unseen::of(path, &error))?;
        let name = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
        let mut names: Vec<String> = entries.flatten().take(MOST_ENTRIES).map(name).collect();
        names.sort();
        Ok(names)
    }

    /// Whether a file has these bytes in its first 128 MiB.
    ///
    /// # Errors
    /// It cannot be seen.
    fn holds(&self, path: &str, word: &[u8]) -> Result<bool, Unseen> {
        let mut file = self.open(path)?.take(LONGEST_SEARCHED as u64);
        let (mut window, mut piece) = (Vec::new(), vec![0; PIECE]);
        loop {
            let length = file.read(&mut piece).map_err(|error| Unseen::of(path, &error))?;
            if length == 0 {
                return Ok(false);
            }
            window.extend_from_slice(&piece[..length]);
            if window.windows(word.len()).any(|found| found == word) {
                return Ok(true);
            }
            // A word may begin in this piece and end in the next one.
            window.drain(..window.len().saturating_sub(word.len() - 1));
        }
    }

    /// The text of a file, or `None` where it is not there, which is a result too.
    ///
    /// # Errors
    /// It is there and cannot be seen.
    fn read_if_there(&self, path: &str) -> Result<Option<String>, Unseen> {
        match self.read(path) {
            Ok(text) => Ok(Some(text)),
            Err(Unseen::Missing(_)) => Ok(None),
            Err(unseen) => Err(unseen),
        }
    }
}

/// This host.
#[derive(Clone, Copy, Debug)]
pub struct ThisHost;

impl HostFiles for ThisHost {
    fn root(&self) -> &Path {
        Path::new("/")
    }

    fn variable(&self, name: &str) -> Option<String> {
        std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
    }
}
