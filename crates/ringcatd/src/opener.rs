//! Packet sockets from a process of its own: the only one that keeps CAP_NET_RAW.
//!
//! The daemon starts its own program again, with a Unix socket as standard input, before it gives up its capabilities.
//! A question is the number of links; the answer is a set of sockets with rings and filters that have no interface yet,
//! or what is wrong. The process ends with the daemon. It reads nothing else, and no other process reaches it.

use std::io::{self, Read, Write};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use ringcat_link::capabilities::{Capabilities, keep};
use ringcat_link::packet_socket::prepared::Prepared;
use ringcat_link::signals::unblock;
use ringcat_link::{ClassFilter, LinkError, PacketOptions, ReceiveMode, descriptors};

/// The option of the daemon's program that makes it this process.
pub const OPTION: &str = "--open-sockets";
/// Slots of a receive ring for one class of frames, 2 KiB each.
pub const SLOTS: u32 = 128;
/// A set of sockets is there within this time.
const ANSWER: Duration = Duration::from_secs(5);
/// Longest text about what is wrong.
const LONGEST: usize = 4096;
/// First byte of an answer with sockets.
const DONE: u8 = b'+';
/// First byte of an answer with a text.
const WRONG: u8 = b'!';
/// What is not there any more, for errors.
const NAME: &str = "the process that opens packet sockets";

/// Makes sets of packet sockets.
#[derive(Debug)]
pub enum Opener {
    /// In this process, which has the capability.
    Here,
    /// In a process of its own.
    Process(Mutex<UnixStream>, Child),
}

impl Opener {
    /// Starts the process. To be called before the capabilities are given up.
    ///
    /// # Errors
    /// The program cannot be started, for the operator.
    pub fn start() -> Result<Opener, String> {
        let failed = |error: io::Error| format!("{NAME}: {error}");
        let (near, far) = UnixStream::pair().map_err(failed)?;
        near.set_read_timeout(Some(ANSWER)).map_err(failed)?;
        let program = std::env::current_exe().map_err(failed)?;
        let mut command = Command::new(program);
        // Ctrl-C ends the daemon, and it with the daemon.
        command.arg(OPTION).stdin(Stdio::from(OwnedFd::from(far))).stdout(Stdio::null()).process_group(0);
        let child = command.spawn().map_err(failed)?;
        Ok(Opener::Process(Mutex::new(near), child))
    }

    /// A set of sockets for this number of links, in the order of
    /// [`HandedLinks`](ringcat_control::message::HandedLinks). The kernel takes 10 to 20 ms for each.
    ///
    /// # Errors
    /// This user may not, there is no memory for them, or the process has ended; for the operator.
    pub fn set(&self, links: usize) -> Result<Vec<OwnedFd>, String> {
        match self {
            Opener::Here => make(links).map_err(|error| error.to_string()),
            Opener::Process(socket, _) => ask(&socket.lock().unwrap_or_else(PoisonError::into_inner), links),
        }
    }
}

impl Drop for Opener {
    fn drop(&mut self) {
        if let Opener::Process(socket, child) = self {
            // It ends when its input does; without this no zombie would be waited for.
            let _ = socket.get_mut().unwrap_or_else(PoisonError::into_inner).shutdown(std::net::Shutdown::Both);
            let _ = child.wait();
        }
    }
}

fn ask(socket: &UnixStream, links: usize) -> Result<Vec<OwnedFd>, String> {
    let failed = |error: io::Error| format!("{NAME}: {error}");
    let mut asking = socket;
    asking.write_all(&[links as u8]).map_err(failed)?;
    let mut answer = [0; LONGEST];
    let (length, sockets) = descriptors::receive(socket, &mut answer).map_err(failed)?;
    match answer[..length] {
        [DONE] if sockets.len() == 2 * links => Ok(sockets),
        [WRONG, ref text @ ..] => Err(String::from_utf8_lossy(text).into_owned()),
        _ => Err(format!("{NAME} has ended")),
    }
}

/// A set of sockets for this number of links.
fn make(links: usize) -> Result<Vec<OwnedFd>, LinkError> {
    let both = [ClassFilter::Cyclic, ClassFilter::Acyclic];
    let each = both.into_iter().flat_map(|filter| std::iter::repeat_n(filter, links));
    let options = PacketOptions::default().with_receive(ReceiveMode::Blocking).with_ring_frames(SLOTS);
    each.map(|filter| Prepared::new(&options.with_filter(filter)).map(Prepared::into_descriptor)).collect()
}

/// Body of the process: makes sockets until the daemon is gone.
///
/// # Errors
/// What is wrong, for the operator.
pub fn run() -> Result<(), String> {
    unblock();
    keep(Capabilities::RAW).map_err(|error| format!("capabilities cannot be given up: {error}"))?;
    let failed = |error: io::Error| format!("the standard input: {error}");
    let socket = UnixStream::from(io::stdin().as_fd().try_clone_to_owned().map_err(failed)?);
    let mut asked = [0];
    loop {
        match (&socket).read(&mut asked) {
            Ok(0) => return Ok(()),
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(failed(error)),
        }
        let sent = match make(usize::from(asked[0].min(2))) {
            Ok(sockets) => {
                let raw: Vec<_> = sockets.iter().map(AsRawFd::as_raw_fd).collect();
                descriptors::send(&socket, &[DONE], &raw)
            }
            Err(error) => {
                let mut text = error.to_string();
                text.truncate(text.floor_char_boundary(LONGEST - 1));
                descriptors::send(&socket, &[&[WRONG], text.as_bytes()].concat(), &[])
            }
        };
        sent.map_err(failed)?;
    }
}
