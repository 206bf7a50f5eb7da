//! `ringcat sim` with the ring, in a process of its own that spins on the first processor.

use std::fs;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::tried::{Tried, said};

/// SubDevices: 6 with 800 bytes, 8 with 26 bytes, and 19 with one byte.
const SEGMENT: &str = "[segment]\nring = true\n\
    [[device]]\ntype = \"block\"\ncount = 6\n\
    [[device]]\ntype = \"servo\"\ncount = 8\n\
    [[device]]\ntype = \"digital-output-8\"\ncount = 10\n\
    [[device]]\ntype = \"digital-input-8\"\ncount = 9\n";
/// Number of SubDevices.
pub const COUNT: usize = 33;
/// It listens within this time.
const LIMIT: Duration = Duration::from_secs(10);
const LOOK: Duration = Duration::from_millis(10);

/// The simulator; it ends when this is dropped.
#[derive(Debug)]
pub struct Simulator {
    child: Child,
    files: [PathBuf; 2],
}

impl Simulator {
    /// Starts it on `sim0` and `sim1`.
    pub fn start() -> Tried<Simulator> {
        let at = std::env::temp_dir().join(format!("ringcat-takeover-{}", std::process::id()));
        let files = ["toml", "control"].map(|extension| at.with_extension(extension));
        fs::write(&files[0], SEGMENT).map_err(said)?;
        let here = std::env::current_exe().map_err(said)?;
        let mut command = Command::new(here.with_file_name("ringcat"));
        command.args(["sim", "--main", "sim0", "--redundant", "sim1", "--receive", "busy", "--cpu", "0"]);
        command.arg("--segment").arg(&files[0]).arg("--control").arg(&files[1]);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().map_err(said)?;
        let simulator = Simulator { child, files };
        let until = Instant::now() + LIMIT;
        while UnixStream::connect(&simulator.files[1]).is_err() {
            if Instant::now() > until {
                return Err(format!("the simulator does not listen within {LIMIT:?}"));
            }
            std::thread::sleep(LOOK);
        }
        Ok(simulator)
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
        for file in &self.files {
            let _ = fs::remove_file(file);
        }
    }
}
