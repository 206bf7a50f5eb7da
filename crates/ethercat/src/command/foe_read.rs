//! `foe_read`: reads a file by FoE.

use std::fs::File;
use std::io::{self, Write};

use ringcat_control::message::Query;
use ringcat_control::tool::{ToolQuery, TransferWork};

use crate::aborts::of_foe;
use crate::failure::Failure;
use crate::json;
use crate::json::reads;
use crate::json::values::Hex;
use crate::progress::Transfer;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "foe_read",
    summary: "Read a file from a slave via FoE.",
    forms: &["<SOURCEFILE>"],
    help: "One slave must be selected. SOURCEFILE is the name of the file on the
slave. Its content goes to the standard output, or to a file; at most
16 MiB.
",
    options: "  --output-file -o <file>   Local file to write.
  --alias       -a <alias>  Alias of the slave.
  --position    -p <pos>    Its position. See the help of 'slaves'.
",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [name] = session.words() else { return Err(Failure::usage("'foe_read' takes one argument: the file!")) };
    let file = name.clone();
    let (master, position) = session.single_slave()?;
    let transfer = Transfer { master, position, work: TransferWork::FileRead };
    let ask = Query::Tool(ToolQuery::FileRead { position, name: file.clone() });
    let asked = session.ask_with_bar(transfer, ask, Vec::new());
    let (_, bytes) = asked.map_err(|failure| of_foe(failure, "read"))?;
    session.say_if_verbose(&format!("Read {} bytes of FoE data.", bytes.len()));
    let local = session.arguments.output_file.clone().filter(|file| file != "-");
    if let Some(local) = &local {
        let failed = |what: &str, error: io::Error| Failure::failed(format!("Failed to {what} '{local}'! ({error})"));
        let mut file = File::create(local).map_err(|error| failed("open", error))?;
        file.write_all(&bytes).map_err(|error| failed("write", error))?;
    }
    match local {
        _ if session.arguments.json => {
            let data = local.is_none().then_some(Hex(&bytes));
            json::print(session, &reads::File { master, position, file: &file, length_bytes: bytes.len(), data })
        }
        Some(_) => Ok(()),
        None => session.write(&bytes),
    }
}
