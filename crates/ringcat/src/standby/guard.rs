//! A guard: a process that switches the interfaces of a MainDevice off when the program of that MainDevice ends or
//! hangs (protocol MR-21, REQ012).
//!
//! A process that is killed leaves its interfaces on. They forward nothing then, and the ACTIVE MainDevice of the ring
//! has no bus; with interfaces that are off it has a line.
//!
//! [`Guard::start`] starts the process; its program calls [`run`]. The guard detects the end of the process at once,
//! and that it hangs, or is stopped by a signal, from a heartbeat in shared memory: [`Guard::beat`] in the loop of the
//! program. Where the guard has acted, the next beat shows that, and nothing of the process leaves any more.

mod silence;
mod watch;

use std::error::Error;
use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ringcat_link::descriptors;
use ringcat_link::heartbeat::Heartbeat;
use ringcat_link::interface;
use ringcat_link::process::{Peer, watch_peer};

use super::{NotReady, RoleControl};

pub use watch::Ending;
use watch::{Order, RELEASED, UNTIMED};

/// The process reports within this time that it guards.
const START: Duration = Duration::from_secs(5);
/// The process ends within this time after it was released.
const END: Duration = Duration::from_secs(1);
/// Interval of checks whether it has ended.
const END_LOOK: Duration = Duration::from_millis(1);
/// Beats of a program within the limit of its guard.
const BEATS_PER_LIMIT: u32 = 4;
/// The message of the guard: it guards, or what is wrong.
const READY: u8 = b'1';
const WRONG: u8 = b'!';
/// Longest message about what is wrong.
const LONGEST: u64 = 4096;

/// Why there is no guard.
#[derive(Debug)]
#[non_exhaustive]
pub enum GuardError {
    /// A system call of this process, or the start of the guard, has failed.
    System(io::Error),
    /// The guard has refused, in its words: it may not switch the interfaces, for instance.
    Refused(String),
}

impl GuardError {
    /// What is wrong, without where.
    fn reason(&self) -> String {
        match self {
            GuardError::System(error) => error.to_string(),
            GuardError::Refused(words) => words.clone(),
        }
    }
}

impl fmt::Display for GuardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the guard of the interfaces: {}", self.reason())
    }
}

impl Error for GuardError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            GuardError::System(error) => Some(error),
            GuardError::Refused(_) => None,
        }
    }
}

impl From<io::Error> for GuardError {
    fn from(error: io::Error) -> GuardError {
        GuardError::System(error)
    }
}

/// The guard of the interfaces of this process. Dropped, as in a panic, it acts.
#[derive(Debug)]
pub struct Guard {
    child: Child,
    stream: UnixStream,
    heartbeat: Arc<Heartbeat>,
    limit: Duration,
    /// Of the MainDevice that it protects.
    control: Option<RoleControl>,
}

/// Beats for a [`Guard`], from any thread.
#[derive(Clone, Debug)]
pub struct Pulse(Arc<Heartbeat>);

impl Pulse {
    /// As [`Guard::beat`].
    #[inline]
    pub fn beat(&self) -> bool {
        self.0.beat()
    }
}

impl Guard {
    /// Starts the guard, which switches these interfaces off at once, as proof that it may, and later when this process
    /// ends without [`Guard::release`], or does not beat for `limit` after its first beat. The program that `command`
    /// starts calls [`run`]; its standard input and output are taken. The interfaces are switched on after this.
    ///
    /// # Errors
    /// The process cannot be started, or may not switch the interfaces.
    pub fn start(mut command: Command, interfaces: &[&str], limit: Duration) -> Result<Guard, GuardError> {
        let (stream, far) = UnixStream::pair()?;
        stream.set_read_timeout(Some(START))?;
        let heartbeat = Arc::new(Heartbeat::new()?);
        // Ctrl-C is for this process, whose end the guard awaits.
        command.stdin(Stdio::from(OwnedFd::from(far))).stdout(Stdio::null()).process_group(0);
        let child = command.spawn()?;
        // The far end must be open in the guard alone.
        drop(command);
        let mut guard = Guard { child, stream, heartbeat, limit, control: None };
        let order = Order::in_words(interfaces, limit);
        descriptors::send(&guard.stream, order.as_bytes(), &[guard.heartbeat.as_fd().as_raw_fd()])?;
        guard.await_answer()?;
        Ok(guard)
    }

