//! The time of an owner: what it says, and what ends it.
//!
//! It ends by a release, by the end of the connection, by the end of the process, or when the process is stopped for
//! longer than a limit. Three things tell the end of a process, whichever comes first: the connection, a pidfd, and the
//! flags of the process (decision 0076).

use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use ringcat_control::{Content, Limits, Message, ReceiveError};
use ringcat_link::process::{wait_readable, watch};

use crate::master::{End, Master};
use crate::owner::OwnerLink;
use crate::process_state::{ProcessFile, ProcessState};

/// Interval of looks at the process of an owner.
const LOOK: Duration = Duration::from_millis(2);
/// A message that has begun comes within this time.
const MESSAGE: Duration = Duration::from_secs(1);

/// Serves an owner until its time ends. Returns how, and why for the log.
pub fn serve(master: &Master, owner: &OwnerLink, stop_limit: Duration) -> (End, &'static str) {
    let pid = owner.owner().pid;
    let connection = owner.connection();
    // Of a process in another name space the connection alone tells the end.
    let end = watch(pid).ok();
    let mut file = ProcessFile::open(pid).ok();
    let mut stopped: Option<Instant> = None;
    loop {
        let both = [Some(connection.as_fd()), end.as_ref().map(AsFd::as_fd)];
        let both: Vec<_> = both.into_iter().flatten().collect();
        let ready = wait_readable(&both, LOOK);
        if ready & 1 != 0 {
            match connection.receive(Limits::OWNER, Some(MESSAGE)) {
                Ok((message, _)) => {
                    if said(master, owner, message) {
                        return (End::Released, "it has given the master back");
                    }
                }
                Err(ReceiveError::Ended) => return (End::Lost, "its connection has ended"),
                Err(_) => return (End::Lost, "it has sent something that is no message"),
            }
        }
        if ready & 2 != 0 {
            return (End::Lost, "its process has ended");
        }
        match file.as_mut().and_then(ProcessFile::look) {
            Some(ProcessState::Ends) => return (End::Lost, "a signal has ended its process"),
            Some(ProcessState::Stopped) => {
                if stopped.get_or_insert_with(Instant::now).elapsed() >= stop_limit {
                    return (End::Stopped, "its process was stopped");
                }
            }
            Some(ProcessState::Runs) | None => stopped = None,
        }
    }
}

/// Takes what an owner says; true if it has given the master back.
fn said(master: &Master, owner: &OwnerLink, message: Message) -> bool {
    match message.content {
        Content::Underway { id } => owner.taken(id),
        Content::Answer(answer) => owner.answered(answer.id, answer.what.map(|answer| (answer, message.bytes))),
        Content::Knowledge => master.keep(message.bytes),
        Content::Release => {
            master.keep(message.bytes);
            return true;
        }
        // An owner of this version says nothing else.
        _ => {}
    }
    false
}
