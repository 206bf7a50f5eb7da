//! The time of an owner: what it says, and what ends it.
//!
//! It ends by a release, by the end of the connection, by the end of the process, or when the process is stopped for
//! longer than a limit. Three signs show the end of a process, whichever comes first: the connection, a pidfd, and the
//! flags of the process (decision 0076). A message of an owner is taken in parts, so that one that comes slowly, or
//! never whole, keeps no sign from being seen.

use std::io;
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::time::{Duration, Instant};

use ringcat_control::{Arriving, Content, Limits, Message, ReceiveError, Refusal};
use ringcat_link::process::wait_readable;

use crate::log::say;
use crate::master::{End, Master};
use crate::owner::OwnerLink;
use crate::process_state::{ProcessFile, ProcessState};

/// Interval of checks at the process of an owner.
const LOOK: Duration = Duration::from_millis(2);
/// Between the end of a connection and that of its process, both by the kernel.
const EXIT: Duration = Duration::from_millis(10);

/// What shows the end of the process of an owner.
#[derive(Debug)]
pub struct Signs {
    /// Readable when the process has ended. Of a process in another name space the connection alone shows the end.
    end: Option<OwnedFd>,
    file: Option<ProcessFile>,
}

impl Signs {
    /// Of the process with this number, with the descriptor that shows its end. To be made before the owner gets
    /// anything: without descriptors its end would be seen late.
    ///
    /// # Errors
    /// The process has ended, or it cannot be watched.
    pub fn new(pid: u32, end: io::Result<Option<OwnedFd>>) -> Result<Signs, Refusal> {
        let refused =
            |error| Refusal::Failed(format!("process {pid}, which has connected, cannot be watched: {error}"));
        let end = end.map_err(refused)?;
        let file = match ProcessFile::open(pid) {
            Ok(file) => Some(file),
            // It is in another name space, or this user may not see it.
            Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied) => None,
            Err(error) => return Err(refused(error)),
        };
        Ok(Signs { end, file })
    }

    /// A duplicate of the descriptor that shows the end of the process; `None` without one.
    pub fn end(&self) -> Option<OwnedFd> {
        self.end.as_ref().and_then(|end| end.try_clone().ok())
    }

    /// How the time of an owner has ended whose connection has.
    fn of_connection(&mut self) -> End {
        let end = self.end.as_ref().map(|end| wait_readable(&[end.as_fd()], EXIT));
        let ends = self.file.as_mut().and_then(ProcessFile::look) == Some(ProcessState::Ends);
        if end == Some(1) || ends { End::Ended } else { End::MayGoOn }
    }
}

/// The end of the time of an owner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ended {
    /// How it has ended.
    pub how: End,
    /// The owner has given the master back itself.
    pub is_release: bool,
    /// Why, for the log.
    pub why: &'static str,
}

/// Serves an owner until its time ends.
pub fn serve(master: &Master, owner: &OwnerLink, mut signs: Signs, stop_limit: Duration) -> Ended {
    let ended = |how, why| Ended { how, is_release: false, why };
    let connection = owner.connection();
    let mut arriving = Arriving::new(Limits::OWNER);
    let mut stopped: Option<Instant> = None;
    loop {
        let both = [Some(connection.as_fd()), signs.end.as_ref().map(AsFd::as_fd)];
        let both: Vec<_> = both.into_iter().flatten().collect();
        let ready = wait_readable(&both, LOOK);
        if ready & 1 != 0 {
            match connection.receive_part(&mut arriving) {
                Ok(message) => {
                    if let Some(end) = message.and_then(|message| take_message(master, owner, message)) {
                        return Ended { how: end, is_release: true, why: "it has given the master back" };
                    }
                }
                Err(ReceiveError::Ended) => return ended(signs.of_connection(), "its connection has ended"),
                Err(_) => return ended(End::MayGoOn, "it has sent something that is no message"),
            }
        }
        if ready & 2 != 0 {
            return ended(End::Ended, "its process has ended");
        }
        match signs.file.as_mut().and_then(ProcessFile::look) {
            Some(ProcessState::Ends) => return ended(End::Ended, "a signal has ended its process"),
            Some(ProcessState::Stopped) => {
                if stopped.get_or_insert_with(Instant::now).elapsed() >= stop_limit {
                    return ended(End::MayGoOn, "its process was stopped");
                }
            }
            Some(ProcessState::Runs) | None => stopped = None,
        }
    }
}

