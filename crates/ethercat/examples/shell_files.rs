//! Writes completion scripts and manual pages into a directory, for packages:
//! `cargo run -p ringcat-ethercat --example shell_files -- DIR`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn write(directory: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(directory.join("man8"))?;
    for (name, page) in ethercat::manual::pages() {
        std::fs::write(directory.join("man8").join(name), page)?;
    }
    std::fs::write(directory.join("ethercat.bash"), ethercat::completion::bash())?;
    std::fs::write(directory.join("_ethercat"), ethercat::completion::zsh())?;
    std::fs::write(directory.join("ethercat.fish"), ethercat::completion::fish())
}

fn main() -> ExitCode {
    let Some(directory) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: shell_files DIR");
        return ExitCode::FAILURE;
    };
    match write(&directory) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", directory.display());
            ExitCode::FAILURE
        }
    }
}
