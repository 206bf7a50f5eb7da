//! Messages and descriptors over a Unix socket.
//!
//! A side that sends half a message loses its connection after a limit, or its message arrives in parts
//! ([`Connection::receive_part`]). Memory grows with what has arrived, not with what was announced.

use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat_link::descriptors;

use crate::arriving::Arriving;
use crate::message::Message;
pub use crate::receive_error::ReceiveError;
use crate::wire::{self, HEADER, Limits};

/// A message that has begun arrives within this time.
const WHOLE: Duration = Duration::from_secs(5);
/// A message leaves within this time.
const LEAVES: Duration = Duration::from_secs(5);

/// Bytes that are written at once: the kernel waits for the time-out for each piece of about this size.
const PART: usize = 32 << 10;

/// One end of a connection. One thread receives; any thread sends.
#[derive(Debug)]
pub struct Connection {
    stream: UnixStream,
    /// A message leaves within this time.
    leaves: Option<Duration>,
    sending: Mutex<Sending>,
    /// The end of a turn.
    turns: Condvar,
}

/// What leaves at present.
#[derive(Debug, Default)]
struct Sending {
    /// A thread has its turn: no other message comes between the parts of its own.
    is_busy: bool,
    /// The rest of a message that did not leave in time. It leaves before the next one.
    rest: Vec<u8>,
}

/// The turn of a thread to send; it ends when this is dropped.
struct Turn<'a>(&'a Connection);

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.0.sending().is_busy = false;
        self.0.turns.notify_one();
    }
}

fn timed_out() -> io::Error {
    io::ErrorKind::TimedOut.into()
}

/// The time that is left; `None` is without a limit.
fn left(until: Option<Instant>) -> io::Result<Option<Duration>> {
    let Some(until) = until else { return Ok(None) };
    let left = until.saturating_duration_since(Instant::now());
    if left.is_zero() { Err(timed_out()) } else { Ok(Some(left)) }
}

impl Connection {
    /// Messages over this socket.
    ///
    /// # Errors
    /// The system reports one.
    pub fn new(stream: UnixStream) -> io::Result<Connection> {
        stream.set_nonblocking(false)?;
        let (leaves, sending, turns) = (Some(LEAVES), Mutex::default(), Condvar::new());
        Ok(Connection { stream, leaves, sending, turns })
    }

    /// The same connection, whose messages leave when the other side reads them, however late: for an application, to
    /// which a daemon that is stopped for a while makes no difference.
    #[must_use]
    pub fn patient(self) -> Connection {
        Connection { leaves: None, ..self }
    }

    /// The socket.
    pub fn stream(&self) -> &UnixStream {
        &self.stream
    }

    /// Ends the connection in both directions; a thread that receives or sends finds its end.
    pub fn shut_down(&self) {
        // It may be closed already.
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
    }

    fn sending(&self) -> MutexGuard<'_, Sending> {
        self.sending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends a message.
    ///
    /// # Errors
    /// The other side has closed the connection, or does not read. A message of which a part has left is completed
    /// before the next one.
    pub fn send(&self, message: &Message) -> io::Result<()> {
        self.send_until(message, &[], self.leaves)
    }

    /// Sends a message that leaves within this time.
    ///
    /// # Errors
    /// As [`Connection::send`].
    pub fn send_within(&self, message: &Message, limit: Duration) -> io::Result<()> {
        self.send_until(message, &[], Some(limit))
    }

    /// Sends a message with duplicates of descriptors.
    ///
    /// # Errors
    /// As [`Connection::send`].
    pub fn send_with(&self, message: &Message, descriptors: &[RawFd]) -> io::Result<()> {
        self.send_until(message, descriptors, self.leaves)
    }

