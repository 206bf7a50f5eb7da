//! The test set-up: two namespaces, RingCAT's programs, those of others, and what they print.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use scenarios::namespaces::{Namespaces, Server};

use crate::others::Others;

/// A result, or why there is none.
pub type Tried<T> = Result<T, String>;

/// Blocks of compared programs, and with `--full`.
const BLOCKS: [usize; 2] = [3, 7];

/// Coupler, terminals, and drives that have mailboxes.
pub const MACHINE: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\ncount = 1\n\
                       [[device]]\ntype = \"digital-output-8\"\ncount = 20\n\
                       [[device]]\ntype = \"digital-input-8\"\ncount = 20\n[[device]]\ntype = \"servo\"\ncount = 9\n";
/// Ten terminals.
pub const TEN: &str = "[segment]\nring = true\n[[device]]\ntype = \"digital-output-8\"\ncount = 5\n\
                   [[device]]\ntype = \"digital-input-8\"\ncount = 5\n";

/// The test set-up.
pub struct Wire {
    /// Near and far end.
    pub namespaces: Namespaces,
    /// Directory of the programs.
    programs: PathBuf,
    /// Programs of others.
    pub others: Others,
    /// More blocks and sizes.
    pub full: bool,
}

impl Wire {
    /// Programs are next to this one.
    pub fn new(namespaces: Namespaces, full: bool) -> Wire {
        let here = std::env::current_exe().unwrap_or_default();
        let programs = here.parent().map(PathBuf::from).unwrap_or_default();
        Wire { namespaces, programs, others: Others::installed(), full }
    }

    /// Number of blocks of compared programs.
    pub fn blocks(&self) -> usize {
        BLOCKS[usize::from(self.full)]
    }

    /// The program `ringcat`.
    pub fn ringcat(&self) -> PathBuf {
        self.programs.join("ringcat")
    }

    /// Runs `ringcat` at the far end.
    pub fn serve(&self, arguments: &[&str]) -> Tried<Server> {
        let fixed = ["--main", "far0", "--receive", "busy", "--cpu", "1"];
        self.namespaces.serve(self.ringcat(), &[arguments, &fixed].concat())
    }

    /// `ringcat bench` at the near end; returns its output.
    pub fn bench(&self, arguments: &[&str]) -> Tried<String> {
        self.bench_waiting("busy", arguments)
    }

    /// As [`Self::bench`], in this receive mode.
    pub fn bench_waiting(&self, receive: &str, arguments: &[&str]) -> Tried<String> {
        let mut command = self.namespaces.near(self.ringcat());
        command.arg("bench").args(arguments).args(["--main", "near0", "--receive", receive, "--cpu", "0"]);
        output(command)
    }
}

/// Runs a program to its end; returns its output.
pub fn output(mut command: Command) -> Tried<String> {
    let output = command.stdin(Stdio::null()).output().map_err(|error| error.to_string())?;
    // 1: measured, but with losses, which a stall of the machine can cause.
    if matches!(output.status.code(), Some(0 | 1)) && !output.stdout.is_empty() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    Err(format!("{command:?} failed: {}", String::from_utf8_lossy(&output.stderr).trim()))
}

/// The figure after a name.
pub fn after(text: &str, name: &str) -> Tried<f64> {
    let rest = text.split_once(name).map(|(_, rest)| rest.trim_start_matches([':', ' ']));
    let end = |rest: &str| rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
    let figure = rest.and_then(|rest| rest[..end(rest)].parse().ok());
    figure.ok_or_else(|| format!("no \"{name}\" in {text:?}"))
}
