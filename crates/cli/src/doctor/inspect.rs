//! What the doctor reads: files, directories, network interfaces, environment variables. Nothing is changed.
//!
//! A machine is a directory in which its files are, and what its kernel answers; tests have one of their own. Files may
//! hold anything and be of any size: reading is limited, and bytes that are no text are replaced. A check that is not
//! possible is [`Unseen`] with its reason, never a guess.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use ringcat_link::interface::ethtool::{self, Settings};
use ringcat_link::interface::{self, Interface, Uses};
use ringcat_link::may_write;

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

/// A machine.
pub trait Inspect {
    /// The directory that is its `/`.
    fn root(&self) -> &Path;

    /// An interface with this name.
    fn interface(&self, name: &str) -> Option<Interface>;

    /// Other users of an interface.
    fn uses(&self, name: &str) -> Uses;

    /// What a driver is set to.
    fn settings(&self, name: &str) -> Settings;

    /// An environment variable.
    fn variable(&self, name: &str) -> Option<String>;

    /// The path of something that is absolute on the machine.
    fn place(&self, path: &str) -> PathBuf {
        self.root().join(path.trim_start_matches('/'))
    }

    /// The text of a file, without white space at its end.
    fn read(&self, path: &str) -> Result<String, Unseen> {
        let bytes = self.read_bytes(path)?;
        Ok(String::from_utf8_lossy(&bytes).trim_end().to_owned())
    }

    /// The bytes of a file.
    fn read_bytes(&self, path: &str) -> Result<Vec<u8>, Unseen> {
        let mut bytes = Vec::new();
        let read = self.open(path)?.take(LONGEST as u64 + 1).read_to_end(&mut bytes);
        read.map_err(|error| unseen(path, &error))?;
        if bytes.len() > LONGEST {
            return Err(Unseen::Unreadable(path.to_owned(), "it is longer than 4 MiB".to_owned()));
        }
        Ok(bytes)
    }

    /// A file that is open. A pipe or a device could wait for ever.
    fn open(&self, path: &str) -> Result<File, Unseen> {
        let place = self.place(path);
        let is_file = match fs::metadata(&place) {
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                return Err(Unseen::Unreachable(path.to_owned()));
            }
            metadata => metadata.map_err(|error| unseen(path, &error))?.is_file(),
        };
        if !is_file {
            return Err(Unseen::Unreadable(path.to_owned(), "it is no file".to_owned()));
        }
        File::open(place).map_err(|error| unseen(path, &error))
    }

    /// Names of the entries of a directory, in order.
    fn list(&self, path: &str) -> Result<Vec<String>, Unseen> {
        let entries = fs::read_dir(self.place(path)).map_err(|error| unseen(path, &error))?;
        let name = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
        let mut names: Vec<String> = entries.flatten().take(MOST_ENTRIES).map(name).collect();
        names.sort();
        Ok(names)
    }

    /// Whether a file has these bytes in it.
    fn holds(&self, path: &str, word: &[u8]) -> Result<bool, Unseen> {
        let mut file = self.open(path)?.take(LONGEST_SEARCHED as u64);
        let (mut window, mut piece) = (Vec::new(), vec![0; PIECE]);
        loop {
            let length = file.read(&mut piece).map_err(|error| unseen(path, &error))?;
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

    /// Whether this process may write to a file.
    fn may_write(&self, path: &str) -> Result<bool, Unseen> {
        may_write(&self.place(path)).map_err(|error| unseen(path, &error))
    }
}

fn unseen(path: &str, error: &io::Error) -> Unseen {
    match error.kind() {
        io::ErrorKind::NotFound => Unseen::Missing(path.to_owned()),
        _ => Unseen::Unreadable(path.to_owned(), error.to_string()),
    }
}

/// This machine.
#[derive(Clone, Copy, Debug)]
pub struct Machine;

impl Inspect for Machine {
    fn root(&self) -> &Path {
        Path::new("/")
    }

    fn interface(&self, name: &str) -> Option<Interface> {
        interface::list().into_iter().find(|interface| interface.name == name)
    }

    fn uses(&self, name: &str) -> Uses {
        interface::uses(name)
    }

    fn settings(&self, name: &str) -> Settings {
        ethtool::settings(name)
    }

    fn variable(&self, name: &str) -> Option<String> {
        std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
    }
}

/// The text of a file, or `None` where it is not there, which is a result too.
pub fn read_if_there(machine: &dyn Inspect, path: &str) -> Result<Option<String>, Unseen> {
    match machine.read(path) {
        Ok(text) => Ok(Some(text)),
        Err(Unseen::Missing(_)) => Ok(None),
        Err(unseen) => Err(unseen),
    }
}

/// A file that holds one number.
pub fn number(machine: &dyn Inspect, path: &str) -> Result<i64, Unseen> {
    machine.read(path)?.parse().map_err(|_| Unseen::Strange(path.to_owned()))
}

/// The first of these processes that runs, by the names that the kernel keeps (15 characters).
pub fn running(machine: &dyn Inspect, names: &[&str]) -> Result<Option<String>, Unseen> {
    // Where processes of others are hidden, the first one is too.
    machine.read("/proc/1/comm")?;
    let processes = machine.list("/proc")?.into_iter().filter(|name| name.bytes().all(|byte| byte.is_ascii_digit()));
    // A process may end meanwhile.
    let mut all = processes.filter_map(|process| machine.read(&format!("/proc/{process}/comm")).ok());
    Ok(all.find(|name| names.contains(&name.as_str())))
}
