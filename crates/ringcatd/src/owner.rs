//! An application that drives a master, on the side of the daemon: queries to it, and their answers.
//!
//! The queries that an owner has not answered yet are bounded in number and in bytes, so a message to the owner always
//! fits into the socket, and a stopped owner delays each client by one second at most. Further queries wait for a
//! place.

use std::collections::BTreeMap;
use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat_control::message::{Answer, Content, Message, Numbered, Owner, Query};
use ringcat_control::{Connection, Refusal, Right};
use ringcat_link::process::wait_readable;

/// An owner takes a query within this time.
pub const SILENCE: Duration = Duration::from_secs(1);
/// Maximum number of pending queries.
const MAX_PENDING: usize = 16;
/// Maximum number of pending queries that only read: so there is always a place for the others.
const MAX_READING: usize = 12;
/// Maximum number of bytes in pending queries: half of the default size of a socket buffer.
const MAX_BYTES: usize = 96 << 10;

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
    queries: Mutex<PendingQueries>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct PendingQueries {
    last: u32,
    open: BTreeMap<u32, PendingQuery>,
    /// The owner does not drive the master any more.
    is_over: bool,
}

/// A query that has no answer yet.
#[derive(Debug)]
struct PendingQuery {
    bytes: usize,
    state: QueryState,
}

#[derive(Debug)]
enum QueryState {
    Sent,
    UnderWay,
    Answered(Answered),
    /// The client has given up.
    Forgotten,
}

impl OwnerLink {
    /// The process at the other end of this connection.
    pub fn new(master: u32, owner: Owner, moves_ethernet: bool, connection: Arc<Connection>) -> OwnerLink {
        let (queries, changed) = (Mutex::default(), Condvar::new());
        OwnerLink { master, owner, moves_ethernet, connection, end: None, queries, changed }
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

    fn queries(&self) -> MutexGuard<'_, PendingQueries> {
        self.queries.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a query, and waits for the answer: a second for a sign, longer for the result of what it has begun.
    ///
    /// # Errors
    /// The owner refuses, is silent, or has ended.
    pub fn ask(&self, what: Query, bytes: Vec<u8>) -> Answered {
        let (master, size, limit) = (self.master, bytes.len(), what.limit());
        let mut queries = self.place(size, what.right())?;
        queries.last = queries.last.wrapping_add(1);
        let id = queries.last;
        queries.open.insert(id, PendingQuery { bytes: size, state: QueryState::Sent });
        drop(queries);
        let message = Message { content: Content::Query(Numbered { id, master, what }), bytes };
        match self.connection.send_within(&message, SILENCE) {
            Ok(()) => self.wait(id, limit),
            // A part of it may have left: the rest follows, and so may an answer.
            Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                if let Some(query) = self.queries().open.get_mut(&id) {
                    query.state = QueryState::Forgotten;
                }
                let limit_ms = SILENCE.as_millis() as u32;
                Err(Refusal::Silent { master, owner: self.owner.clone(), limit_ms })
            }
            Err(_) => {
                self.queries().open.remove(&id);
                self.changed.notify_all();
                Err(Refusal::Changing { master })
            }
        }
    }

