//! A file that a command makes: what exists is replaced with `--overwrite` only.

use std::fs::{self, OpenOptions};
use std::io::Write;
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
        match !self.overwrite && fs::symlink_metadata(out).is_ok() {
            true => Err(Failure::new(format!("{} exists: name another file, or add --overwrite", out.display()))),
            false => Ok(()),
        }
    }

    /// Writes the file. One that has come since is not replaced either.
    pub fn write(self, out: &Path, bytes: &[u8]) -> Result<(), Failure> {
        let mut opening = OpenOptions::new();
        let opening = opening.write(true).truncate(true).create(true).create_new(!self.overwrite);
        let written = opening.open(out).and_then(|mut file| file.write_all(bytes));
        written.map_err(|error| Failure::new(format!("{} cannot be written: {error}", out.display())))
    }
}
