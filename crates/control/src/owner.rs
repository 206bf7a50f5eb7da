//! The application that drives a master.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The application that drives a master.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Owner {
    /// Its process id; 0 if it is not known here.
    pub pid: u32,
    /// Its name, from its first message.
    pub program: String,
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} (process {})", self.program, self.pid)
    }
}
