//! The `ringcat` program. Without arguments it runs the demonstration.

mod access;
mod bench;
mod bus;
mod capture;
mod clock_options;
mod clocks;
mod compare;
mod demo;
mod descriptions;
mod doctor;
mod ending;
mod eni_summary;
mod esi;
mod failure;
mod init;
mod interfaces;
mod json;
mod modules;
mod numbers;
mod others;
mod out_file;
mod output;
mod recording;
mod resend;
mod ring;
mod run;
mod run_log;
mod scan;
mod sii;
mod sim;
#[cfg(feature = "standby")]
mod standby;
mod surroundings;
mod svg;
mod table;
mod thread;
mod times;
mod under_way;
mod verdict;
mod warnings;

use std::io::{IsTerminal, stdout};
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use verdict::{conclude, conclude_printed_error, conclude_text};

/// Width of help that does not go to a terminal.
const PIPE_WIDTH: usize = 80;

/// What a new user needs first.
const FIRST_STEPS: &str = "\
First steps:
  ringcat                              a demonstration on a simulated ring:
                                       no network, no permission
  ip link                              the network interfaces of this computer
  ringcat doctor --main eth1           settings of this computer that disturb
                                       a MainDevice, and what corrects them
  ringcat scan --main eth1             the SubDevices on the cable in eth1
  ringcat run --main eth1 --for 10s
                                       all SubDevices to OP, ten seconds of
                                       process data, figures
  ringcat sim --help                   a simulated segment on an interface

An interface must be for EtherCAT alone: no IP address, no bridge, no
NetworkManager. Raw frames need root or, once per build:
  sudo setcap cap_net_raw,cap_net_admin,cap_ipc_lock,cap_sys_nice=ep \\
      PROGRAM

`ringcat COMMAND -h` lists the options of a command, `ringcat COMMAND --help`
explains them. `ringcat help bench` works too.

Exit status: 0 all checks passed, 1 a check failed, 2 the command could not be
carried out. The last line says what: `result: ok: ...` or
`result: FAILED: ...`. With --json it is an object on the standard output, see
docs/json.md. Commands that send refuse to begin beside another MainDevice.";

/// The same with the path of this very program: capabilities belong to a file.
fn first_steps() -> String {
    let program = std::env::current_exe().unwrap_or_else(|_| "ringcat".into());
    FIRST_STEPS.replace("PROGRAM", &program.display().to_string())
}

/// RingCAT: an EtherCAT MainDevice for Linux.
#[derive(Debug, Parser)]
#[command(name = "ringcat", version, about = "RingCAT: an EtherCAT MainDevice for Linux", after_help = first_steps())]
#[command(max_term_width = 100)]
struct Arguments {
    /// Print JSON for programs, one object per line
    ///
    /// The last line is the result, also where the command fails; nothing else is printed on the standard output.
    /// docs/json.md explains every key.
    #[arg(long, global = true, help_heading = "Output", display_order = 900)]
    json: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Shows a simulated ring: to OP, a cut cable, a power failure
    ///
    /// Brings a simulated segment to OP, cuts and heals a cable, power-cycles a SubDevice, and checks all of it.
    Demo(demo::DemoArguments),
    /// Lists the SubDevices on a network interface
    ///
    /// All SubDevices are in INIT afterwards.
    Scan(scan::ScanArguments),
    /// Writes a network file from a scan
    ///
    /// The file declares the network as it was found; `ringcat run --network` brings exactly this network to OP.
    Init(init::InitArguments),
    /// Compares a network with a network file or an ENI
    ///
    /// Names every SubDevice that is missing, additional or different.
    Compare(compare::CompareArguments),
    /// Brings all SubDevices to OP and exchanges process data
    ///
    /// Outputs are zero, except those that --set gives a value. The run ends with an orderly stop.
    Run(run::RunArguments),
    /// Shows the state of a ring and of its cables
    ///
    /// Which SubDevices answer on which interface, where the ring is broken, errors of each cable. It only reads.
    Ring(ring::RingArguments),
    /// Shows which settings of this machine disturb a MainDevice, and their remedies
    ///
    /// Interfaces, kernel, processors, permissions, another MainDevice; how late a thread wakes up. It changes nothing.
    Doctor(doctor::DoctorArguments),
    /// Synchronizes the distributed clocks and shows their differences
    Clocks(clocks::ClocksArguments),
    /// Records what passes on network interfaces into a file for Wireshark
    ///
    /// It never sends: a MainDevice on these interfaces does not notice.
    Capture(capture::CaptureArguments),
    /// Is one of two MainDevices in a ring: forwards as INACTIVE, and takes over
    ///
    /// It takes over with a declaration; without one it only forwards the frames of the ACTIVE.
    #[cfg(feature = "standby")]
    Standby(standby::StandbyArguments),
    /// Guards the interfaces of `ringcat standby`, which starts it
    #[cfg(feature = "standby")]
    #[command(hide = true)]
    StandbyGuard(standby::guarding::GuardArguments),
    /// Prints the state of a `ringcat standby --remote`, or requests another role
    ///
    /// It waits until a request has taken effect.
    #[cfg(feature = "standby")]
    Remote(standby::remote::ClientArguments),
    /// Puts a simulated segment on network interfaces
    ///
    /// Any EtherCAT MainDevice at their other end can work with it.
    Sim(sim::SimArguments),
    /// Shows what an ENI says and what follows from it, or writes one
    ///
    /// An ENI is a network that TwinCAT, EC-Engineer or another tool has configured. No interface is needed.
    Eni(eni_summary::EniArguments),
    /// Device descriptions (ESI): a folder, a device, a SubDevice from one
    ///
    /// Descriptions are files of vendors, see docs/esi.md. No interface is needed.
    Esi(esi::EsiArguments),
    /// EEPROM images (SII): from a device description, compared, to one
    ///
    /// Descriptions are ESI files of vendors, see docs/esi.md. No interface is needed.
    Sii(sii::SiiArguments),
    /// Measures round trips, cycle rates and start-up
    Bench(bench::BenchArguments),
}

