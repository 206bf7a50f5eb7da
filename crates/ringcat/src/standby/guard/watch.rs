//! The order of a guard, and the watch that it keeps.

use std::io::{self, ErrorKind, Read};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use ringcat_link::descriptors;
use ringcat_link::heartbeat::Heartbeat;
use ringcat_link::process::wait_readable;

use super::silence::Silence;

/// Message of a program: its guard is to end.
pub(super) const RELEASED: u8 = b'0';
/// Message of a program: from now on only its end counts, not its silence.
pub(super) const UNTIMED: u8 = b'-';
/// Looks at the heartbeat within the limit.
const LOOKS_PER_LIMIT: u32 = 8;
/// Shortest interval of checks.
const SHORTEST_LOOK: Duration = Duration::from_micros(100);
/// Longest order: a limit, and two names of interfaces.
const LONGEST_ORDER: usize = 256;

/// How a guard has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Ending {
    /// It has not begun: it cannot do what it is to do, and has sent the program the reason.
    Refused,
    /// The program has released it: it has not acted.
    Released,
    /// The process has ended.
    Died,
    /// The process was silent for the limit: it hangs, or a signal has stopped it.
    Hung,
}

/// What a guard is to do.
#[derive(Debug)]
pub(super) struct Order {
    pub heartbeat: Heartbeat,
    limit: Duration,
    pub interfaces: Vec<String>,
}

impl Order {
    /// The words of an order: the limit in nanoseconds and the interfaces, a line each.
    pub(super) fn in_words(interfaces: &[&str], limit: Duration) -> String {
        let limit_ns = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        format!("{limit_ns}\n{}", interfaces.join("\n"))
    }

    /// Takes the order with the heartbeat.
    ///
    /// # Errors
    /// No valid order has arrived.
    pub(super) fn receive(stream: &UnixStream) -> io::Result<Order> {
        let wrong = || io::Error::new(ErrorKind::InvalidData, "expected an order of the program that is to be guarded");
        let mut bytes = [0; LONGEST_ORDER];
        let (length, mut descriptors) = descriptors::receive(stream, &mut bytes)?;
        let words = std::str::from_utf8(&bytes[..length]).map_err(|_| wrong())?;
        let mut lines = words.lines();
        let limit_ns = lines.next().and_then(|line| line.parse().ok()).ok_or_else(wrong)?;
        let memory = descriptors.pop().ok_or_else(wrong)?;
        let interfaces: Vec<String> = lines.map(str::to_owned).collect();
        if interfaces.is_empty() {
            return Err(wrong());
        }
        Ok(Order { heartbeat: Heartbeat::adopt(memory)?, limit: Duration::from_nanos(limit_ns), interfaces })
    }

    /// Watches a process until it releases the guard, ends or hangs. `end` is readable when it has ended; where the
    /// system has none, the end of the stream shows it.
    pub(super) fn watch(&self, stream: &UnixStream, end: Option<&OwnedFd>) -> Ending {
        let interval = (self.limit / LOOKS_PER_LIMIT).max(SHORTEST_LOOK);
        let both = [stream.as_fd(), end.map_or(stream.as_fd(), OwnedFd::as_fd)];
        let mut silence = Silence::new(Instant::now(), interval);
        let mut is_timed = true;
        loop {
            let ready = wait_readable(&both, interval);
            if ready != 0 {
                // A message of the process before its end counts.
                match read(stream) {
                    Said::Released => return Ending::Released,
                    Said::Ended => return Ending::Died,
                    Said::Untimed => is_timed = false,
                    Said::Nothing if end.is_some() && ready & 0b10 != 0 => return Ending::Died,
                    Said::Nothing => {}
                }
            }
            if is_timed && silence.look(self.heartbeat.beats(), Instant::now()) >= self.limit {
                return Ending::Hung;
            }
        }
    }
}

/// The message of a process.
enum Said {
    Nothing,
    Released,
    Untimed,
    Ended,
}

