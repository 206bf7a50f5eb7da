//! An application that drives a master, on the side of the daemon: queries to it, and their answers.
//!
//! What an owner has not answered yet is bounded in number and in bytes, so a message to it always finds room in the
//! socket, and an owner that is stopped costs each client one second at most. Further questions wait for a place.

use std::collections::BTreeMap;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat_control::message::{Answer, Content, Message, Numbered, Owner, Query};
use ringcat_control::{Connection, Refusal, Right};
use ringcat_link::process::wait_readable;

/// An owner takes a question within this time.
pub const SILENCE: Duration = Duration::from_secs(1);
/// Questions that it may have at a time.
const MOST_QUESTIONS: usize = 16;
/// Those of them that only read: the others always find a place.
const MOST_READING: usize = 12;
/// Bytes of questions that it may have at a time: half of what a socket holds by default.
const MOST_BYTES: usize = 96 << 10;

/// An answer with its data.
pub type Answered = Result<(Answer, Vec<u8>), Refusal>;

/// An application that drives a master.
#[derive(Debug)]
pub struct OwnerLink {
    master: u32,
    owner: Owner,
    /// It moves frames of EoE.
    moves_ethernet: bool,
    connection: Arc<Connection>,
    /// Readable when its process has ended; there is no such descriptor of a process in another name space.
    end: Option<OwnedFd>,
    questions: Mutex<Questions>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Questions {
    last: u32,
    open: BTreeMap<u32, Question>,
    /// The owner does not drive the master any more.
    is_over: bool,
}

/// A question that has no answer yet.
#[derive(Debug)]
struct Question {
    bytes: usize,
    state: Standing,
}

#[derive(Debug)]
enum Standing {
    Sent,
    UnderWay,
    Answered(Answered),
    /// The client has given up.
    Forgotten,
}

impl OwnerLink {
    /// The process at the other end of this connection.
    pub fn new(master: u32, owner: Owner, moves_ethernet: bool, connection: Arc<Connection>) -> OwnerLink {
        let (questions, changed) = (Mutex::default(), Condvar::new());
        OwnerLink { master, owner, moves_ethernet, connection, end: None, questions, changed }
    }

    /// With the descriptor that shows the end of its process.
    pub fn with_end(self, end: Option<OwnedFd>) -> OwnerLink {
        OwnerLink { end, ..self }
    }

    /// Its process has ended, as far as that can be seen.
    pub fn has_ended(&self) -> bool {
        self.end.as_ref().is_some_and(|end| wait_readable(&[end.as_fd()], Duration::ZERO) == 1)
    }

    /// Whether it moves frames between network interfaces of EoE and mailboxes.
    pub fn moves_ethernet(&self) -> bool {
        self.moves_ethernet
    }

    /// The application.
    pub fn owner(&self) -> &Owner {
        &self.owner
    }

    /// The connection to it.
    pub fn connection(&self) -> &Connection {
        &self.connection
    }

    fn questions(&self) -> MutexGuard<'_, Questions> {
        self.questions.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a query, and waits for the answer: a second for a sign, longer for the result of what it has begun.
    ///
    /// # Errors
    /// The owner refuses, is silent, or has ended.
    pub fn ask(&self, what: Query, bytes: Vec<u8>) -> Answered {
        let (master, size, limit) = (self.master, bytes.len(), what.limit());
        let mut questions = self.place(size, what.right())?;
        questions.last = questions.last.wrapping_add(1);
        let id = questions.last;
        questions.open.insert(id, Question { bytes: size, state: Standing::Sent });
        drop(questions);
        let message = Message { content: Content::Query(Numbered { id, master, what }), bytes };
        match self.connection.send_within(&message, SILENCE) {
            Ok(()) => self.wait(id, limit),
            // A part of it may have left: the rest follows, and so may an answer.
            Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                if let Some(question) = self.questions().open.get_mut(&id) {
                    question.state = Standing::Forgotten;
                }
                let limit_ms = SILENCE.as_millis() as u32;
                Err(Refusal::Silent { master, owner: self.owner.clone(), limit_ms })
            }
            Err(_) => {
                self.questions().open.remove(&id);
                self.changed.notify_all();
                Err(Refusal::Changing { master })
            }
        }
    }

