//! A simulated segment in a process of its own.
//!
//! The daemon starts its own program again, with a Unix socket as standard input. The new process first says in one
//! message how many links its segment has, or what is wrong. Then it gets the far ends of pipes, whenever the daemon
//! connects the links anew. It ends when the daemon and all processes at the near ends are gone.

use std::ffi::OsString;
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ringcat::esi::load_segment;
use ringcat::piped::segment::{FarEnds, PipedSegment};
use ringcat::sim::network::Network;
use ringcat_link::capabilities::{Capabilities, keep};
use ringcat_link::descriptors;
use ringcat_link::signals::unblock;

/// The option of the daemon's program that makes it the process of a segment.
pub const OPTION: &str = "--simulate";
/// Interval of checks for new pipes.
const LOOK: Duration = Duration::from_millis(1);
/// The process says within this time what its segment is.
const START: Duration = Duration::from_secs(20);
/// Longest message about what is wrong.
const LONGEST: usize = 4096;
/// What it says first of a segment with one link, with two links, or none.
const ONE: u8 = b'1';
const TWO: u8 = b'2';
const WRONG: u8 = b'!';

/// Starts the process with the segment of this file. The socket to it, and whether the segment has two links.
///
/// # Errors
/// The program cannot be started, or what is wrong with the file.
pub fn start(file: &Path) -> Result<(Child, UnixStream, bool), String> {
    let failed = |error: io::Error| format!("the process of the simulated segment: {error}");
    let (near, far) = UnixStream::pair().map_err(failed)?;
    let program = std::env::current_exe().map_err(failed)?;
    let mut command = Command::new(program);
    // Ctrl-C ends the daemon; the segment lives on for an application that drives it.
    // In one word, since the name may begin with a minus.
    let mut option = OsString::from(OPTION);
    option.push("=");
    option.push(file);
    command.arg(option).stdin(Stdio::from(OwnedFd::from(far))).process_group(0);
    let child = command.spawn().map_err(failed)?;
    drop(command);
    let is_ring = greeting(&near)?;
    Ok((child, near, is_ring))
}

/// Reads what the process says of its segment: whether it has two links.
///
/// # Errors
/// What is wrong.
pub fn greeting(control: &UnixStream) -> Result<bool, String> {
    let failed = |error: io::Error| format!("the process of the simulated segment: {error}");
    control.set_read_timeout(Some(START)).map_err(failed)?;
    let mut first = [0];
    let mut control = control;
    control.read_exact(&mut first).map_err(failed)?;
    match first[0] {
        ONE => Ok(false),
        TWO => Ok(true),
        _ => {
            let mut text = String::new();
            control.take(LONGEST as u64).read_to_string(&mut text).map_err(failed)?;
            Err(text)
        }
    }
}

/// Body of the process: simulates the segment of this file until the daemon and all drivers are gone.
///
/// # Errors
/// What is wrong, for the operator; the daemon has got it.
pub fn run(file: &Path) -> Result<(), String> {
    // The daemon waits for its signals; the segment ends by them.
    unblock();
    keep(Capabilities::NONE).map_err(|error| format!("capabilities cannot be given up: {error}"))?;
    let failed = |error: io::Error| format!("the standard input: {error}");
    let control = UnixStream::from(io::stdin().as_fd().try_clone_to_owned().map_err(failed)?);
    match load(file) {
        Ok(network) => {
            let mut segment = PipedSegment::new(network);
            serve(&mut segment, &control, |_| true).map_err(failed)
        }
        Err(text) => {
            let said = [&[WRONG], text.as_bytes()].concat();
            // The daemon may be gone.
            let _ = (&control).write_all(&said);
            Err(text)
        }
    }
}

/// Loads the segment of a file.
///
/// # Errors
/// What is wrong, with the name of the file.
pub fn load(file: &Path) -> Result<Network, String> {
    let named = |error: String| format!("{}: {error}", file.display());
    // These errors name the file themselves.
    let segment = load_segment(file).map_err(|error| error.to_string())?;
    if segment.devices.is_empty() {
        return Err(named("the segment has no [[device]]".to_owned()));
    }
    Network::from_description(segment).map_err(|error| named(error.to_string()))
}

/// Says what the segment is, and simulates it until the daemon and all drivers are gone, or `each_turn` returns false.
///
/// # Errors
/// The socket to the daemon fails.
pub fn serve(
    segment: &mut PipedSegment,
    control: &UnixStream,
    mut each_turn: impl FnMut(&mut PipedSegment) -> bool,
) -> io::Result<()> {
    let mut said = control;
    said.write_all(&[if segment.is_ring() { TWO } else { ONE }])?;
    control.set_nonblocking(true)?;
    let mut is_alone = false;
    let mut look_at = Instant::now();
    while each_turn(segment) && !(is_alone && segment.is_abandoned()) {
        if !is_alone && Instant::now() >= look_at {
            look_at = Instant::now() + LOOK;
            is_alone = !look_for_pipes(segment, control);
        }
        segment.turn();
        segment.wait();
    }
    Ok(())
}

/// Connects the links anew if the daemon has sent pipes; false when the daemon is gone.
fn look_for_pipes(segment: &mut PipedSegment, control: &UnixStream) -> bool {
    let mut bytes = [0; 16];
    match descriptors::receive(control, &mut bytes) {
        Ok((0, _)) => false,
        // The daemon sends descriptors with each message; a message without is no order.
        Ok((_, pipes)) => {
            if let Ok(ends) = FarEnds::adopt(pipes) {
                segment.connect(ends);
            }
            true
        }
        Err(error) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
    }
}
