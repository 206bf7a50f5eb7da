//! The daemon as a whole: masters, and the socket for clients.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::listening::{Listening, Prepared};
use crate::master::Master;
use crate::rights::Rights;
use crate::session::Masters;

/// An owner that is stopped for this time loses its master: about the watchdog of a SubDevice.
pub const STOP_LIMIT: Duration = Duration::from_millis(100);

/// A running daemon.
#[derive(Debug)]
pub struct Daemon {
    masters: Arc<Masters>,
    _listening: Listening,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // Threads of clients may have the masters for longer.
        self.masters.all.iter().for_each(Master::end);
    }
}

impl Daemon {
    /// Serves clients at this socket.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn start(all: Vec<Master>, socket: &Path, rights: Rights, stop_limit: Duration) -> Result<Daemon, String> {
        Daemon::serve(all, Prepared::new(socket, rights)?, stop_limit)
    }

    /// Serves clients at a socket that was prepared.
    ///
    /// # Errors
    /// As [`Daemon::start`].
    pub fn serve(all: Vec<Master>, socket: Prepared, stop_limit: Duration) -> Result<Daemon, String> {
        let masters = Arc::new(Masters { all, stop_limit });
        let listening = socket.serve(masters.clone())?;
        Ok(Daemon { masters, _listening: listening })
    }

    /// Tries again what was not possible before; to be called about each second.
    pub fn supervise(&self) {
        self.masters.all.iter().for_each(Master::supervise);
    }

    /// The masters.
    pub fn masters(&self) -> &[Master] {
        &self.masters.all
    }
}