    /// Waits until the owner may have another question of this size.
    fn place(&self, size: usize, right: Right) -> Result<MutexGuard<'_, Questions>, Refusal> {
        let begin = Instant::now();
        let most = if right == Right::Read { MOST_READING } else { MOST_QUESTIONS };
        let mut questions = self.questions();
        loop {
            if questions.is_over {
                return Err(Refusal::Changing { master: self.master });
            }
            let waiting: usize = questions.open.values().map(|question| question.bytes).sum();
            if questions.open.len() < most && waiting + size <= MOST_BYTES {
                return Ok(questions);
            }
            let left = SILENCE.saturating_sub(begin.elapsed());
            if left.is_zero() || size > MOST_BYTES {
                return Err(Refusal::TooManyQuestions { master: self.master, owner: self.owner.clone() });
            }
            questions = self.changed.wait_timeout(questions, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Waits for the answer to a question that may take `answer`.
    fn wait(&self, id: u32, answer: Duration) -> Answered {
        let begin = Instant::now();
        let mut questions = self.questions();
        loop {
            let Some(question) = questions.open.get_mut(&id) else {
                return Err(Refusal::Changing { master: self.master });
            };
            let limit = match question.state {
                Standing::Answered(_) => {
                    let answered = questions.open.remove(&id).map(|question| question.state);
                    let Some(Standing::Answered(answered)) = answered else { continue };
                    // There is room for another question.
                    self.changed.notify_all();
                    return answered;
                }
                Standing::UnderWay => answer,
                Standing::Sent | Standing::Forgotten => SILENCE,
            };
            let left = limit.saturating_sub(begin.elapsed());
            if left.is_zero() {
                question.state = Standing::Forgotten;
                let limit_ms = limit.as_millis() as u32;
                return Err(Refusal::Silent { master: self.master, owner: self.owner.clone(), limit_ms });
            }
            questions = self.changed.wait_timeout(questions, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// The owner has taken a question.
    pub fn taken(&self, id: u32) {
        if let Some(question) = self.questions().open.get_mut(&id)
            && matches!(question.state, Standing::Sent)
        {
            question.state = Standing::UnderWay;
            self.changed.notify_all();
        }
    }

    /// The owner has answered. Answers that nothing waits for are dropped.
    pub fn answered(&self, id: u32, answer: Answered) {
        let mut questions = self.questions();
        match questions.open.get_mut(&id) {
            Some(Question { state: Standing::Forgotten, .. }) => {
                questions.open.remove(&id);
                self.changed.notify_all();
            }
            Some(question) if !matches!(question.state, Standing::Answered(_)) => {
                question.state = Standing::Answered(answer);
                self.changed.notify_all();
            }
            Some(_) | None => {}
        }
    }

    /// The owner does not drive the master any more: all that wait for it get an answer.
    pub fn end(&self) {
        let mut questions = self.questions();
        questions.is_over = true;
        questions.open.clear();
        self.changed.notify_all();
    }
}

/// A connection whose other end a test plays.
///
/// # Errors
/// The system reports one.
#[doc(hidden)]
pub fn for_tests() -> io::Result<(OwnerLink, Connection)> {
    let (near, far) = UnixStream::pair()?;
    let owner = Owner { pid: 42, program: "test".to_owned() };
    Ok((OwnerLink::new(0, owner, false, Arc::new(Connection::new(near)?)), Connection::new(far)?))
}

/// The same of a process whose end this descriptor shows.
#[cfg(test)]
pub fn for_tests_of(end: OwnedFd) -> io::Result<(OwnerLink, Connection)> {
    for_tests().map(|(owner, far)| (owner.with_end(Some(end)), far))
}

#[cfg(test)]
mod tests {
    use std::thread;

    use ringcat_control::Limits;

    use super::*;

    const QUESTION: Query = Query::AlStatus { position: 1 };

    // covers: daemon
    #[test]
    fn a_silent_owner_is_named_after_a_second_and_holds_a_bounded_number_of_questions() {
        let (owner, _far) = for_tests().expect("a pair");
        let owner = Arc::new(owner);
        let begin = Instant::now();
        let all: Vec<_> = (0..MOST_READING)
            .map(|_| {
                let owner = owner.clone();
                thread::spawn(move || owner.ask(QUESTION, Vec::new()))
            })
            .collect();
        for one in all {
            let refused = one.join().expect("no panic").expect_err("nothing answers").to_string();
            assert_eq!(refused, "master 0: \"test\" (process 42) drives it and has not answered for 1000 ms");
        }
        assert!((SILENCE..2 * SILENCE).contains(&begin.elapsed()));
        let begin = Instant::now();
        assert!(matches!(owner.ask(QUESTION, Vec::new()), Err(Refusal::TooManyQuestions { .. })));
        assert!(begin.elapsed() < 2 * SILENCE);
        let refused = owner.ask(Query::Rescan, Vec::new()).expect_err("nothing answers");
        assert!(matches!(refused, Refusal::Silent { .. }), "questions that change have places of their own: {refused}");
    }

    // covers: daemon
    #[test]
    fn answers_reach_their_questions_in_any_order_and_late_ones_nothing() {
        let (owner, far) = for_tests().expect("a pair");
        let owner = Arc::new(owner);
        let asking = owner.clone();
        let first = thread::spawn(move || asking.ask(QUESTION, vec![1]));
        let question = far.receive(Limits::OWNER, None).expect("it is asked");
        let Content::Query(Numbered { id, .. }) = question.content else { panic!("{question:?}") };
        owner.taken(id);
        owner.answered(id + 1, Ok((Answer::Done, Vec::new())));
        thread::sleep(SILENCE + Duration::from_millis(100));
        owner.answered(id, Ok((Answer::Data, vec![7])));
        owner.answered(id, Ok((Answer::Done, Vec::new())));
        assert_eq!(first.join().expect("no panic"), Ok((Answer::Data, vec![7])));
        assert!(owner.ask(QUESTION, vec![0; MOST_BYTES + 1]).is_err());
        let asking = owner.clone();
        let last = thread::spawn(move || asking.ask(QUESTION, Vec::new()));
        far.receive(Limits::OWNER, None).expect("it is asked");
        owner.end();
        assert_eq!(last.join().expect("no panic"), Err(Refusal::Changing { master: 0 }));
        assert_eq!(owner.ask(QUESTION, Vec::new()), Err(Refusal::Changing { master: 0 }));
    }
}