/// Takes the messages of an owner; how its time has ended, if it has given the master back.
fn take_message(master: &Master, owner: &OwnerLink, message: Message) -> Option<End> {
    match message.content {
        Content::Underway { id } => owner.taken(id),
        Content::Answer(answer) => owner.answered(answer.id, answer.what.map(|answer| (answer, message.bytes))),
        Content::Knowledge => _ = master.keep(message.bytes),
        // Without its knowledge the counters are those from before its time.
        Content::Release if master.keep(message.bytes) => return Some(End::Released),
        Content::Release => return Some(End::Ended),
        Content::MakeInterface { name, mac } => make_interface(master, owner, name, mac),
        Content::SwitchLink { is_redundant, up } => {
            if let Err(cause) = master.switch_link(is_redundant, up) {
                say(format_args!("master {}: {cause}", master.number()));
            }
        }
        // An owner of this version says nothing else.
        _ => {}
    }
    None
}

/// Makes a network interface for an owner, and answers it.
fn make_interface(master: &Master, owner: &OwnerLink, name: String, mac: [u8; 6]) {
    let made = master.make_interface(&name, mac);
    let descriptors: Vec<_> = made.iter().map(|tap| tap.as_fd().as_raw_fd()).collect();
    let answer = Content::Interface { name, fault: made.as_ref().err().cloned() };
    // Of an owner that is gone, or does not read, the connection shows the end.
    let _ = owner.connection().send_with(&answer.into(), &descriptors);
}

#[cfg(test)]
mod tests {
    use ringcat_control::Content;

    use super::*;
    use crate::opener::Opener;
    use crate::owner::for_tests;
    use crate::source::Source;
    use crate::wires::Wires;

    fn master() -> Master {
        let source = Source::Interfaces(crate::device::Device::Name("nonexistent".to_owned()), None);
        let wires = Wires::of(&source, &[], &std::sync::Arc::new(Opener::Here)).expect("it has a name");
        Master::new(0, source.to_string(), wires)
    }

    // covers: daemon
    #[test]
    fn a_release_without_usable_knowledge_is_none_in_order() {
        let (master, (owner, _far)) = (master(), for_tests().expect("a pair"));
        for bytes in [Vec::new(), vec![1, 2, 3], vec![0xFF; 4096]] {
            let end = take_message(&master, &owner, Message { content: Content::Release, bytes });
            assert_eq!(end, Some(End::Ended));
        }
        assert_eq!(take_message(&master, &owner, Content::Underway { id: 1 }.into()), None);
    }

    // covers: daemon
    #[test]
    fn half_a_message_delays_no_other_sign() {
        let (master, (owner, far)) = (master(), for_tests().expect("a pair"));
        let mut child = std::process::Command::new("sleep").arg("60").spawn().expect("sleep is there");
        let end = ringcat_link::process::watch(child.id()).map(Some);
        let signs = Signs::new(child.id(), end).expect("it lives");
        std::io::Write::write_all(&mut far.stream(), b"RCTL").expect("there is room");
        let begin = Instant::now();
        let killed = std::thread::scope(|scope| {
            let served = scope.spawn(|| serve(&master, &owner, signs, Duration::from_secs(60)));
            std::thread::sleep(Duration::from_millis(50));
            child.kill().expect("it runs");
            served.join().expect("no panic")
        });
        assert_eq!((killed.how, killed.is_release), (End::Ended, false), "{}", killed.why);
        assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
        child.wait().expect("it has ended");
    }

    // covers: daemon
    #[test]
    fn an_owner_that_closes_its_connection_and_lives_may_go_on() {
        let (master, (owner, far)) = (master(), for_tests().expect("a pair"));
        let pid = std::process::id();
        let signs = || Signs::new(pid, ringcat_link::process::watch(pid).map(Some)).expect("it lives");
        far.shut_down();
        assert_eq!(serve(&master, &owner, signs(), Duration::from_secs(60)).how, End::MayGoOn);
    }

    // covers: daemon
    #[test]
    fn a_process_that_cannot_be_watched_gets_nothing() {
        for errno in [3, 24] {
            let end = Err(io::Error::from_raw_os_error(errno));
            let refused = Signs::new(std::process::id(), end).expect_err("it is not watched").to_string();
            assert!(refused.contains("cannot be watched"), "{refused}");
        }
    }
}
