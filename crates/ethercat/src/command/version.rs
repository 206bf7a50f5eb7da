//! `version`: which tool this is.

use crate::failure::Failure;
use crate::json;
use crate::json::texts::Version;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The release of the IgH EtherCAT Master whose commands these are; scripts look at the beginning of the line.
const IGH: &str = "1.6.6";

/// The command.
pub const COMMAND: Command = Command {
    name: "version",
    summary: "Show version information.",
    forms: &[""],
    help: "",
    options: "",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let version = Version { igh_version: IGH, ringcat_version: env!("CARGO_PKG_VERSION") };
    if session.arguments.json {
        return json::print(session, &version);
    }
    writeln!(session, "IgH EtherCAT master {} (RingCAT {})", version.igh_version, version.ringcat_version)
}
