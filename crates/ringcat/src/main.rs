//! The `ringcat` program. Without arguments it runs the demonstration.

mod demo;
mod interfaces;
mod output;
mod run;
mod scan;
mod sim;
mod surroundings;
mod table;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use interfaces::Failure;

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
    /// Lists the SubDevices on a network interface. They are in INIT afterwards.
    Scan(scan::ScanArguments),
    /// Brings all SubDevices on a network interface to OP, exchanges process data with outputs zero, and stops.
    Run(run::RunArguments),
    /// Puts a simulated segment on network interfaces, for any EtherCAT MainDevice at their other end.
    Sim(sim::SimArguments),
}

fn main() -> ExitCode {
    let command = Arguments::parse().command.unwrap_or_else(|| Command::Demo(demo::DemoArguments::default()));
    let held = match command {
        Command::Demo(arguments) => demo::run(&arguments).map_err(Failure::from),
        Command::Scan(arguments) => scan::run(&arguments).map(|()| true),
        Command::Run(arguments) => run::run(&arguments),
        Command::Sim(arguments) => sim::run(&arguments).map(|()| true),
    };
    match held {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("ringcat: {error}");
            ExitCode::from(2)
        }
    }
}
