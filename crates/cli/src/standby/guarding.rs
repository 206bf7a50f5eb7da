//! The guard of the interfaces of `ringcat standby`: this program once more, in a process of its own.

use std::os::unix::process::CommandExt;
use std::process::{Command, ExitCode};
use std::time::Duration;

use clap::Args;
use ringcat::Instant;
use ringcat::standby::RoleControl;
use ringcat::standby::guard::{self, Ending, Guard, Pulse};
use ringcat_link::{HeldSignals, realtime};

use crate::failure::Failure;
use crate::numbers::number;
use crate::output::warn;
use crate::times::{in_words, time};

/// This program, also where its file was replaced meanwhile.
const PROGRAM: &str = "/proc/self/exe";
/// The command that makes it the guard.
const COMMAND: &str = "standby-guard";
/// Period of checks for the end, and for a guard that has ended.
const LOOK: Duration = Duration::from_millis(200);

/// Shortest limit of a silence: hosts without a real-time kernel are late by more.
const SHORTEST: Duration = Duration::from_millis(1);

/// The limit of a silence.
pub fn limit(text: &str) -> Result<Duration, String> {
    let limit = time(text)?;
    if limit >= SHORTEST { Ok(limit) } else { Err(format!("expected {} or more", in_words(SHORTEST))) }
}

/// Options of the guard.
#[derive(Args, Clone, Copy, Debug)]
pub struct GuardArguments {
    /// Real-time priority (SCHED_FIFO), above that of the program that it guards
    #[arg(long, value_name = "1-99", value_parser = number(1..=99, 81), help_heading = "Thread")]
    priority: Option<i32>,
}

/// Guards until the process that has started this one releases it, ends or hangs.
pub fn run(arguments: &GuardArguments) -> ExitCode {
    // Signals that end the program do not end the guard; the program ends it.
    HeldSignals::hold();
    realtime::precise_timers();
    if let Some(priority) = arguments.priority {
        // Where it is not permitted, the program that it guards warns.
        let _ = realtime::fifo(priority);
        let _ = realtime::lock_memory();
    }
    match guard::run() {
        Ok(Ending::Released) => ExitCode::SUCCESS,
        // The program prints the reason.
        Ok(Ending::Refused) => ExitCode::FAILURE,
        Ok(ending) => {
            let what = if ending == Ending::Died { "has ended" } else { "does not run" };
            warn(format!("ringcat standby {what}: its interfaces are switched off, the ACTIVE has a line"));
            ExitCode::FAILURE
        }
        Err(error) => {
            warn(error);
            ExitCode::FAILURE
        }
    }
}

/// This process, guarded or not.
pub struct Guarded {
    guard: Option<Guard>,
    limit: Duration,
    look_at: Instant,
    /// Why it is not guarded as it should be.
    fault: Option<String>,
}

impl Guarded {
    /// No guard, with a warning.
    pub fn unguarded() -> Guarded {
        warn("without a guard: if this program is killed or hangs, the ACTIVE has no bus");
        Guarded::none()
    }

    /// No guard, without a warning.
    pub fn none() -> Guarded {
        Guarded { guard: None, limit: Duration::MAX, look_at: Instant::default(), fault: None }
    }

    /// Starts the guard, which switches the interfaces off. `priority` is that of the program.
    pub fn start(limit: Duration, priority: Option<i32>, interfaces: [&str; 2]) -> Result<Guarded, Failure> {
        let mut command = Command::new(PROGRAM);
        command.arg0("ringcat").arg(COMMAND);
        if let Some(priority) = priority {
            command.args(["--priority", &(priority + 1).to_string()]);
        }
        let guard = Guard::start(command, &interfaces, limit).map_err(|error| Failure::new(error.to_string()))?;
        Ok(Guarded { guard: Some(guard), limit, look_at: Instant::default(), fault: None })
    }

    /// The guard, if there is one, protects this MainDevice.
    pub fn protect(&mut self, control: &RoleControl) {
        if let Some(guard) = &mut self.guard {
            guard.protect(control);
        }
    }

    /// Whether this process is not guarded as it should be.
    pub fn has_fault(&self) -> bool {
        self.fault.is_some()
    }

    /// How long this process may wait.
    pub fn look(&self) -> Duration {
        self.guard.as_ref().map_or(LOOK, Guard::beat_period).min(LOOK)
    }

    /// Heartbeats of another thread.
    pub fn pulse(&self) -> Option<Pulse> {
        self.guard.as_ref().map(Guard::pulse)
    }

    /// Whether the guard has switched the interfaces off, as another thread has seen.
    pub fn note_acted(&mut self, has_acted: bool) {
        if has_acted && self.fault.is_none() {
            self.fault = Some(self.acted());
        }
    }

    fn acted(&self) -> String {
        let limit = in_words(self.limit);
        format!("the guard has switched both off: this program did not run for {limit}")
    }

    /// This process runs; false if the guard has switched the interfaces off.
    pub fn beat(&mut self) -> bool {
        let goes_on = self.guard.as_ref().is_none_or(Guard::beat);
        if !goes_on {
            self.fault = Some(self.acted());
        }
        goes_on
    }

    /// Checks from time to time whether the guard runs.
    pub fn check(&mut self, now: Instant) {
        if now < self.look_at || self.fault.is_some() {
            return;
        }
        self.look_at = now + LOOK;
        // A guard that has acted has ended, too; the next heartbeat shows it.
        if self.guard.as_mut().is_some_and(|guard| !guard.is_there() && guard.beat()) {
            warn("the guard has ended: if this program is killed or hangs now, the ACTIVE has no bus");
            self.fault = Some("its guard had ended".to_owned());
        }
    }

    /// The interfaces are about to be switched off in order.
    pub fn end(&mut self) {
        if let Some(guard) = &mut self.guard {
            guard.watch_end_only();
        }
    }

    /// The end of the guard; why this process was not guarded as it should be.
    pub fn release(self) -> Option<String> {
        if let Some(guard) = self.guard {
            guard.release();
        }
        self.fault
    }
}
