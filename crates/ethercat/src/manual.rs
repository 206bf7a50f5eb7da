//! Manual pages, from the same source as the help: one of the tool, one of each command.

use std::fmt::Write;

use crate::commands::ALL;
use crate::help::NUMBERS;
use crate::options_help::{OptionHelp, common, of};
use crate::shape::Command;

/// A text as roff takes it: no line begins a request, and a minus sign can be copied.
fn roff(text: &str) -> String {
    let lines = text.lines().map(|line| {
        let line = line.replace('\\', "\\e").replace('-', "\\-");
        if line.starts_with(['.', '\'']) { format!("\\&{line}") } else { line }
    });
    lines.collect::<Vec<String>>().join("\n")
}

/// When the pages were changed last.
const DATE: &str = "2026-11-30";

fn head(name: &str, summary: &str) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let (title, summary) = (roff(&name.to_uppercase()), roff(summary.trim_end_matches('.')));
    format!(".TH \"{title}\" 8 \"{DATE}\" \"RingCAT {version}\"\n.SH NAME\n{} \\- {summary}\n", roff(name))
}

fn options(title: &str, options: &[OptionHelp]) -> String {
    if options.is_empty() {
        return String::new();
    }
    let mut text = format!(".SH {title}\n");
    for OptionHelp { name, letter, value, text: about } in options {
        let value = if value.is_empty() { String::new() } else { format!(" \\fI{}\\fR", roff(value)) };
        let letter = if letter.is_empty() { String::new() } else { format!("\\fB\\-{letter}\\fR, ") };
        // Writing to a string cannot fail, here and below.
        let _ = write!(text, ".TP\n{letter}\\fB\\-\\-{}\\fR{value}\n{}\n", roff(name), roff(about));
    }
    text
}

/// Text whose lines stay as they are.
fn as_it_is(text: &str) -> String {
    format!(".nf\n{}\n.fi\n", roff(text.trim_end()))
}

/// How numbers are written, in a section of its own: it is not about the last option.
fn numbers() -> String {
    format!(".SH NUMBERS\n{}", as_it_is(NUMBERS))
}

const END: &str = ".SH EXIT STATUS\n0, or 1 after a failure.\n.SH ENVIRONMENT\n.TP\n.B RINGCAT_SOCKET\n\
                   Socket of the daemon. By default that of a daemon of this user, or /run/ringcat/control.\n";

/// The page of a command: `ethercat-slaves.8`.
pub fn page(command: &Command) -> String {
    let mut text = head(&format!("ethercat-{}", command.name), command.summary) + ".SH SYNOPSIS\n";
    let form = |form: &&str| {
        format!(".B ethercat {}\n{}\n", roff(command.name), roff(&format!("[OPTIONS] {form}")).trim_end())
    };
    text += &command.forms.iter().map(form).collect::<Vec<String>>().join(".br\n");
    if !command.help.is_empty() {
        text += ".SH DESCRIPTION\n";
        text += &as_it_is(command.help);
    }
    text += &options("OPTIONS OF THIS COMMAND", &of(command));
    text += &options("OPTIONS OF ALL COMMANDS", &common());
    text + &numbers() + END + ".SH SEE ALSO\n.BR ethercat (8)\n"
}

/// The page of the tool: `ethercat.8`.
pub fn overview() -> String {
    let mut text = head("ethercat", "look at and change EtherCAT masters and slaves");
    text +=
        ".SH SYNOPSIS\n.B ethercat\n\\fICOMMAND\\fR [OPTIONS] [ARGUMENTS]\n.SH COMMANDS\nThey can be abbreviated.\n";
    for command in ALL {
        let _ = write!(text, ".TP\n.BR ethercat\\-{} (8)\n{}\n", roff(command.name), roff(command.summary));
    }
    text + &options("OPTIONS OF ALL COMMANDS", &common()) + &numbers() + END
}

/// All pages by file name.
pub fn pages() -> Vec<(String, String)> {
    let commands = ALL.into_iter().map(|command| (format!("ethercat-{}.8", command.name), page(command)));
    commands.chain([("ethercat.8".to_owned(), overview())]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn texts_begin_no_requests_and_keep_their_characters() {
        assert_eq!(roff(".so x\n'y\na-\\b"), "\\&.so x\n\\&'y\na\\-\\eb");
        for (name, page) in pages() {
            let is_known = |line: &str| {
                !line.starts_with('.')
                    || [".TH", ".SH", ".TP", ".nf", ".fi", ".br", ".B", ".BR"]
                        .iter()
                        .any(|known| line.split_whitespace().next() == Some(known))
            };
            assert!(page.contains(".SH NUMBERS\n.nf\nNumbers are decimal"), "{name}: {page}");
            assert!(page.lines().all(is_known) && !page.lines().any(|line| line.starts_with('\'')), "{name}: {page}");
        }
    }
}
