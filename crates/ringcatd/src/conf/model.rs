//! The contents of a configuration file as data: settings, what was understood, and mistakes.

use std::fmt;
use std::path::PathBuf;

use ringcat_control::BusSettings;

use crate::source::{MasterOption, SafeState};

/// The contents of a configuration file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Conf {
    /// Masters in the order of their numbers.
    pub masters: Vec<MasterOption>,
    /// Interfaces that are switched on and off with the daemon.
    pub up_down: Vec<String>,
    /// The variables of RingCAT.
    pub own: Own,
    /// What each variable was understood as, in the order of the file.
    pub understood: Vec<Understood>,
}

/// The variables of RingCAT; `None`: not set.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Own {
    /// Where the daemon listens.
    pub socket: Option<PathBuf>,
    /// Mode of the socket.
    pub mode: Option<u32>,
    /// Group of the socket.
    pub group: Option<u32>,
    /// An owner that is stopped for this time loses its master, in milliseconds.
    pub stop_limit: Option<u64>,
    /// Whether there are network interfaces of EoE.
    pub eoe: Option<bool>,
    /// Whether there are debug interfaces.
    pub has_debug_interfaces: bool,
    /// Level of messages at the beginning.
    pub debug_level: Option<u32>,
    /// Whether a master waits until its backup interface is there.
    pub needs_backup: bool,
    /// Settings of the masters, for the daemon and for applications.
    pub bus: BusSettings,
    /// States of SubDevices after the end of an application.
    pub safe_states: Vec<SafeState>,
}

/// A variable and what it means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Understood {
    /// Its line, from 1.
    pub line: usize,
    /// Its name.
    pub name: String,
    /// Its meaning, in one sentence.
    pub text: String,
}

/// Something in a file that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Its line, from 1; `None`: the file as a whole.
    pub line: Option<usize>,
    /// What is wrong.
    pub text: String,
}

/// All mistakes of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfError {
    /// The file.
    pub path: PathBuf,
    /// In the order of their lines; one at least.
    pub mistakes: Vec<Mistake>,
}

impl fmt::Display for ConfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, mistake) in self.mistakes.iter().enumerate() {
            let begin = if number == 0 { "" } else { "\n" };
            write!(f, "{begin}{}:", self.path.display())?;
            if let Some(line) = mistake.line {
                write!(f, "{line}:")?;
            }
            write!(f, " {}", mistake.text)?;
        }
        Ok(())
    }
}

impl std::error::Error for ConfError {}