    /// Waits until the owner may have another query of this size.
    fn place(&self, size: usize, right: Right) -> Result<MutexGuard<'_, PendingQueries>, Refusal> {
        let begin = Instant::now();
        let most = if right == Right::Read { MAX_READING } else { MAX_PENDING };
        let mut queries = self.queries();
        loop {
            if queries.is_over {
                return Err(Refusal::Changing { master: self.master });
            }
            let waiting: usize = queries.open.values().map(|query| query.bytes).sum();
            if queries.open.len() < most && waiting + size <= MAX_BYTES {
                return Ok(queries);
            }
            let left = SILENCE.saturating_sub(begin.elapsed());
            if left.is_zero() || size > MAX_BYTES {
                return Err(Refusal::TooManyQueries { master: self.master, owner: self.owner.clone() });
            }
            queries = self.changed.wait_timeout(queries, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Waits for the answer to a query that may take `answer`.
    fn wait(&self, id: u32, answer: Duration) -> Answered {
        let begin = Instant::now();
        let mut queries = self.queries();
        loop {
            let Some(query) = queries.open.get_mut(&id) else {
                return Err(Refusal::Changing { master: self.master });
            };
            let limit = match query.state {
                QueryState::Answered(_) => {
                    let answered = queries.open.remove(&id).map(|query| query.state);
                    let Some(QueryState::Answered(answered)) = answered else { continue };
                    // There is room for another query.
                    self.changed.notify_all();
                    return answered;
                }
                QueryState::UnderWay => answer,
                QueryState::Sent | QueryState::Forgotten => SILENCE,
            };
            let left = limit.saturating_sub(begin.elapsed());
            if left.is_zero() {
                query.state = QueryState::Forgotten;
                let limit_ms = limit.as_millis() as u32;
                return Err(Refusal::Silent { master: self.master, owner: self.owner.clone(), limit_ms });
            }
            queries = self.changed.wait_timeout(queries, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// The owner has taken a query.
    pub fn taken(&self, id: u32) {
        if let Some(query) = self.queries().open.get_mut(&id)
            && matches!(query.state, QueryState::Sent)
        {
            query.state = QueryState::UnderWay;
            self.changed.notify_all();
        }
    }

    /// The owner has answered. Answers that nothing waits for are dropped.
    pub fn answered(&self, id: u32, answer: Answered) {
        let mut queries = self.queries();
        match queries.open.get_mut(&id) {
            Some(PendingQuery { state: QueryState::Forgotten, .. }) => {
                queries.open.remove(&id);
                self.changed.notify_all();
            }
            Some(query) if !matches!(query.state, QueryState::Answered(_)) => {
                query.state = QueryState::Answered(answer);
                self.changed.notify_all();
            }
            Some(_) | None => {}
        }
    }

    /// The owner does not drive the master any more: all that wait for it get an answer.
    pub fn end(&self) {
        let mut queries = self.queries();
        queries.is_over = true;
        queries.open.clear();
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

    const QUERY: Query = Query::AlStatus { position: 1 };

    // covers: daemon
    #[test]
    fn a_silent_owner_is_reported_after_a_second_and_its_queries_are_bounded() {
        let (owner, _far) = for_tests().expect("a pair");
        let owner = Arc::new(owner);
        let begin = Instant::now();
        let all: Vec<_> = (0..MAX_READING)
            .map(|_| {
                let owner = owner.clone();
                thread::spawn(move || owner.ask(QUERY, Vec::new()))
            })
            .collect();
        for one in all {
            let refused = one.join().expect("no panic").expect_err("nothing answers").to_string();
            assert_eq!(refused, "master 0: \"test\" (process 42) drives it and has not answered for 1000 ms");
        }
        assert!((SILENCE..2 * SILENCE).contains(&begin.elapsed()));
        let begin = Instant::now();
        assert!(matches!(owner.ask(QUERY, Vec::new()), Err(Refusal::TooManyQueries { .. })));
        assert!(begin.elapsed() < 2 * SILENCE);
        let refused = owner.ask(Query::Rescan, Vec::new()).expect_err("nothing answers");
        assert!(matches!(refused, Refusal::Silent { .. }), "queries that change have places of their own: {refused}");
    }

    // covers: daemon
    #[test]
    fn answers_reach_their_queries_in_any_order_and_late_ones_are_dropped() {
        let (owner, far) = for_tests().expect("a pair");
        let owner = Arc::new(owner);
        let asking = owner.clone();
        let first = thread::spawn(move || asking.ask(QUERY, vec![1]));
        let query = far.receive(Limits::OWNER, None).expect("it is asked");
        let Content::Query(Numbered { id, .. }) = query.content else { panic!("{query:?}") };
        owner.taken(id);
        owner.answered(id + 1, Ok((Answer::Done, Vec::new())));
        thread::sleep(SILENCE + Duration::from_millis(100));
        owner.answered(id, Ok((Answer::Data, vec![7])));
        owner.answered(id, Ok((Answer::Done, Vec::new())));
        assert_eq!(first.join().expect("no panic"), Ok((Answer::Data, vec![7])));
        assert!(owner.ask(QUERY, vec![0; MAX_BYTES + 1]).is_err());
        let asking = owner.clone();
        let last = thread::spawn(move || asking.ask(QUERY, Vec::new()));
        far.receive(Limits::OWNER, None).expect("it is asked");
        owner.end();
        assert_eq!(last.join().expect("no panic"), Err(Refusal::Changing { master: 0 }));
        assert_eq!(owner.ask(QUERY, Vec::new()), Err(Refusal::Changing { master: 0 }));
    }
}
