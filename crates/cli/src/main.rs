//! The `ringcat` program. Without arguments it runs the demonstration.

mod bench;
mod capture;
mod clock_options;
mod clocks;
mod demo;
mod ending;
mod eni_summary;
mod failure;
mod interfaces;
mod others;
mod output;
mod recording;
mod ring;
mod run;
mod run_log;
mod scan;
mod sim;
mod surroundings;
mod table;
mod times;
mod verdict;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use verdict::{LastLine, conclude};

/// What a newcomer wants to know first.
const FIRST_STEPS: &str = "\
First steps:
  ringcat                               a demonstration on a simulated ring: no network, no permission
  ip link                               the network interfaces of this computer
  sudo ringcat scan --main eth1         who is on the cable in eth1?
  sudo ringcat run --main eth1 --for 10s
                                        everybody to OP, ten seconds of process data, figures
  ringcat sim --help                    a simulated segment on an interface, for any MainDevice

The interface must be for EtherCAT alone: no IP address, no bridge, no NetworkManager. Raw frames need root, or once:
  sudo setcap cap_net_raw,cap_net_admin,cap_ipc_lock,cap_sys_nice=ep $(which ringcat)

Exit status: 0 all went well, 1 it ran and something did not hold, 2 it could not do what was asked. The last line says
what: `result: ok: ...` or `result: FAILED: ...`. Commands that send refuse to begin beside another MainDevice.
`ringcat COMMAND --help` explains a command.";

/// RingCAT: an EtherCAT MainDevice for Linux.
#[derive(Debug, Parser)]
#[command(version, about = "RingCAT: an EtherCAT MainDevice for Linux", after_help = FIRST_STEPS)]
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
    /// Shows how a ring is: who answers on which interface, where it is broken, errors of each cable. It only reads.
    Ring(ring::RingArguments),
    /// Brings the distributed clocks of a segment together and shows how well they keep.
    Clocks(clocks::ClocksArguments),
    /// Records what passes on network interfaces into a file for Wireshark, without taking part.
    Capture(capture::CaptureArguments),
    /// Puts a simulated segment on network interfaces, for any EtherCAT MainDevice at their other end.
    Sim(sim::SimArguments),
    /// Shows what an ENI (a network configured with TwinCAT, EC-Engineer, ...) says and what follows from it.
    Eni(eni_summary::EniArguments),
    /// Measures: round trips against a bare echo, cycles back to back, start-up.
    Bench(bench::BenchArguments),
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return explain(&error),
    };
    let command = arguments.command.unwrap_or_else(|| Command::Demo(demo::DemoArguments::default()));
    let last_line = if command.prints_json() { LastLine::Beside } else { LastLine::StandardOutput };
    let outcome = match command {
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Scan(arguments) => scan::run(&arguments),
        Command::Run(arguments) => run::run(&arguments),
        Command::Ring(arguments) => ring::run(&arguments),
        Command::Clocks(arguments) => clocks::run(&arguments),
        Command::Capture(arguments) => capture::run(&arguments),
        Command::Sim(arguments) => sim::run(&arguments),
        Command::Eni(arguments) => eni_summary::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
    };
    conclude(outcome, last_line)
}

impl Command {
    /// Whether the standard output is for JSON.
    fn prints_json(&self) -> bool {
        match self {
            Command::Scan(arguments) => arguments.json,
            Command::Ring(arguments) => arguments.json,
            Command::Clocks(arguments) => arguments.json,
            Command::Eni(arguments) => arguments.json,
            Command::Demo(_) | Command::Run(_) | Command::Capture(_) | Command::Sim(_) | Command::Bench(_) => false,
        }
    }
}

/// Help, the version, or what is wrong with the command line.
fn explain(error: &clap::Error) -> ExitCode {
    // The only error that is likely is that nothing reads it any more.
    let _ = error.print();
    if !error.use_stderr() {
        return ExitCode::SUCCESS;
    }
    let text = error.to_string();
    let first = text.lines().next().unwrap_or_default();
    eprintln!("result: FAILED: {}", first.strip_prefix("error: ").unwrap_or(first));
    ExitCode::from(2)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    // covers: run
    #[test]
    fn every_command_and_option_is_explained() {
        let program = Arguments::command();
        program.clone().debug_assert();
        assert!(program.get_after_help().is_some());
        for command in program.get_subcommands() {
            assert!(command.get_about().is_some(), "{}", command.get_name());
            for option in command.get_arguments() {
                assert!(option.get_help().is_some(), "{} --{}", command.get_name(), option.get_id());
            }
        }
    }
}
