//! Two network namespaces with a veth pair between them, and programs in them, for benches on real interfaces.
//!
//! The MainDevice's end is `near0`, the segment's `far0`. Both namespaces are gone when the value is dropped.

use std::ffi::OsStr;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Interface indices: different at both ends, so that the kernel reports the loss of a carrier in time.
const INDEX: [u32; 2] = [50, 60];
/// Start-up time of a server.
const START: Duration = Duration::from_millis(400);

/// Limit of the start-up of a server that shows when it is ready, and the period of checks.
const READY: Duration = Duration::from_secs(10);
const POLL: Duration = Duration::from_millis(5);

/// The namespaces.
#[derive(Debug)]
pub struct Namespaces {
    near: String,
    far: String,
}

impl Namespaces {
    /// Makes them.
    ///
    /// # Errors
    /// The error of `ip`, usually missing permission.
    pub fn new() -> Result<Namespaces, String> {
        let id = std::process::id();
        let made = Namespaces { near: format!("ringcat{id}near"), far: format!("ringcat{id}far") };
        for namespace in [&made.near, &made.far] {
            ip(&format!("netns add {namespace}"))?;
        }
        let ([near, far], Namespaces { near: here, far: there }) = (INDEX, &made);
        ip(&format!("-n {here} link add near0 index {near} type veth peer name far0 index {far} netns {there}"))?;
        for (namespace, interface) in [(here, "near0"), (there, "far0")] {
            // With IPv6 addresses the host would send frames of its own; old kernels do not support the mode.
            let _ = ip(&format!("-n {namespace} link set {interface} addrgenmode none"));
            ip(&format!("-n {namespace} link set {interface} up"))?;
        }
        Ok(made)
    }

    /// A command at the MainDevice's end.
    pub fn near(&self, program: impl AsRef<OsStr>) -> Command {
        inside(&self.near, program.as_ref())
    }

    /// Starts a server at the segment's end that runs until it is dropped.
    ///
    /// # Errors
    /// It does not start.
    pub fn serve(&self, program: impl AsRef<OsStr>, arguments: &[&str]) -> Result<Server, String> {
        let mut command = inside(&self.far, program.as_ref());
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null());
        let child = command.spawn().map_err(|error| error.to_string())?;
        let mut server = Server(child);
        std::thread::sleep(START);
        server.runs(arguments)?;
        Ok(server)
    }

    /// As [`Namespaces::serve`], and returns as soon as it is ready.
    ///
    /// # Errors
    /// It ends, or is not ready after `READY`.
    pub fn serve_until(
        &self,
        program: impl AsRef<OsStr>,
        arguments: &[&str],
        is_ready: &dyn Fn() -> bool,
    ) -> Result<Server, String> {
        let mut command = inside(&self.far, program.as_ref());
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null());
        let mut server = Server(command.spawn().map_err(|error| error.to_string())?);
        let begin = Instant::now();
        while !is_ready() {
            server.runs(arguments)?;
            if begin.elapsed() > READY {
                return Err(format!("{arguments:?} is not ready after {} s", READY.as_secs()));
            }
            std::thread::sleep(POLL);
        }
        Ok(server)
    }
}

impl Drop for Namespaces {
    fn drop(&mut self) {
        for namespace in [&self.near, &self.far] {
            // A namespace that could not be created cannot be removed.
            let _ = ip(&format!("netns del {namespace}"));
        }
    }
}

/// A running server.
#[derive(Debug)]
pub struct Server(Child);

impl Server {
    /// Whether it is still there.
    fn runs(&mut self, arguments: &[&str]) -> Result<(), String> {
        match self.0.try_wait() {
            Ok(None) => Ok(()),
            other => Err(format!("{arguments:?} ended at once: {other:?}")),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn inside(namespace: &str, program: &OsStr) -> Command {
    let mut command = Command::new("ip");
    command.args(["netns", "exec", namespace]).arg(program);
    command
}

fn ip(arguments: &str) -> Result<(), String> {
    let output = Command::new("ip").args(arguments.split(' ')).output().map_err(|error| format!("ip: {error}"))?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()) }
}
