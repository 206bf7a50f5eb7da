//! A client: its greeting, its queries, and its time as the owner of a master.

use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::time::Duration;

use ringcat_control::message::{Answer, Content, Message, Numbered, Owner, Query};
use ringcat_control::{Connection, Limits, ReceiveError, Refusal, Right};
use ringcat_link::process::Peer;

use crate::log::say;
use crate::master::Master;
use crate::owner::{Answered, OwnerLink};
use crate::tenure::{self, Ended, Signs};

/// A client greets within this time.
const GREETING: Duration = Duration::from_secs(5);
/// A client that says nothing for this time loses its connection.
const IDLE: Duration = Duration::from_secs(300);
/// Longest name of a program that is kept.
const LONGEST_NAME: usize = 64;

/// All masters, and what holds for their owners.
#[derive(Debug)]
pub struct Masters {
    /// The masters.
    pub all: Vec<Master>,
    /// An owner that is stopped for this time loses its master.
    pub stop_limit: Duration,
}

impl Masters {
    fn find(&self, number: u32) -> Result<&Master, Refusal> {
        let found = self.all.iter().find(|master| master.number() == number);
        let present = || self.all.iter().map(Master::number).collect();
        found.ok_or_else(|| Refusal::NoMaster { master: number, present: present() })
    }

    fn ask(&self, right: Right, question: Numbered<Query>, bytes: Vec<u8>) -> Answered {
        let Numbered { master, what, .. } = question;
        if what.right() > right {
            return Err(Refusal::ReadOnly);
        }
        match what {
            Query::Masters => Ok((Answer::Masters(self.all.iter().map(Master::state).collect()), Vec::new())),
            what => self.find(master)?.ask(what, bytes),
        }
    }
}

/// The process of a client, as it was when it connected.
#[derive(Debug)]
pub struct ClientProcess {
    /// Its number, user and groups.
    pub peer: Peer,
    /// What it may do.
    pub right: Right,
    /// Readable when it has ended.
    pub end: io::Result<Option<OwnedFd>>,
}

/// Serves a client until it closes the connection, or has made a mistake.
pub fn serve(stream: UnixStream, process: ClientProcess, masters: &Masters) {
    let Ok(connection) = Connection::new(stream).map(Arc::new) else { return };
    if let Err(refusal) = converse(&connection, process, masters) {
        // The client may have closed its end.
        let _ = connection.send(&Content::Refused(refusal).into());
    }
    connection.shut_down();
}

fn converse(connection: &Arc<Connection>, process: ClientProcess, masters: &Masters) -> Result<(), Refusal> {
    let ClientProcess { peer, right, end } = process;
    let mut program = String::new();
    let mut limit = GREETING;
    loop {
        let message = match connection.receive(Limits::CLIENT, Some(limit)) {
            Ok(received) => received,
            Err(ReceiveError::Wire(error)) => return Err(error.refusal()),
            Err(_) => return Ok(()),
        };
        match message.content {
            Content::Hello { program: name } if program.is_empty() => {
                program = name.chars().filter(|it| !it.is_control()).take(LONGEST_NAME).collect();
                limit = IDLE;
                reply(connection, Content::Welcome { right, pid: std::process::id() }.into());
            }
            _ if program.is_empty() => return Err(expected("a greeting with the name of a program")),
            Content::Query(question) => {
                let (id, master) = (question.id, question.master);
                let (what, bytes) = match masters.ask(right, question, message.bytes) {
                    Ok((answer, bytes)) => (Ok(answer), bytes),
                    Err(refusal) => (Err(refusal), Vec::new()),
                };
                reply(connection, Message { content: Content::Answer(Numbered { id, master, what }), bytes });
            }
            Content::Take { .. } if right < Right::Change => return Err(Refusal::ReadOnly),
            Content::Take { master, ethernet } => {
                let owner = Owner { pid: peer.pid, program };
                let signs = Signs::new(peer.pid, end)?;
                let owner = OwnerLink::new(master, owner, ethernet, connection.clone()).with_end(signs.end());
                return own(masters, masters.find(master)?, owner, signs);
            }
            _ => return Err(expected("a query, or a request for a master")),
        }
    }
}

/// A client that has gone is noticed by the next read.
fn reply(connection: &Connection, message: Message) {
    if connection.send(&message).is_err() {
        connection.shut_down();
    }
}

fn expected(expected: &str) -> Refusal {
    Refusal::Unexpected { expected: expected.to_owned() }
}

/// The client drives a master until its time ends.
fn own(masters: &Masters, master: &Master, owner: OwnerLink, signs: Signs) -> Result<(), Refusal> {
    let owner = Arc::new(owner);
    let tenancy = master.hand_over(&owner)?;
    say(format_args!("master {}: driven by {}", master.number(), owner.owner()));
    let Ended { how, is_release, why } = tenure::serve(master, &owner, signs, masters.stop_limit);
    tenancy.end(how);
    say(format_args!("master {}: driven by ringcatd again, {} does not: {why}", master.number(), owner.owner()));
    let content = if is_release { Content::Released } else { Content::TakenBack { cause: why.to_owned() } };
    reply(owner.connection(), content.into());
    master.prepare();
    Ok(())
}
