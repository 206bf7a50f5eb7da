//! The program `ethercatctl`: see `ethercatctl --help`. Where it is installed it is `ringcatd` under this name.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ringcatd::service_control::main()
}
