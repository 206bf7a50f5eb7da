//! Another MainDevice that is installed on a host: kernel modules, and its program, header and library before those of
//! RingCAT.
//!
//! In: a host ([`HostFiles`]). Out: what is there. Nothing that is found is run. What belongs to RingCAT has its name
//! in it.

mod loader_cache;

use crate::host_files::{HostFiles, Unseen};

/// Modules of other MainDevices by their beginnings; `ec_sys` belongs to Linux.
const MODULE_NAMES: [&str; 3] = ["ec_", "atemsys", "rtnet"];
const NO_MODULE: &str = "ec_sys";
/// Most directories of a search path.
const MOST: usize = 256;

/// Kernel modules.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Modules {
    /// The kernel has no modules.
    NoneAtAll,
    /// Those of other MainDevices that are loaded, by name.
    Foreign(Vec<String>),
}

/// What a host uses where a program, a header or a library is searched for.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Used {
    /// There is none.
    Nothing,
    /// That of RingCAT.
    Ours(String),
    /// The first path, which is not RingCAT's, although RingCAT's is at the other one.
    ForeignBefore(String, String),
    /// This path, which is not RingCAT's; there is none of RingCAT.
    Foreign(String),
}

/// Kernel modules of other MainDevices that are loaded.
///
/// # Errors
/// The list of modules cannot be seen.
pub fn modules(host: &(impl HostFiles + ?Sized)) -> Result<Modules, Unseen> {
    let Some(table) = host.read_if_there("/proc/modules")? else {
        // With /proc, but without this file, a kernel has no modules.
        host.read("/proc/sys/kernel/osrelease")?;
        return Ok(Modules::NoneAtAll);
    };
    let names = table.lines().filter_map(|line| line.split_whitespace().next());
    let is_foreign = |name: &&str| *name != NO_MODULE && MODULE_NAMES.iter().any(|begin| name.starts_with(begin));
    Ok(Modules::Foreign(names.filter(is_foreign).map(str::to_owned).collect()))
}

/// The program `ethercat` that a shell runs; `None` without a search path.
///
/// # Errors
/// A file cannot be seen.
pub fn program(host: &(impl HostFiles + ?Sized)) -> Result<Option<Used>, Unseen> {
    let path = directories(host, &["PATH"], &[]);
    if path.is_empty() { Ok(None) } else { used(host, &files(&path, "ethercat"), b"RingCAT").map(Some) }
}

/// The header `ecrt.h` that a compiler takes.
///
/// # Errors
/// A file cannot be seen.
pub fn header(host: &(impl HostFiles + ?Sized)) -> Result<Used, Unseen> {
    let places = directories(host, &["CPATH", "C_INCLUDE_PATH"], &["/usr/local/include", "/usr/include"]);
    used(host, &files(&places, "ecrt.h"), b"RingCAT")
}

/// The library that programs in C are started with, in the loader's order.
///
/// # Errors
/// A file cannot be seen.
pub fn library(host: &(impl HostFiles + ?Sized)) -> Result<Used, Unseen> {
    let mut places = files(&directories(host, &["LD_LIBRARY_PATH"], &[]), loader_cache::NAME);
    match host.read_bytes(loader_cache::PATH) {
        Ok(cache) => places.extend(loader_cache::places(&cache)),
        Err(Unseen::Missing(_)) => {}
        Err(unseen) => return Err(unseen),
    }
    places.extend(files(&["/lib".to_owned(), "/usr/lib".to_owned()], loader_cache::NAME));
    used(host, &places, b"ringcat")
}

/// Absolute directories of variables, then further ones.
fn directories(host: &(impl HostFiles + ?Sized), variables: &[&str], more: &[&str]) -> Vec<String> {
    let values: Vec<String> = variables.iter().filter_map(|name| host.variable(name)).collect();
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

/// Of the files that are there, the first one is used. RingCAT's have this word in them.
fn used(host: &(impl HostFiles + ?Sized), paths: &[String], word: &[u8]) -> Result<Used, Unseen> {
    let mut first = None;
    for path in paths {
        match (host.holds(path, word), first.take()) {
            (Ok(true), None) => return Ok(Used::Ours(path.clone())),
            (Ok(true), Some(first)) => return Ok(Used::ForeignBefore(first, path.clone())),
            (Ok(false), before) => first = before.or_else(|| Some(path.clone())),
            // Where this user cannot get to, shells, compilers and loaders of this user go on too.
            (Err(Unseen::Missing(_) | Unseen::Unreachable(_)), before) => first = before,
            (Err(unseen), _) => return Err(unseen),
        }
    }
    Ok(first.map_or(Used::Nothing, Used::Foreign))
}

#[cfg(test)]
mod tests;
