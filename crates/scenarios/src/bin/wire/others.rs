//! The programs that are compared, and which of them are installed.

use std::ffi::OsString;
use std::path::PathBuf;

/// A program and how it waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// RingCAT.
    Ours {
        /// `busy`, `hybrid` or `block`.
        receive: &'static str,
        /// Both halves in one thread.
        one_thread: bool,
        /// Cycles under way at most.
        under_way: u8,
    },
    /// SOEM under Python, with its own blocking receive or with one that spins.
    Pysoem {
        /// Whether the receive spins.
        spins: bool,
    },
    /// ethercrab, its thread for frames blocking, as its examples run it.
    Ethercrab,
}

impl Program {
    /// RingCAT, one cycle under way.
    pub const fn ours(receive: &'static str, one_thread: bool) -> Program {
        Program::Ours { receive, one_thread, under_way: 1 }
    }

    /// Name, receive mode, threads.
    pub fn title(self) -> String {
        match self {
            Program::Ours { receive, one_thread, under_way } => {
                let waits = match receive {
                    "busy" => "spinning",
                    "block" => "blocking",
                    other => other,
                };
                let threads = if one_thread { "one thread" } else { "two threads" };
                let several = if under_way > 1 { format!(", {under_way} under way") } else { String::new() };
                format!("RingCAT, {waits}, {threads}{several}")
            }
            Program::Pysoem { spins: false } => "pysoem 1.1.13: SOEM's blocking receive under Python".to_owned(),
            Program::Pysoem { spins: true } => "pysoem with a spinning recv()".to_owned(),
            Program::Ethercrab => "ethercrab 0.7, blocking, two threads".to_owned(),
        }
    }
}

/// Programs of others that are installed.
pub struct Others {
    /// A Python with pysoem.
    pub python: Option<OsString>,
    /// What makes its receive spin.
    pub spinning_recv: Option<OsString>,
    /// The client of ethercrab.
    pub ethercrab: Option<PathBuf>,
}

impl Others {
    /// As named by variables of the environment.
    pub fn installed() -> Others {
        let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty());
        let python = variable("RINGCAT_PYTHON");
        let spinning_recv = variable("RINGCAT_SPINNING_RECV").filter(|_| python.is_some());
        Others { python, spinning_recv, ethercrab: variable("RINGCAT_ETHERCRAB").map(PathBuf::from) }
    }

    /// Whether this program can run here.
    pub fn has(&self, program: Program) -> bool {
        match program {
            Program::Ours { .. } => true,
            Program::Pysoem { spins: false } => self.python.is_some(),
            Program::Pysoem { spins: true } => self.spinning_recv.is_some(),
            Program::Ethercrab => self.ethercrab.is_some(),
        }
    }

    /// What is missing, in words.
    pub fn missing(&self) -> String {
        let all = [Program::Pysoem { spins: false }, Program::Pysoem { spins: true }, Program::Ethercrab];
        let missing: Vec<String> = all.into_iter().filter(|program| !self.has(*program)).map(Program::title).collect();
        if missing.is_empty() {
            "beside others: all of them".to_owned()
        } else {
            format!("not here: {}", missing.join("; "))
        }
    }
}
