//! How the tool and its commands are used.

use std::fmt::Write;

use crate::commands::ALL;
use crate::shape::{Command, Output};

/// Options of all commands.
pub const COMMON: &str = "  --master  -m <master>  Masters: comma-separated numbers and ranges, such
                         as '1,3', '5-7', '-3', '2-'. All by default.
  --force   -f           Do it although it may be wrong.
  --quiet   -q           Say less.
  --verbose -v           Say more.
  --help    -h           Show this help, or that of the command.
";

/// Options of all commands for a bus without a daemon.
pub const STANDALONE: &str = "  --main <interface>       Drive the bus at this network interface as long as
                           the command runs, without a daemon. Its slaves are
                           brought to PREOP, and stay there.
  --redundant <interface>  That at the other end of a ring.
  --sim <file>             Simulate this segment file instead.
";

/// The option of all commands that print data.
pub const JSON: &str = "  --json                 Print JSON: one object per line.
";

/// How numbers are written.
pub const NUMBERS: &str = "Numbers are decimal, octal with 0 before them, or hexadecimal with 0x\nbefore them.\n";

/// How the tool is used.
pub fn usage() -> String {
    let mut text = "Usage: ethercat <COMMAND> [OPTIONS] [ARGUMENTS]\n\nCommands (can be abbreviated):\n".to_owned();
    let width = ALL.iter().map(|command| command.name.len()).max().unwrap_or(0);
    for command in ALL {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {:width$}  {}", command.name, command.summary);
    }
    text += "\nOptions of all commands:\n";
    text += COMMON;
    text += "\nWithout a daemon:\n";
    text += STANDALONE;
    text.push('\n');
    text + NUMBERS + "Call 'ethercat <COMMAND> --help' for more about a command.\n"
}

/// How a command is used.
pub fn of(command: &Command) -> String {
    let mut text = String::new();
    for form in command.forms {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "ethercat {} [OPTIONS]{}{form}", command.name, if form.is_empty() { "" } else { " " });
    }
    let _ = write!(text, "\n{}\n", command.summary);
    if !command.help.is_empty() {
        text = text + "\n" + command.help;
    }
    let json = json_of(command);
    if !command.options.is_empty() || !json.is_empty() {
        text = text + "\nOptions of this command:\n" + command.options + json;
    }
    text + "\n" + NUMBERS
}

/// `--json`, where the command has it.
pub fn json_of(command: &Command) -> &'static str {
    match command.output {
        Output::Data => JSON,
        Output::Table | Output::Nothing => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn all_commands_are_sorted_and_have_help() {
        assert!(ALL.is_sorted_by_key(|command| command.name));
        for command in ALL {
            assert!(!command.forms.is_empty() && command.summary.len() > 10, "{}", command.name);
            let help = of(command);
            assert!(help.lines().all(|line| line.len() <= 80), "{help}");
        }
    }
}