fn main() -> ExitCode {
    let mut program = Arguments::command();
    if !stdout().is_terminal() {
        program = program.term_width(PIPE_WIDTH);
    }
    let arguments = match program.try_get_matches().and_then(|matches| Arguments::from_arg_matches(&matches)) {
        Ok(arguments) => arguments,
        Err(error) => return explain(&error),
    };
    let command = arguments.command.unwrap_or_else(|| Command::Demo(demo::DemoArguments::default()));
    if arguments.json {
        output::switch_to_json(Some(command.name()));
    }
    conclude(match command {
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Scan(arguments) => scan::run(&arguments),
        Command::Init(arguments) => init::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Run(arguments) => run::run(&arguments),
        Command::Ring(arguments) => ring::run(&arguments),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Clocks(arguments) => clocks::run(&arguments),
        Command::Capture(arguments) => capture::run(&arguments),
        #[cfg(feature = "standby")]
        Command::Standby(arguments) => standby::run(&arguments),
        #[cfg(feature = "standby")]
        Command::StandbyGuard(arguments) => return standby::guarding::run(&arguments),
        #[cfg(feature = "standby")]
        Command::Remote(arguments) => standby::remote::run(&arguments),
        Command::Sim(arguments) => sim::run(&arguments),
        Command::Eni(arguments) => eni_summary::run(&arguments),
        Command::Esi(arguments) => esi::run(&arguments),
        Command::Sii(arguments) => sii::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
    })
}

impl Command {
    /// As the command line has it.
    fn name(&self) -> &'static str {
        match self {
            #[cfg(feature = "standby")]
            Command::Demo(arguments) if arguments.standby => "demo --standby",
            Command::Demo(_) => "demo",
            Command::Scan(_) => "scan",
            Command::Init(_) => "init",
            Command::Compare(_) => "compare",
            Command::Run(_) => "run",
            Command::Ring(_) => "ring",
            Command::Doctor(_) => "doctor",
            Command::Clocks(_) => "clocks",
            Command::Capture(_) => "capture",
            #[cfg(feature = "standby")]
            Command::Standby(_) => "standby",
            #[cfg(feature = "standby")]
            Command::StandbyGuard(_) => "standby-guard",
            #[cfg(feature = "standby")]
            Command::Remote(_) => "remote",
            Command::Sim(_) => "sim",
            Command::Eni(arguments) => arguments.name(),
            Command::Esi(arguments) => arguments.name(),
            Command::Sii(arguments) => arguments.name(),
            Command::Bench(arguments) => arguments.name(),
        }
    }
}

