//! Another MainDevice that is installed: kernel modules, and its program, header and library before those of RingCAT.
//!
//! `ringcat_link::foreign` looks for them, for the daemon too.

use ringcat_link::foreign::{self, Modules, Used};

use super::finding::{Finding, Topic};
use super::inspect::{Inspect, Unseen};

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

/// All checks for another MainDevice.
pub fn checks(machine: &dyn Inspect) -> Vec<Finding> {
    vec![
        MODULES.of(modules(machine)),
        match foreign::program(machine).transpose() {
            None => PROGRAM.unknown("PATH names no directory"),
            Some(used) => assess(PROGRAM, used, "PATH"),
        },
        assess(HEADER, foreign::header(machine), "CPATH"),
        assess(LIBRARY, foreign::library(machine), "LD_LIBRARY_PATH"),
    ]
}

fn modules(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let loaded = match foreign::modules(machine)? {
        Modules::Foreign(names) if names.is_empty() => return Ok(MODULES.good("none of another MainDevice is loaded")),
        Modules::Foreign(names) => names,
        _ => return Ok(MODULES.good("this kernel has none")),
    };
    let mend = ["sudo systemctl disable --now ethercat", "or unload them: sudo modprobe -r NAME"];
    Ok(MODULES.bad(format!("loaded: {}", loaded.join(" ")), &mend))
}

/// What is used, and what puts RingCAT's in its place.
fn assess(topic: Topic, used: Result<Used, Unseen>, variable: &str) -> Finding {
    match used {
        Err(unseen) => topic.unknown(unseen),
        Ok(Used::Ours(path)) => topic.good(format!("{path} is RingCAT's")),
        Ok(Used::ForeignBefore(first, ours)) => {
            let mend = [
                "remove the package that the first one belongs to (dpkg -S), or",
                &format!("put RingCAT's directory first in {variable}"),
            ];
            topic.bad(format!("{first} is not RingCAT's, and comes before {ours}"), &mend)
        }
        Ok(Used::Foreign(first)) => {
            topic.minor(format!("{first} is not RingCAT's"), &["remove the package that it belongs to (dpkg -S)"])
        }
        Ok(_) => topic.good("none is installed"),
    }
}
