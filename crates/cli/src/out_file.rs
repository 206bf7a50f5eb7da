//! The output file of a command: an existing file is replaced with `--overwrite` only.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

use clap::Args;

use crate::failure::Failure;

/// The option that permits it.
#[derive(Args, Clone, Copy, Debug)]
pub struct Overwrite {
    /// Replace the file if it exists
    #[arg(long, help_heading = "Output")]
    overwrite: bool,
}

impl Overwrite {
    /// Refuses a file that exists, before the command does its work.
    pub fn check(self, out: &Path) -> Result<(), Failure> {
        match !self.overwrite && Target::of(out) == Target::File {
            true => Err(Failure::new(format!("{} exists: name another file, or add --overwrite", out.display()))),
            false => Ok(()),
        }
    }

    /// Writes the file. A file that was created since then is not replaced either.
    pub fn write(self, out: &Path, bytes: &[u8]) -> Result<(), Failure> {
        let written = self.open(out).and_then(|mut file| file.write_all(bytes));
        written.map_err(|error| Failure::new(format!("{} cannot be written: {error}", out.display())))
    }

    fn open(self, out: &Path) -> io::Result<File> {
        let mut opening = OpenOptions::new();
        match Target::of(out) {
            // The earlier content of a redirected output stays.
            Target::Stream => opening.append(true),
            Target::Nothing | Target::File => {
                opening.write(true).truncate(true).create(true).create_new(!self.overwrite)
            }
        };
        opening.open(out)
    }
}

/// What is at the path of a file to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Target {
    Nothing,
    /// A regular file, or a link to a file that is not there.
    File,
    /// A device, a pipe, or an output of this process as in `/dev/stdout`.
    Stream,
}

impl Target {
    fn of(path: &Path) -> Target {
        let is_output = ["/dev/stdout", "/dev/stderr"].map(Path::new).contains(&path);
        match fs::metadata(path) {
            Ok(_) if is_output || ["/dev/fd", "/proc/self/fd"].iter().any(|of| path.starts_with(of)) => Target::Stream,
            Ok(there) if there.is_file() || there.is_dir() => Target::File,
            Ok(_) => Target::Stream,
            Err(_) if fs::symlink_metadata(path).is_ok() => Target::File,
            Err(_) => Target::Nothing,
        }
    }
}
