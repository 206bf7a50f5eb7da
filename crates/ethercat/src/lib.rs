//! The command line tool `ethercat`: commands, options, output and exit codes as users of the IgH EtherCAT Master know
//! them. It sends its requests to the daemon `ringcatd`, and through it to the application that drives a segment.
//!
//! * [`arguments`]: options and words of the command line; [`numbers`]: numbers and lists of them;
//! * [`shape`]: the description of a command; [`commands`]: all commands, also by abbreviation; [`help`]: their use;
//! * [`completion`], [`manual`]: scripts for shells and manual pages, from [`options_help`] and the same help;
//! * [`standalone`]: a bus without a daemon, for one command;
//! * [`progress`]: a bar while a command waits;
//! * [`session`]: the daemon and its masters; [`selection`]: SubDevices by alias and position;
//! * [`data_types`]: values of objects, registers and IDNs; [`aborts`]: codes of refusals;
//! * `command`: one file per command; `json`: what they print with `--json`.
//!
//! Data goes to the standard output, everything else to the standard error; the exit code is 0 or 1.
#![forbid(unsafe_code)]

pub mod aborts;
mod append;
pub mod arguments;
mod command;
pub mod commands;
pub mod completion;
pub mod data_types;
pub mod failure;
pub mod help;
pub mod hex;
pub mod inputs;
pub mod ipv4;
mod json;
pub mod manual;
pub mod numbers;
pub mod options_help;
mod order;
pub mod progress;
pub mod screen;
pub mod selection;
pub mod selection_help;
pub mod session;
pub mod shape;
mod sii_image;
pub mod standalone;

use std::ffi::OsString;
use std::io::Write;
use std::path::Path;

use arguments::Arguments;
use commands::Found;
use failure::Failure;
use ringcat_control::visible;
use session::Session;
use shape::Output;

/// Runs the tool with these arguments, the name of the program left out, and the daemon at `socket`. False is exit
/// code 1.
pub fn run(arguments: &[OsString], socket: &Path, output: &mut dyn Write, errors: &mut dyn Write) -> bool {
    match try_run(arguments, socket, output, errors) {
        Ok(()) => true,
        Err(failure) => {
            // Nothing can be reported where the standard error is closed.
            let _ = errors.write_all(visible(&failure.text()).as_bytes());
            false
        }
    }
}

fn try_run(words: &[OsString], socket: &Path, output: &mut dyn Write, errors: &mut dyn Write) -> Result<(), Failure> {
    let wrong = |text: String| Failure::Message(format!("ethercat: {text}\n\n{}", help::usage()));
    let arguments = Arguments::parse(words).map_err(wrong)?;
    let Some(name) = arguments.words.first() else {
        if arguments.help {
            output.write_all(help::usage().as_bytes())?;
            return Ok(());
        }
        return Err(Failure::Message(format!("Please specify a command!\n\n{}", help::usage())));
    };
    let command = match commands::find(name) {
        Found::One(command) => command,
        Found::Several(candidates) => {
            let names: Vec<&str> = candidates.iter().map(|it| it.name).collect();
            let text = format!("Ambiguous command abbreviation! Matching:\n{}\n", names.join("\n"));
            return Err(Failure::Message(text));
        }
        Found::None => return Err(Failure::Message(format!("Unknown command {name}!\n\n{}", help::usage()))),
    };
    if arguments.help {
        output.write_all(help::of(command).as_bytes())?;
        return Ok(());
    }
    let without_json = match command.output {
        Output::Data => None,
        Output::Table => Some("only prints a table"),
        Output::Nothing => Some("prints no data"),
    };
    if let (true, Some(why)) = (arguments.json, without_json) {
        let failure = Failure::usage(format!("'{}' {why}: it has no --json!", command.name));
        return Err(failure.with_help(|| help::of(command)));
    }
    if command.forms == [""] && arguments.words.len() > 1 {
        let failure = Failure::usage(format!("'{}' takes no arguments!", command.name));
        return Err(failure.with_help(|| help::of(command)));
    }
    let links = standalone::links(&arguments).map_err(wrong)?;
    let mut session = Session::new(command.name, arguments, socket, output, errors).with_links(links);
    (command.run)(&mut session).map_err(|failure| failure.with_help(|| help::of(command)))
}