fn read(mut stream: &UnixStream) -> Said {
    let mut byte = [0];
    match stream.read(&mut byte) {
        Ok(1) if byte == [RELEASED] => Said::Released,
        Ok(1) if byte == [UNTIMED] => Said::Untimed,
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Said::Nothing,
        // The end of the stream, or what no program sends that uses this library.
        _ => Said::Ended,
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::os::fd::AsRawFd;
    use std::process::Command;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread::{JoinHandle, sleep, spawn};

    use super::*;

    const LIMIT: Duration = Duration::from_millis(200);
    const LONG: Duration = Duration::from_secs(3600);

    /// A guard that watches, in a thread: the near end of its stream, the heartbeat, how and when it ends.
    fn guarded(limit: Duration, end: Option<OwnedFd>) -> (UnixStream, Heartbeat, JoinHandle<(Ending, Duration)>) {
        let (near, far) = UnixStream::pair().expect("a pair");
        let heartbeat = Heartbeat::new().expect("there is memory");
        let words = Order::in_words(&["eth1", "eth2"], limit);
        descriptors::send(&near, words.as_bytes(), &[heartbeat.as_fd().as_raw_fd()]).expect("it is sent");
        let order = Order::receive(&far).expect("it is complete");
        assert_eq!((order.limit, order.interfaces.as_slice()), (limit, &["eth1".to_owned(), "eth2".to_owned()][..]));
        far.set_nonblocking(true).expect("it is a socket");
        let begin = Instant::now();
        let watch = spawn(move || (order.watch(&far, end.as_ref()), begin.elapsed()));
        (near, heartbeat, watch)
    }

    // covers: standby, MR-21
    #[test]
    fn a_guard_detects_the_end_of_the_stream_and_a_release_at_once() {
        let (near, _heartbeat, watch) = guarded(LONG, None);
        drop(near);
        assert_eq!(watch.join().expect("no panic").0, Ending::Died);
        let (mut near, _heartbeat, watch) = guarded(LONG, None);
        near.write_all(&[RELEASED]).expect("it is open");
        drop(near);
        assert_eq!(watch.join().expect("no panic").0, Ending::Released);
    }

    // covers: standby, MR-21
    #[test]
    fn a_guard_detects_the_end_of_the_process_although_a_child_keeps_the_stream() {
        let mut child = Command::new("sleep").arg("60").spawn().expect("sleep is there");
        let end = ringcat_link::process::watch(child.id()).expect("it lives");
        let (near, _heartbeat, watch) = guarded(LONG, Some(end));
        sleep(Duration::from_millis(50));
        assert!(!watch.is_finished());
        child.kill().expect("it runs");
        child.wait().expect("it ends");
        assert_eq!(watch.join().expect("no panic").0, Ending::Died);
        drop(near);
    }

    // covers: standby, MR-21
    #[test]
    fn a_guard_lets_a_heart_beat_and_acts_when_it_is_silent_for_the_limit() {
        let (_near, heartbeat, watch) = guarded(LIMIT, None);
        let ends = Arc::new(AtomicBool::new(false));
        let beats = spawn({
            let ends = ends.clone();
            move || {
                while !ends.load(Ordering::Relaxed) {
                    assert!(heartbeat.beat());
                    sleep(Duration::from_millis(1));
                }
                heartbeat
            }
        });
        sleep(LIMIT * 3);
        assert!(!watch.is_finished(), "it beats");
        ends.store(true, Ordering::Relaxed);
        let _heartbeat = beats.join().expect("it was not revoked");
        let (ending, lasted) = watch.join().expect("no panic");
        assert_eq!(ending, Ending::Hung);
        assert!(lasted >= LIMIT * 4 - LIMIT / LOOKS_PER_LIMIT * 2, "{lasted:?}");
    }

    // covers: standby, MR-21
    #[test]
    fn a_program_that_takes_its_time_is_watched_for_its_end_alone() {
        let (mut near, heartbeat, watch) = guarded(LIMIT, None);
        assert!(heartbeat.beat());
        near.write_all(&[UNTIMED]).expect("it is open");
        sleep(LIMIT * 3);
        assert!(!watch.is_finished(), "its silence does not count");
        drop(near);
        assert_eq!(watch.join().expect("no panic").0, Ending::Died);
    }

    // covers: standby, MR-21
    #[test]
    fn what_is_no_order_is_refused() {
        for (words, has_memory) in [("", true), ("x\neth1", true), ("5", true), ("5\neth1", false), ("\u{fffd}", true)]
        {
            let (near, far) = UnixStream::pair().expect("a pair");
            let heartbeat = Heartbeat::new().expect("there is memory");
            let memory = [heartbeat.as_fd().as_raw_fd()];
            // An empty message is no message: the stream ends.
            let _ = descriptors::send(&near, words.as_bytes(), if has_memory { &memory } else { &[] });
            drop(near);
            assert!(Order::receive(&far).is_err(), "{words:?}");
        }
    }
}