/// Help, the version, or what is wrong with the command line.
fn explain(error: &clap::Error) -> ExitCode {
    if std::env::args_os().any(|argument| argument == "--json") {
        output::switch_to_json(None);
    }
    if output::is_json() && !error.use_stderr() {
        let text = error.to_string();
        let first = if error.kind() == ErrorKind::DisplayVersion { text.trim() } else { "help" };
        return conclude_text(first, text.lines().map(str::to_owned).collect());
    }
    // The only error that is likely is a closed pipe.
    let _ = error.print();
    if !error.use_stderr() {
        return ExitCode::SUCCESS;
    }
    let (message, details) = message_of(&error.to_string());
    conclude_printed_error(&message, details)
}

/// The message of an error of the command line, and its further lines. What a first line that ends with a colon
/// announces, such as the options that are missing, is part of the message.
fn message_of(text: &str) -> (String, Vec<String>) {
    let mut lines = text.lines();
    let first = lines.by_ref().map(str::trim).find(|line| !line.is_empty()).unwrap_or_default();
    let mut message = first.strip_prefix("error: ").unwrap_or(first).to_owned();
    if message.ends_with(':') {
        let announced: Vec<&str> = lines.by_ref().map(str::trim).take_while(|line| !line.is_empty()).collect();
        message = format!("{message} {}", announced.join(", "));
    }
    (message, lines.map(str::trim).filter(|line| !line.is_empty()).map(str::to_owned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All commands, those of `bench` too.
    fn commands(of: &clap::Command) -> Vec<&clap::Command> {
        of.get_subcommands().flat_map(|command| std::iter::once(command).chain(commands(command))).collect()
    }

    #[test]
    fn the_version_has_the_name_of_the_program() {
        assert_eq!(Arguments::command().render_version(), format!("ringcat {}\n", env!("CARGO_PKG_VERSION")));
    }

    #[test]
    fn the_message_about_the_command_line_names_each_missing_option() {
        let message = |line: &[&str]| message_of(&Arguments::try_parse_from(line).unwrap_err().to_string());
        let (text, details) = message(&["ringcat", "capture"]);
        assert_eq!(text, "the following required arguments were not provided: --main <IF>, --out <FILE.pcapng>");
        assert!(details[0].starts_with("Usage: ringcat capture"), "{details:?}");
        assert_eq!(message(&["ringcat", "scan", "--bogus"]).0, "unexpected argument '--bogus' found");
    }

    // covers: run
    #[test]
    fn every_command_and_option_is_explained_in_a_line_and_has_a_heading() {
        let mut program = Arguments::command();
        program.build();
        program.clone().debug_assert();
        assert!(program.get_after_help().is_some());
        for command in commands(&program).into_iter().filter(|command| command.get_name() != "help") {
            let name = command.get_name();
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            assert!((1..=80).contains(&about.len()), "{name}: {about}");
            for option in command.get_arguments() {
                let help = option.get_help().map(ToString::to_string).unwrap_or_default();
                assert!((1..=80).contains(&help.len()), "{name} --{}: {help}", option.get_id());
                let is_named = matches!(option.get_id().as_str(), "help" | "version") || option.is_positional();
                assert!(is_named || option.get_help_heading().is_some(), "{name} --{}", option.get_id());
            }
        }
    }

    // covers: run
    #[test]
    fn every_help_fits_a_terminal_of_80_columns() {
        let mut program = Arguments::command().term_width(80);
        program.build();
        let names: Vec<String> = commands(&program).iter().map(|command| command.get_name().to_owned()).collect();
        assert!(names.len() >= 13, "{names:?}");
        let mut pending = vec![program];
        while let Some(mut command) = pending.pop() {
            let long = command.render_long_help().to_string();
            let short = command.render_help().to_string();
            let program = std::env::current_exe().expect("a test has a file").display().to_string();
            for line in long.lines().chain(short.lines()).filter(|line| line.trim() != program) {
                assert!(line.chars().count() <= 80, "{}: {line}", command.get_name());
            }
            pending.extend(command.get_subcommands().map(|command| command.clone().term_width(80)));
        }
    }
}
