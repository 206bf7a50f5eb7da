//! A program whose output is read while it runs.

use std::process::{Child, Command};
use std::time::{Duration, Instant};

use crate::said::Said;

/// Time limit for the end of a program.
const END_LIMIT: Duration = Duration::from_secs(90);

/// A program with output that is read while it runs; killed on drop.
pub struct Running {
    child: Child,
    said: Said,
    errors: Said,
}

impl Running {
    /// This program.
    pub fn of(mut child: Child) -> Running {
        let said = Said::by(child.stdout.take().expect("it is piped"));
        let errors = Said::by(child.stderr.take().expect("it is piped"));
        Running { child, said, errors }
    }

    /// Its output so far.
    pub fn said(&self) -> &Said {
        &self.said
    }

    /// What it has said on its standard error so far.
    pub fn errors(&self) -> &Said {
        &self.errors
    }

    /// Its process.
    pub fn process(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal, such as `-KILL`.
    pub fn signal(&self, name: &str) {
        send(name, &self.child.id().to_string());
    }

    /// Sends a signal to the only process that it has started.
    pub fn signal_child(&self, name: &str) {
        let process = self.child.id();
        let children = std::fs::read_to_string(format!("/proc/{process}/task/{process}/children"));
        send(name, children.expect("it runs").trim());
    }

    /// Sends SIGINT and waits for the end; returns standard output and standard error.
    pub fn interrupt(self) -> (String, String) {
        self.signal("-INT");
        self.finish(END_LIMIT)
    }

    /// Waits for its end; returns standard output and standard error.
    pub fn finish(mut self, limit: Duration) -> (String, String) {
        wait(&mut self.child, limit);
        (self.said.whole(), self.errors.whole())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It has usually ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn send(signal: &str, process: &str) {
    let sent = Command::new("kill").args([signal, process]).status();
    assert!(sent.is_ok_and(|status| status.success()), "{signal} to process {process:?}");
}

fn wait(child: &mut Child, limit: Duration) {
    let until = Instant::now() + limit;
    while child.try_wait().expect("it is our child").is_none() {
        if Instant::now() >= until {
            let _ = child.kill();
            panic!("a program does not end within {} s", limit.as_secs());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}
