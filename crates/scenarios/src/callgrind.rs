//! Counts instructions and calls of a program with valgrind's callgrind.
//!
//! In: a command. Out: the instructions it executed in user mode and how often each function was called. Files go into
//! a directory of their own, which is removed.

use std::collections::BTreeMap;
use std::env;
use std::fs;
use std::io::{self, Error, ErrorKind};
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// What a run of a program cost.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// Instructions in user mode.
    pub instructions: u64,
    /// Calls by name of the called function.
    pub calls: BTreeMap<String, u64>,
}

impl Profile {
    /// Reads a callgrind output file with names in full.
    pub fn parse(text: &str) -> Option<Profile> {
        let mut profile = Profile::default();
        let mut called = "";
        let mut totals = None;
        for line in text.lines() {
            if let Some(name) = line.strip_prefix("cfn=") {
                called = name;
            } else if let Some(rest) = line.strip_prefix("calls=") {
                let count: u64 = rest.split_whitespace().next()?.parse().ok()?;
                *profile.calls.entry(called.to_owned()).or_default() += count;
            } else if let Some(rest) = line.strip_prefix("totals:").or_else(|| line.strip_prefix("summary:")) {
                totals = rest.split_whitespace().next()?.parse().ok();
            }
        }
        profile.instructions = totals?;
        Some(profile)
    }

    /// Calls of all functions whose name is `wanted`.
    pub fn calls_of(&self, wanted: impl Fn(&str) -> bool) -> u64 {
        self.calls.iter().filter(|(name, _)| wanted(name)).map(|(_, count)| count).sum()
    }
}

/// Whether valgrind is installed.
pub fn is_installed() -> bool {
    let version = Command::new("valgrind").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    version.is_ok_and(|status| status.success())
}

/// Runs this program under callgrind with other arguments.
///
/// # Errors
/// Valgrind or the program fails, or the output cannot be read.
pub fn profile_self(arguments: &[String]) -> io::Result<Profile> {
    profile(&[], arguments)
}

/// As [`profile_self`], and counts within functions of this name alone; `*` stands for anything.
///
/// # Errors
/// As [`profile_self`].
pub fn profile_self_within(function: &str, arguments: &[String]) -> io::Result<Profile> {
    profile(&[format!("--toggle-collect={function}")], arguments)
}

fn profile(options: &[String], arguments: &[String]) -> io::Result<Profile> {
    let directory = Directory::new(&arguments.join("-"))?;
    let out = directory.0.join("callgrind.out");
    let status = Command::new("valgrind")
        .args(["--tool=callgrind", "--quiet", "--compress-strings=no"])
        .args(options)
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(env::current_exe()?)
        .args(arguments)
        .stdout(Stdio::null())
        .status()?;
    if !status.success() {
        return Err(Error::other(format!("valgrind of {arguments:?}: {status}")));
    }
    let text = fs::read_to_string(&out)?;
    Profile::parse(&text).ok_or_else(|| Error::new(ErrorKind::InvalidData, "callgrind's output has no totals"))
}

/// A directory that is removed in the end.
struct Directory(PathBuf);

impl Directory {
    fn new(name: &str) -> io::Result<Directory> {
        let path = env::temp_dir().join(format!("ringcat-callgrind-{}-{name}", std::process::id()));
        fs::create_dir_all(&path)?;
        Ok(Directory(path))
    }
}

impl Drop for Directory {
    fn drop(&mut self) {
        // What cannot be removed stays in the directory for temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_and_calls_are_found_in_an_output_file() {
        let text = "version: 1\nfn=main\n16 4\ncfn=memcpy\ncalls=12 0\n16 120\ncfn=free\ncalls=1 0\n2 3\ncfn=memcpy\n\
                    calls=3 0\n1 1\n\ntotals: 4711\n";
        let profile = Profile::parse(text).unwrap();
        assert_eq!(profile.instructions, 4711);
        assert_eq!(profile.calls_of(|name| name == "memcpy"), 15);
        assert_eq!(Profile::parse("version: 1\n"), None);
    }
}
