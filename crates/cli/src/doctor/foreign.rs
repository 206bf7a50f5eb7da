//! Another MainDevice that is installed: kernel modules, and its program, header and library before those of RingCAT.
//!
//! Nothing that is found is run. What belongs to RingCAT has its name in it.

use super::finding::{Finding, Topic};
use super::inspect::{self, Inspect, Unseen};
use super::loader_cache;

const MODULES: Topic = Topic {
    id: "kernel-modules",
    why: "a MainDevice inside the kernel may take the interface, and sends beside this one",
};
const PROGRAM: Topic =
    Topic { id: "ethercat-program", why: "the command ethercat then controls another MainDevice than ringcatd" };
const HEADER: Topic =
    Topic { id: "ecrt-header", why: "programs in C are then compiled for another version of the interface" };
const LIBRARY: Topic =
    Topic { id: "ethercat-library", why: "programs in C then start with the library of another MainDevice" };

/// Modules of other MainDevices by their beginnings; `ec_sys` belongs to Linux.
const MODULE_NAMES: [&str; 3] = ["ec_", "atemsys", "rtnet"];
const NO_MODULE: &str = "ec_sys";
/// Most directories of a search path.
const MOST: usize = 256;

/// All checks for another MainDevice.
pub fn checks(machine: &dyn Inspect) -> Vec<Finding> {
    let path = directories(machine, &["PATH"], &[]);
    let includes = directories(machine, &["CPATH", "C_INCLUDE_PATH"], &["/usr/local/include", "/usr/include"]);
    vec![
        MODULES.of(modules(machine)),
        match path.is_empty() {
            true => PROGRAM.unknown("PATH names no directory"),
            false => assess(machine, PROGRAM, &files(&path, "ethercat"), b"RingCAT", "PATH"),
        },
        assess(machine, HEADER, &files(&includes, "ecrt.h"), b"RingCAT", "CPATH"),
        library(machine),
    ]
}

fn modules(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let Some(table) = inspect::read_if_there(machine, "/proc/modules")? else {
        // With /proc, but without this file, a kernel has no modules.
        machine.read("/proc/sys/kernel/osrelease")?;
        return Ok(MODULES.good("this kernel has none"));
    };
    let names = table.lines().filter_map(|line| line.split_whitespace().next());
    let is_foreign = |name: &&str| *name != NO_MODULE && MODULE_NAMES.iter().any(|begin| name.starts_with(begin));
    let foreign: Vec<&str> = names.filter(is_foreign).collect();
    if foreign.is_empty() {
        return Ok(MODULES.good("none of another MainDevice is loaded"));
    }
    let mend = ["sudo systemctl disable --now ethercat", "or unload them: sudo modprobe -r NAME"];
    Ok(MODULES.bad(format!("loaded: {}", foreign.join(" ")), &mend))
}

/// Absolute directories of variables, then further ones.
fn directories(machine: &dyn Inspect, variables: &[&str], more: &[&str]) -> Vec<String> {
    let values: Vec<String> = variables.iter().filter_map(|name| machine.variable(name)).collect();
    let listed = values.iter().flat_map(|value| value.split(':')).chain(more.iter().copied());
    let mut all: Vec<String> = Vec::new();
    for directory in listed.filter(|directory| directory.starts_with('/')).take(MOST) {
        let directory = directory.trim_end_matches('/').to_owned();
        if !all.contains(&directory) {
            all.push(directory);
        }
    }
    all
}

fn files(directories: &[String], name: &str) -> Vec<String> {
    directories.iter().map(|directory| format!("{directory}/{name}")).collect()
}

/// The libraries that a program may be started with, in the loader's order.
fn library(machine: &dyn Inspect) -> Finding {
    let mut places = files(&directories(machine, &["LD_LIBRARY_PATH"], &[]), loader_cache::NAME);
    match machine.read_bytes(loader_cache::PATH) {
        Ok(cache) => places.extend(loader_cache::places(&cache)),
        Err(Unseen::Missing(_)) => {}
        Err(unseen) => return LIBRARY.unknown(unseen),
    }
    places.extend(files(&["/lib".to_owned(), "/usr/lib".to_owned()], loader_cache::NAME));
    assess(machine, LIBRARY, &places, b"ringcat", "LD_LIBRARY_PATH")
}

/// Of the files that are there, the first one is used. RingCAT's have this word in them.
fn assess(machine: &dyn Inspect, topic: Topic, paths: &[String], word: &[u8], variable: &str) -> Finding {
    let mut found: Vec<(&String, bool)> = Vec::new();
    for path in paths {
        match machine.holds(path, word) {
            Ok(is_ours) => found.push((path, is_ours)),
            // Where this user cannot get to, shells, compilers and loaders of this user go on too.
            Err(Unseen::Missing(_) | Unseen::Unreachable(_)) => {}
            Err(unseen) => return topic.unknown(unseen),
        }
    }
    let ours = found.iter().find(|(_, is_ours)| *is_ours).map(|(path, _)| *path);
    match (found.first(), ours) {
        (None, _) => topic.good("none is installed"),
        (Some((first, true)), _) => topic.good(format!("{first} is RingCAT's")),
        (Some((first, false)), Some(ours)) => {
            let mend = [
                "remove the package that the first one belongs to (dpkg -S), or",
                &format!("put RingCAT's directory first in {variable}"),
            ];
            topic.bad(format!("{first} is not RingCAT's, and comes before {ours}"), &mend)
        }
        (Some((first, false)), None) => {
            topic.minor(format!("{first} is not RingCAT's"), &["remove the package that it belongs to (dpkg -S)"])
        }
    }
}
