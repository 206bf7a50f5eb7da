//! Counts instructions and calls of a program with valgrind's callgrind.
//!
//! In: a command. Out: the instructions it executed in user mode and how often each function was called. Files go into
//! a directory of their own, which is removed.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::env;
use std::fs;
use std::io::{self, Error, ErrorKind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Cycles that a part of a profile has, where it has parts: the work of each 64th cycle comes twice.
pub const BATCH: u64 = 128;

/// Cost of a run of a program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// Instructions in user mode.
    pub instructions: u64,
    /// The same of each part, if the program was profiled in parts.
    pub parts: Vec<u64>,
    /// System calls by function. Those of other threads count for the function that ran last.
    pub system_calls: BTreeMap<String, u64>,
    /// Calls by name of the called function, also those outside of the counted function.
    pub calls: BTreeMap<String, u64>,
    /// Executions of the first instruction of each counted function.
    pub entries: BTreeMap<String, u64>,
    /// Instructions by source file and function, without called functions. Inlined code counts for its own file.
    pub own: BTreeMap<(String, String), u64>,
}

impl Profile {
    /// Reads a callgrind output file with names in full.
    pub fn parse(text: &str) -> Option<Profile> {
        let mut profile = Profile::default();
        let (mut called, mut file, mut function) = ("", "", "");
        let mut totals: Option<u64> = None;
        let mut is_of_call = false;
        // Lowest address of each function, and its executions.
        let mut firsts: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
        for line in text.lines() {
            if let Some(name) = line.strip_prefix("cfn=") {
                called = name;
            } else if let Some(name) = ["fl=", "fi=", "fe="].iter().find_map(|prefix| line.strip_prefix(prefix)) {
                file = name;
            } else if let Some(name) = line.strip_prefix("fn=") {
                function = name;
            } else if let Some(rest) = line.strip_prefix("calls=") {
                let count: u64 = rest.split_whitespace().next()?.parse().ok()?;
                *profile.calls.entry(called.to_owned()).or_default() += count;
                // The next line is the inclusive cost of the call.
                is_of_call = true;
            } else if let Some(rest) = line.strip_prefix("0x") {
                // Address, line of the source, instructions, system calls.
                let mut words = rest.split_whitespace();
                let address = words.next().and_then(|address| u64::from_str_radix(address, 16).ok())?;
                let count: u64 = words.nth(1)?.parse().ok()?;
                let system_calls: u64 = words.next().map_or(Some(0), |count| count.parse().ok())?;
                if !std::mem::take(&mut is_of_call) {
                    *profile.system_calls.entry(function.to_owned()).or_default() += system_calls;
                    *profile.own.entry((file.to_owned(), function.to_owned())).or_default() += count;
                    let first = firsts.entry(function).or_insert((address, 0));
                    match address.cmp(&first.0) {
                        Ordering::Less => *first = (address, count),
                        Ordering::Equal => first.1 += count,
                        Ordering::Greater => {}
                    }
                }
            } else if let Some(rest) = line.strip_prefix("totals:") {
                let part: u64 = rest.split_whitespace().next()?.parse().ok()?;
                totals = Some(totals.unwrap_or_default() + part);
                profile.parts.push(part);
            }
        }
        profile.instructions = totals?;
        profile.entries = firsts.into_iter().map(|(function, (_, count))| (function.to_owned(), count)).collect();
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
    profile(Command::new("valgrind"), &[], &env::current_exe()?, arguments)
}

/// As [`profile_self`], but counts only within functions of this name; `*` matches any text.
///
/// # Errors
/// As [`profile_self`].
pub fn profile_self_within(function: &str, arguments: &[String]) -> io::Result<Profile> {
    profile_program_within(Command::new("valgrind"), &[function], None, &env::current_exe()?, arguments)
}

/// As [`profile_self_within`], of any program, within several functions that do not call each other, and with a command
/// that runs valgrind elsewhere. With `part` a part ends at each end of this function.
///
/// # Errors
/// As [`profile_self`].
pub fn profile_program_within(
    valgrind: Command,
    functions: &[&str],
    part: Option<&str>,
    program: &Path,
    arguments: &[String],
) -> io::Result<Profile> {
    let mut options: Vec<String> = functions.iter().map(|function| format!("--toggle-collect={function}")).collect();
    if let Some(part) = part {
        options.extend([format!("--dump-after={part}"), "--combine-dumps=yes".to_owned()]);
    }
    profile(valgrind, &options, program, arguments)
}

fn profile(mut valgrind: Command, options: &[String], program: &Path, arguments: &[String]) -> io::Result<Profile> {
    let directory = Directory::new(&arguments.join("-").replace('/', "-"))?;
    let out = directory.0.join("callgrind.out");
    let status = valgrind
        .args(["--tool=callgrind", "--quiet", "--compress-strings=no", "--compress-pos=no", "--dump-instr=yes"])
        .arg("--collect-systime=yes")
        .args(options)
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .status()?;
    if !status.success() {
        return Err(Error::other(format!("valgrind of {arguments:?}: {status}")));
    }
    let text = fs::read_to_string(&out)?;
    Profile::parse(&text).ok_or_else(|| Error::new(ErrorKind::InvalidData, "callgrind's output has no totals"))
}

/// A directory that is removed on drop.
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
        // On failure it stays in the directory for temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn totals_and_calls_are_found_in_an_output_file() {
        let text = "version: 1\nfn=main\n0x10 16 4 2 300\ncfn=memcpy\ncalls=12 0x80 0\n0x14 16 120\n0x18 17 2\n\
                    fi=other.rs\n0x10 3 1\ncfn=free\ncalls=1 0x90 0\n0x20 2 3\ncfn=memcpy\ncalls=3 0x80 0\n0x24 1 1\n\n\
                    totals: 4711 3 1200\n";
        let profile = Profile::parse(text).unwrap();
        assert_eq!((profile.instructions, profile.system_calls["main"]), (4711, 2));
        assert_eq!(profile.calls_of(|name| name == "memcpy"), 15);
        let own = [("", 6), ("other.rs", 1)].map(|(file, count)| ((file.to_owned(), "main".to_owned()), count));
        assert_eq!(profile.own, BTreeMap::from(own));
        assert_eq!(profile.entries, BTreeMap::from([("main".to_owned(), 5)]), "its lowest address is 0x10");
        assert_eq!(Profile::parse("version: 1\n"), None);
    }
}
