//! What drives a master: one process at a time, and nothing while it passes from one to another.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ringcat_control::Refusal;

use crate::driving::Driving;
use crate::opened::Opened;
use crate::owner::OwnerLink;

/// Longest wait of an application that requests a master while it passes from another process to the daemon. That takes
/// milliseconds, and longer on a busy machine.
pub const CHANGE: Duration = Duration::from_secs(5);

/// What drives a master.
#[derive(Debug)]
pub enum Driver {
    /// This daemon, with descriptors for the next owner.
    Daemon(Driving, Arc<Opened>),
    /// An application, with the descriptors that it has.
    Owner(Arc<OwnerLink>, Arc<Opened>),
    /// The master passes from one process to another.
    Changing,
    /// No process, for this reason.
    Fault(String),
}

/// What drives a master now.
#[derive(Debug)]
pub struct Current {
    driver: Mutex<Driver>,
    changed: Condvar,
}

impl Default for Current {
    /// The first driver is being chosen.
    fn default() -> Current {
        Current { driver: Mutex::new(Driver::Changing), changed: Condvar::new() }
    }
}

impl Current {
    /// For reading.
    pub fn lock(&self) -> MutexGuard<'_, Driver> {
        self.driver.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Another process drives it from now on. Returns what drove it before.
    pub fn set(&self, driver: Driver) -> Driver {
        let before = std::mem::replace(&mut *self.lock(), driver);
        self.changed.notify_all();
        before
    }

    /// Takes over what the daemon drives. Waits, up to a limit, while the master passes to the daemon, and while the
    /// daemon has not seen yet that the process of the owner has ended.
    ///
    /// # Errors
    /// Another process drives it, or nothing does.
    pub fn take_from_daemon(&self, master: u32, limit: Duration) -> Result<(Driving, Arc<Opened>), Refusal> {
        let begin = Instant::now();
        let mut driver = self.lock();
        loop {
            let refusal = match std::mem::replace(&mut *driver, Driver::Changing) {
                Driver::Daemon(driving, opened) => return Ok((driving, opened)),
                Driver::Changing => Refusal::Changing { master },
                Driver::Owner(owner, opened) => {
                    let (by, has_ended) = (owner.owner().clone(), owner.has_ended());
                    *driver = Driver::Owner(owner, opened);
                    let refusal = Refusal::Owned { master, by };
                    if !has_ended {
                        return Err(refusal);
                    }
                    refusal
                }
                Driver::Fault(cause) => {
                    *driver = Driver::Fault(cause.clone());
                    return Err(Refusal::Fault { master, cause });
                }
            };
            let left = limit.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return Err(refusal);
            }
            driver = self.changed.wait_timeout(driver, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::fd::AsFd;
    use std::os::unix::net::UnixStream;
    use std::path::Path;
    use std::process::Command;

    use ringcat::piped::segment::PipedSegment;
    use ringcat::sim::network::Network;
    use ringcat::sim::segment::Segment;
    use ringcat_link::process::{wait_readable, watch};

    use super::*;
    use crate::owner::{for_tests, for_tests_of};
    use crate::segment_process;
    use crate::wires::Wires;

    /// A wait has this limit: nothing in these tests takes that long.
    const LONG: Duration = Duration::from_secs(30);
    /// A wait that is given up in a test.
    const SHORT: Duration = Duration::from_millis(20);

    fn opened() -> Arc<Opened> {
        let (near, far) = UnixStream::pair().expect("a pair");
        // It ends with the daemon's socket.
        std::thread::spawn(move || {
            let described = Segment::from_toml("[segment]\n[[device]]\ntype = \"servo\"\n", Path::new("."));
            let network = Network::from_description(described.expect("it is right")).expect("it is right");
            let _ = segment_process::serve(&mut PipedSegment::new(network), &far, |_| true);
        });
        let mut wires = Wires::to_segment(near).expect("it is right");
        Arc::new(wires.open().expect("the segment takes them"))
    }

    /// The answer to a request that waits, when the master has a fault in the end.
    fn refused_at_last(current: &Current) -> Refusal {
        std::thread::scope(|scope| {
            let waits = scope.spawn(|| current.take_from_daemon(3, LONG));
            // The request may come before or after it: a refusal because of the change is not a fault.
            std::thread::sleep(SHORT);
            current.set(Driver::Fault("at last".to_owned()));
            waits.join().expect("no panic").expect_err("nothing drives it")
        })
    }

    // covers: daemon
    #[test]
    fn a_request_waits_while_the_master_passes_from_one_process_to_another() {
        let current = Current::default();
        let refused = current.take_from_daemon(3, SHORT).expect_err("nothing drives it");
        assert_eq!(refused, Refusal::Changing { master: 3 });
        assert_eq!(refused_at_last(&current), Refusal::Fault { master: 3, cause: "at last".to_owned() });
    }

    // covers: daemon
    #[test]
    fn a_request_waits_for_the_daemon_after_the_end_of_the_owners_process_only() {
        let opened = opened();
        let current = Current::default();
        let (owner, _far) = for_tests().expect("a pair");
        let by = owner.owner().clone();
        current.set(Driver::Owner(Arc::new(owner), opened.clone()));
        let refused = current.take_from_daemon(3, LONG).expect_err("an application drives it");
        assert_eq!(refused, Refusal::Owned { master: 3, by });
        let mut child = Command::new("sleep").arg("60").spawn().expect("sleep is there");
        let end = watch(child.id()).expect("it lives");
        let (owner, _far) = for_tests_of(end.try_clone().expect("a descriptor")).expect("a pair");
        current.set(Driver::Owner(Arc::new(owner), opened));
        let refused = current.take_from_daemon(3, LONG).expect_err("an application drives it");
        assert!(matches!(refused, Refusal::Owned { .. }), "{refused}");
        child.kill().expect("it runs");
        child.wait().expect("it has ended");
        assert_eq!(wait_readable(&[end.as_fd()], LONG), 1);
        let refused = current.take_from_daemon(3, SHORT).expect_err("the daemon has not seen it");
        assert!(matches!(refused, Refusal::Owned { .. }), "{refused}");
        assert_eq!(refused_at_last(&current), Refusal::Fault { master: 3, cause: "at last".to_owned() });
    }
}