    fn send_until(&self, message: &Message, descriptors: &[RawFd], limit: Option<Duration>) -> io::Result<()> {
        let bytes = wire::encode(message).map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
        let until = limit.map(|limit| Instant::now() + limit);
        let _turn = self.turn(until)?;
        let rest = std::mem::take(&mut self.sending().rest);
        self.write_or_keep(&rest, until)?;
        // The header is short: it leaves at once, with the descriptors.
        loop {
            self.stream.set_write_timeout(left(until)?)?;
            match descriptors::send(&self.stream, &bytes[..HEADER], descriptors) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                sent => break sent?,
            }
        }
        self.write_or_keep(&bytes[HEADER..], until)
    }

    /// Waits until no other thread sends.
    fn turn(&self, until: Option<Instant>) -> io::Result<Turn<'_>> {
        let mut sending = self.sending();
        while sending.is_busy {
            sending = match left(until)? {
                Some(left) => self.turns.wait_timeout(sending, left).unwrap_or_else(PoisonError::into_inner).0,
                None => self.turns.wait(sending).unwrap_or_else(PoisonError::into_inner),
            };
        }
        sending.is_busy = true;
        Ok(Turn(self))
    }

    /// Writes bytes; those that do not leave in time are kept for the next turn.
    fn write_or_keep(&self, bytes: &[u8], until: Option<Instant>) -> io::Result<()> {
        let mut rest = bytes;
        while !rest.is_empty() {
            let written = left(until).and_then(|left| {
                self.stream.set_write_timeout(left)?;
                (&self.stream).write(&rest[..PART.min(rest.len())])
            });
            match written {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(written) => rest = &rest[written..],
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => {
                    self.sending().rest = rest.to_vec();
                    return Err(if error.kind() == io::ErrorKind::WouldBlock { timed_out() } else { error });
                }
            }
        }
        Ok(())
    }

    /// Receives a message, whose first byte comes within `limit`. Descriptors that come with it are closed by the
    /// kernel: this process never has them.
    ///
    /// # Errors
    /// See [`ReceiveError`]. Nothing more can be received then, except after a time-out before the first byte.
    pub fn receive(&self, limits: Limits, limit: Option<Duration>) -> Result<Message, ReceiveError> {
        self.receive_by(limits, limit, |bytes| (&self.stream).read(bytes))
    }

    /// Receives a message with its descriptors, as [`Connection::receive`]. For messages of a daemon: another sender
    /// could fill the table of descriptors of this process.
    ///
    /// # Errors
    /// As [`Connection::receive`].
    pub fn receive_with_descriptors(
        &self,
        limits: Limits,
        limit: Option<Duration>,
    ) -> Result<(Message, Vec<OwnedFd>), ReceiveError> {
        let mut all = Vec::new();
        let message = self.receive_by(limits, limit, |bytes| {
            let (read, descriptors) = descriptors::receive(&self.stream, bytes)?;
            all.extend(descriptors);
            Ok(read)
        })?;
        Ok((message, all))
    }

    fn receive_by(
        &self,
        limits: Limits,
        limit: Option<Duration>,
        mut read: impl FnMut(&mut [u8]) -> io::Result<usize>,
    ) -> Result<Message, ReceiveError> {
        let mut arriving = Arriving::new(limits);
        self.stream.set_read_timeout(limit)?;
        let mut until = None;
        loop {
            if let Some(message) = arriving.read_part(&mut read)? {
                return Ok(message);
            }
            if arriving.has_begun() {
                let until = *until.get_or_insert_with(|| Instant::now() + WHOLE);
                self.stream.set_read_timeout(left(Some(until))?)?;
            }
        }
    }

    /// Takes a part of a message that has arrived, without waiting for more: to be called when the socket is readable.
    /// The whole message, when its last part is there.
    ///
    /// # Errors
    /// See [`ReceiveError`]. Nothing more can be received then.
    pub fn receive_part(&self, arriving: &mut Arriving) -> Result<Option<Message>, ReceiveError> {
        arriving.read_part(|bytes| (&self.stream).read(bytes))
    }

    /// The same with descriptors, which are appended to `all`: those of a message come with its beginning. For messages
    /// of a daemon, as [`Connection::receive_with_descriptors`].
    ///
    /// # Errors
    /// As [`Connection::receive_part`].
    pub fn receive_part_with_descriptors(
        &self,
        arriving: &mut Arriving,
        all: &mut Vec<OwnedFd>,
    ) -> Result<Option<Message>, ReceiveError> {
        arriving.read_part(|bytes| {
            let (read, descriptors) = descriptors::receive(&self.stream, bytes)?;
            all.extend(descriptors);
            Ok(read)
        })
    }
}

impl AsFd for Connection {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use std::os::fd::AsRawFd;

    use super::*;
    use crate::message::Content;

    fn pair() -> (Connection, Connection) {
        let (near, far) = UnixStream::pair().expect("a pair");
        (Connection::new(near).expect("a socket"), Connection::new(far).expect("a socket"))
    }

    // covers: daemon
    #[test]
    fn messages_of_any_length_arrive_in_order_with_their_descriptors() {
        let (near, far) = pair();
        let long = Message { content: Content::Knowledge, bytes: vec![7; 3 << 20] };
        let sent = long.clone();
        let sender = std::thread::spawn(move || {
            near.send_with(&sent, &[0, 1]).expect("it is read");
            near.send(&Content::Take { master: 1, ethernet: true }.into()).expect("it is read");
        });
        let (first, descriptors) = far.receive_with_descriptors(Limits::OWNER, None).expect("it is sent");
        assert!(first == long && descriptors.len() == 2);
        let (second, descriptors) = far.receive_with_descriptors(Limits::OWNER, None).expect("it is sent");
        assert_eq!((second, descriptors.len()), (Content::Take { master: 1, ethernet: true }.into(), 0));
        sender.join().expect("no panic");
        assert!(matches!(far.receive(Limits::OWNER, None), Err(ReceiveError::Ended)));
    }

