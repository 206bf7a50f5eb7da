//! What the doctor reads: files, directories, network interfaces, environment variables. Nothing is changed.
//!
//! A machine is its files ([`HostFiles`]), and what its kernel answers; tests have one of their own. A check that is
//! not possible is [`Unseen`] with its reason, never a guess.

use std::path::Path;

pub use ringcat_link::host_files::{HostFiles, ThisHost, Unseen};
use ringcat_link::interface::ethtool::{self, Settings};
use ringcat_link::interface::{self, Interface, Uses};
use ringcat_link::may_write;

/// A machine.
pub trait Inspect: HostFiles {
    /// An interface with this name.
    fn interface(&self, name: &str) -> Option<Interface>;

    /// Other users of an interface.
    fn uses(&self, name: &str) -> Uses;

    /// What a driver is set to.
    fn settings(&self, name: &str) -> Settings;

    /// Whether this process may write to a file.
    fn may_write(&self, path: &str) -> Result<bool, Unseen> {
        may_write(&self.place(path)).map_err(|error| Unseen::of(path, &error))
    }
}

/// This machine.
#[derive(Clone, Copy, Debug)]
pub struct Machine;

impl HostFiles for Machine {
    fn root(&self) -> &Path {
        ThisHost.root()
    }

    fn variable(&self, name: &str) -> Option<String> {
        ThisHost.variable(name)
    }
}

impl Inspect for Machine {
    fn interface(&self, name: &str) -> Option<Interface> {
        interface::list().into_iter().find(|interface| interface.name == name)
    }

    fn uses(&self, name: &str) -> Uses {
        interface::uses(name)
    }

    fn settings(&self, name: &str) -> Settings {
        ethtool::settings(name)
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
