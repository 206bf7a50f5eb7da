//! The `ringcat` program. Without arguments it runs the demonstration.

mod demo;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// RingCAT: an EtherCAT MainDevice for Linux.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Brings a simulated segment to OP, cuts and heals a cable, power-cycles a SubDevice, and checks all of it.
    Demo(demo::DemoArguments),
}

fn main() -> ExitCode {
    let Command::Demo(arguments) =
        Arguments::parse().command.unwrap_or_else(|| Command::Demo(demo::DemoArguments::default()));
    match demo::run(&arguments) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("ringcat: {error}");
            ExitCode::from(2)
        }
    }
}