    // covers: daemon
    #[test]
    fn half_a_message_and_silence_end_after_their_limits() {
        let (near, far) = pair();
        let limit = Some(Duration::from_millis(20));
        assert!(matches!(far.receive(Limits::CLIENT, limit), Err(ReceiveError::TimedOut)));
        let whole = wire::encode(&Content::Take { master: 1, ethernet: true }.into()).expect("it is short");
        (&near.stream).write_all(&whole[..12]).expect("there is room");
        let begin = Instant::now();
        assert!(matches!(far.receive(Limits::CLIENT, limit), Err(ReceiveError::TimedOut)));
        assert!((WHOLE..2 * WHOLE).contains(&begin.elapsed()));
        drop(near);
    }

    // covers: daemon
    #[test]
    fn descriptors_that_are_not_expected_are_never_in_this_process() {
        let (near, far) = pair();
        let (held, other_end) = UnixStream::pair().expect("a pair");
        near.send_with(&Content::Take { master: 1, ethernet: true }.into(), &[held.as_raw_fd(); descriptors::MOST])
            .expect("room");
        drop(held);
        // Only the messages have duplicates now. The connection is open, so they end when the message is received.
        far.receive(Limits::CLIENT, None).expect("it is sent");
        other_end.set_read_timeout(Some(Duration::from_millis(1))).expect("a socket");
        assert_eq!((&other_end).read(&mut [0]).expect("the end"), 0);
    }

    // covers: daemon
    #[test]
    fn a_message_that_leaves_late_is_completed_before_the_next_one() {
        let (near, far) = pair();
        let long = Message { content: Content::Knowledge, bytes: vec![7; 3 << 20] };
        let failed = near.send_within(&long, Duration::from_millis(50)).expect_err("nothing reads");
        assert_eq!(failed.kind(), io::ErrorKind::TimedOut);
        let begin = Instant::now();
        let failed = near.send_within(&Content::Released.into(), Duration::from_millis(50)).expect_err("nothing reads");
        assert_eq!(failed.kind(), io::ErrorKind::TimedOut);
        assert!(begin.elapsed() < LEAVES);
        let near = near.patient();
        let sender = std::thread::spawn(move || near.send(&Content::Take { master: 1, ethernet: true }.into()));
        assert_eq!(far.receive(Limits::OWNER, None).expect("it is whole"), long);
        assert_eq!(
            far.receive(Limits::OWNER, None).expect("it is sent"),
            Content::Take { master: 1, ethernet: true }.into()
        );
        sender.join().expect("no panic").expect("it is read");
    }

    // covers: daemon
    #[test]
    fn one_limit_holds_for_a_message_however_slowly_it_is_read() {
        let (near, far) = pair();
        let long = Message { content: Content::Knowledge, bytes: vec![7; 3 << 20] };
        let reader = std::thread::spawn(move || {
            let mut part = [0; 4096];
            while (&far.stream).read(&mut part).is_ok_and(|read| read > 0) {
                std::thread::sleep(Duration::from_millis(10));
            }
        });
        let begin = Instant::now();
        near.send_within(&long, Duration::from_millis(300)).expect_err("it is read too slowly");
        let took = begin.elapsed();
        near.shut_down();
        reader.join().expect("no panic");
        assert!(took < Duration::from_secs(3), "{took:?}");
    }

    // covers: daemon
    #[test]
    fn parts_of_messages_are_taken_without_waiting_for_the_rest() {
        let (near, far) = pair();
        let message = Message { content: Content::Take { master: 9, ethernet: true }, bytes: vec![1, 2, 3] };
        let bytes = wire::encode(&message).expect("it is short");
        let mut arriving = Arriving::new(Limits::CLIENT);
        for _ in 0..2 {
            let mut whole = Vec::new();
            for byte in &bytes {
                assert!(whole.is_empty());
                (&near.stream).write_all(&[*byte]).expect("there is room");
                // The header and the two parts behind it are read one by one.
                whole.extend(far.receive_part(&mut arriving).expect("it is right"));
            }
            assert_eq!(whole, std::slice::from_ref(&message));
            assert!(!arriving.has_begun());
        }
    }
}
