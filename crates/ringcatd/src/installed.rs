//! Another MainDevice that is installed on this host, reported at the start of the daemon.
//!
//! `ringcat doctor` finds the same, with what corrects it.

use ringcat_link::foreign::{self, Modules, Used};
use ringcat_link::host_files::{HostFiles, ThisHost, Unseen};
use ringcat_link::operator::Priority;

use crate::log::print;

/// Reports each other MainDevice, in a thread: files are searched meanwhile. The daemon goes on.
pub fn report() {
    let body = || lines(&ThisHost).into_iter().for_each(|line| print(Priority::Warning, format!("ringcatd: {line}")));
    // Without a thread there is no report: `ringcat doctor` has it.
    let _ = std::thread::Builder::new().name("installed".into()).spawn(body);
}

/// A line for each; what cannot be seen has none.
fn lines(host: &impl HostFiles) -> Vec<String> {
    let modules = match foreign::modules(host) {
        Ok(Modules::Foreign(names)) if !names.is_empty() => Some(format!(
            "kernel modules of another MainDevice are loaded: {}; it may take the interface, and send beside ringcatd",
            names.join(" ")
        )),
        _ => None,
    };
    let programs = [
        (foreign::program(host).map(|used| used.unwrap_or(Used::Nothing)), "the command ethercat controls it"),
        (foreign::header(host), "programs in C are compiled for it"),
        (foreign::library(host), "programs in C start with it"),
    ];
    modules.into_iter().chain(programs.into_iter().filter_map(|(used, effect)| line(used, effect))).collect()
}

fn line(used: Result<Used, Unseen>, effect: &str) -> Option<String> {
    match used {
        Ok(Used::ForeignBefore(first, ours)) => {
            Some(format!("{first} is not RingCAT's and comes before {ours}: {effect}"))
        }
        Ok(Used::Foreign(first)) => Some(format!("{first} is not RingCAT's: {effect}")),
        _ => None,
    }
}