    fn await_answer(&mut self) -> Result<(), GuardError> {
        let mut first = [0];
        let answered = self.stream.read_exact(&mut first);
        answered.map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => GuardError::Refused("it has ended without an answer".to_owned()),
            ErrorKind::WouldBlock => GuardError::Refused(format!("no answer within {} s", START.as_secs())),
            _ => error.into(),
        })?;
        if first == [READY] {
            return Ok(());
        }
        let mut words = String::new();
        (&self.stream).take(LONGEST).read_to_string(&mut words)?;
        Err(GuardError::Refused(words))
    }

    /// This guard protects the MainDevice of a role control: [`NotReady::GUARD`] is no reason against its readiness, as
    /// long as this guard is there.
    pub fn protect(&mut self, control: &RoleControl) {
        control.set_not_ready(NotReady::GUARD.0, false);
        self.control = Some(control.clone());
    }

    /// [`NotReady::GUARD`] is a reason again.
    fn protects_no_longer(&self) {
        if let Some(control) = &self.control {
            control.set_not_ready(NotReady::GUARD.0, true);
        }
    }

    /// This process runs. False if the guard has acted: the interfaces are off, and the program is to end. No system
    /// call.
    #[inline]
    pub fn beat(&self) -> bool {
        self.heartbeat.beat()
    }

    /// Beats from other threads; one of them is enough.
    pub fn pulse(&self) -> Pulse {
        Pulse(self.heartbeat.clone())
    }

    /// The program beats at least once in this time.
    pub fn beat_period(&self) -> Duration {
        self.limit / BEATS_PER_LIMIT
    }

    /// From now on only the end of this process counts, not whether it beats: while it switches its interfaces, for
    /// instance, which takes long with some drivers.
    pub fn watch_end_only(&mut self) {
        // It may have ended.
        let _ = self.stream.write_all(&[UNTIMED]);
    }

    /// Whether the guard is there. It has ended where it has acted, or where it was killed.
    pub fn is_there(&mut self) -> bool {
        let is_there = matches!(self.child.try_wait(), Ok(None));
        if !is_there {
            self.protects_no_longer();
        }
        is_there
    }

    /// The guard ends and does not act: the interfaces are off, or are to stay as they are.
    pub fn release(mut self) {
        // It may have ended.
        let _ = self.stream.write_all(&[RELEASED]);
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.protects_no_longer();
        // The end of the stream, unless it was released.
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
        let until = Instant::now() + END;
        while self.is_there() && Instant::now() < until {
            std::thread::sleep(END_LOOK);
        }
    }
}

/// Body of the guard: takes the order from the standard input, watches the process that has started it, and switches
/// the interfaces off when that process ends or hangs. Returns how it ended.
///
/// # Errors
/// The standard input is no socket, or the interfaces could not be switched off.
pub fn run() -> Result<Ending, GuardError> {
    let stream = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    stream.set_read_timeout(Some(START))?;
    let (order, end) = match prepare(&stream) {
        Ok(prepared) => prepared,
        Err(error) => {
            (&stream).write_all(&[&[WRONG], error.reason().as_bytes()].concat())?;
            return Ok(Ending::Refused);
        }
    };
    stream.set_nonblocking(true)?;
    (&stream).write_all(&[READY])?;
    let ending = order.watch(&stream, end.as_ref());
    if ending != Ending::Released {
        order.heartbeat.revoke();
        switch_off(&order.interfaces)?;
    }
    Ok(ending)
}

/// Takes the order, shows that it can be followed, and watches the other process.
fn prepare(stream: &UnixStream) -> Result<(Order, Option<OwnedFd>), GuardError> {
    let order = Order::receive(stream)?;
    switch_off(&order.interfaces)?;
    let peer = Peer::of(stream)?;
    let end = watch_peer(stream, &peer)?;
    Ok((order, end))
}

/// Switches all off, also where one of them fails.
fn switch_off(interfaces: &[String]) -> Result<(), GuardError> {
    let switched = interfaces.iter().map(|name| interface::switch(name, false));
    switched.fold(Ok(()), Result::and).map_err(|error| GuardError::Refused(error.to_string()))
}
