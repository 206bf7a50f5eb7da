//! `record`: the last frames of a bus in a file, without a fault. Not a command of the original tool.

use ringcat_control::tool::{ToolAnswer, ToolQuery};

use crate::failure::{Failure, unexpected};
use crate::json;
use crate::json::ring::Record;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "record",
    summary: "Write the frames of the last seconds to a file.",
    forms: &[""],
    help: "The daemon, or the application that drives the bus, writes the frames that it
has kept as a file for Wireshark, as at a fault, with those of the next 0.2 s.
Prints the path of the file, on the host of the daemon. Frames are kept with
RINGCAT_DEBUG_RING=\"yes\" in the configuration of the service; they are removed
when they are written. Not a command of IgH.
",
    options: "",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    for master in session.masters()? {
        let number = master.master;
        let ToolAnswer::Record(line) = session.tool(number, ToolQuery::Record)? else { return Err(unexpected()) };
        if session.arguments.json {
            json::print(session, &Record { master: number, path: &line.path, frames: line.frames, lost: line.lost })?;
            continue;
        }
        writeln!(session, "{}", line.path)?;
        if line.lost > 0 {
            session.say(&format!("{} frames since the start are not recorded", line.lost));
        }
    }
    Ok(())
}
