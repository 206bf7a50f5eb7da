//! `foe_write`: writes a file by FoE.

use std::collections::hash_map::RandomState;
use std::hash::BuildHasher;
use std::path::Path;

use ringcat_control::message::Query;
use ringcat_control::tool::{MOST_FILE, MOST_PART, ToolQuery, TransferWork};

use crate::aborts::of_foe;
use crate::failure::Failure;
use crate::inputs;
use crate::progress::Transfer;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "foe_write",
    summary: "Store a file on a slave via FoE.",
    forms: &["<FILENAME>"],
    help: "One slave must be selected. FILENAME is a local file of at most 16 MiB;
'-' is the standard input, which needs --output-file.
",
    options: "  --output-file -o <file>   Name on the slave, by default that of the
                            local file without directories.
  --alias       -a <alias>  Alias of the slave.
  --position    -p <pos>    Its position. See the help of 'slaves'.
",
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [file] = session.words() else { return Err(Failure::usage("'foe_write' takes one argument: the file!")) };
    let file = file.clone();
    let name = match &session.arguments.output_file {
        Some(name) => name.clone(),
        None if file == "-" => {
            return Err(Failure::usage("Please specify a filename for the slave side with --output-file!"));
        }
        None => Path::new(&file).file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
    };
    let bytes = inputs::read(&file, MOST_FILE)?;
    let (master, position) = session.single_slave()?;
    // Seeds of hash maps are random: two tools at a time have different numbers.
    let transfer = RandomState::new().hash_one(std::process::id());
    let mut offset = 0;
    for part in bytes.chunks(MOST_PART) {
        session.done(master, ToolQuery::FilePart { transfer, offset }, part.to_vec())?;
        offset += part.len() as u32;
    }
    let of = Transfer { master, position, work: TransferWork::FileWrite };
    let ask = Query::Tool(ToolQuery::FileWrite { position, name, transfer });
    let asked = session.ask_with_bar(of, ask, Vec::new());
    asked.map_err(|failure| of_foe(failure, "write"))?;
    session.say_if_verbose("FoE writing finished.");
    Ok(())
}
