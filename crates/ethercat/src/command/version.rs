//! `version`: which tool this is.

use crate::failure::Failure;
use crate::session::Session;
use crate::shape::Command;

/// The release of the IgH EtherCAT Master whose commands these are; scripts look at the beginning of the line.
const IGH: &str = "1.6.6";

/// The command.
pub const COMMAND: Command =
    Command { name: "version", summary: "Show version information.", forms: &[""], help: "", options: "", run };

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    writeln!(session, "IgH EtherCAT master {IGH} (RingCAT {})", env!("CARGO_PKG_VERSION"))
}
