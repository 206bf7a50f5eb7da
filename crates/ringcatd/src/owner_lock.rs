//! A lock that outlives the daemon: the process that drives a master holds it.
//!
//! The lock is on an open file (`flock`), of which the owner gets a duplicate with its links. When the daemon is killed
//! the owner goes on and keeps the lock, so a daemon that is started anew waits for its end. The file says which
//! process it is; the system removes the lock with the last duplicate, however the processes end. No other user can
//! open the file, since a descriptor is enough to lock it.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::fd::{AsRawFd, RawFd};
use std::path::{Path, PathBuf};

use ringcat_control::Owner;
use ringcat_link::private_file;

/// Longest text that is read of the file.
const LONGEST: u64 = 200;

/// The lock of a master.
#[derive(Debug)]
pub struct OwnerLock {
    path: PathBuf,
    file: File,
    is_held: bool,
}

impl OwnerLock {
    /// The lock of a master of the daemon at this socket; not held yet.
    ///
    /// # Errors
    /// The file cannot be made, or something else has its name, for the operator.
    pub fn open(socket: &Path, master: u32) -> Result<OwnerLock, String> {
        let mut path = socket.as_os_str().to_owned();
        path.push(format!(".{master}.lock"));
        let path = PathBuf::from(path);
        let failed = |error: std::io::Error| format!("{}: {error}", path.display());
        if let Some(directory) = path.parent().filter(|it| !it.as_os_str().is_empty()) {
            std::fs::create_dir_all(directory).map_err(failed)?;
        }
        let file = private_file::open(&path).map_err(failed)?;
        Ok(OwnerLock { path, file, is_held: false })
    }

    /// Takes the lock for the daemon and its future owners.
    ///
    /// # Errors
    /// A process has it that another daemon has given the master to.
    pub fn hold(&mut self) -> Result<(), String> {
        if self.is_held {
            return Ok(());
        }
        match self.file.try_lock() {
            Ok(()) => {
                self.is_held = true;
                self.write("");
                Ok(())
            }
            Err(TryLockError::WouldBlock) => Err(format!(
                "waits for the end of {}, which got it from an earlier daemon and may still drive it",
                self.holder()
            )),
            Err(TryLockError::Error(error)) => Err(format!("{}: {error}", self.path.display())),
        }
    }

    /// Notes which process gets a duplicate.
    pub fn note(&mut self, owner: &Owner) {
        self.write(&format!("{owner}\n"));
    }

    /// For a duplicate.
    pub fn descriptor(&self) -> RawFd {
        self.file.as_raw_fd()
    }

    /// The lock is held without the text too: the text only names the process.
    fn write(&mut self, text: &str) {
        let _ = self.file.set_len(0);
        let _ = self.file.seek(SeekFrom::Start(0)).and_then(|_| self.file.write_all(text.as_bytes()));
    }

    /// The process that has the lock, as the other daemon has noted it.
    fn holder(&mut self) -> String {
        let mut bytes = Vec::new();
        let _ = self.file.seek(SeekFrom::Start(0)).and_then(|_| (&self.file).take(LONGEST).read_to_end(&mut bytes));
        let text: String = String::from_utf8_lossy(&bytes).chars().filter(|it| !it.is_control()).collect();
        if text.is_empty() { "another daemon".to_owned() } else { text }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_duplicate_holds_the_lock_beyond_its_daemon_and_names_its_process() {
        let socket = std::env::temp_dir().join(format!("ringcatd-lock-{}", std::process::id()));
        let mut first = OwnerLock::open(&socket, 3).expect("it can be made");
        first.hold().expect("it is free");
        first.hold().expect("it has it already");
        let mut second = OwnerLock::open(&socket, 3).expect("it is there");
        assert!(second.hold().expect_err("the first has it").contains("another daemon"));
        first.note(&Owner { pid: 7, program: "press".to_owned() });
        let duplicate = first.file.try_clone().expect("a descriptor");
        drop(first);
        let refused = second.hold().expect_err("the duplicate has it");
        assert!(refused.starts_with("waits for the end of \"press\" (process 7)"), "{refused}");
        OwnerLock::open(&socket, 4).expect("it can be made").hold().expect("another master");
        drop(duplicate);
        // A child that another test has just started has all descriptors until it is the program that it is to be.
        let begin = std::time::Instant::now();
        while let Err(refused) = second.hold() {
            assert!(begin.elapsed() < std::time::Duration::from_secs(10), "it is free: {refused}");
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        for master in [3, 4] {
            std::fs::remove_file(socket.with_extension(format!("{master}.lock"))).expect("it is there");
        }
    }
}
