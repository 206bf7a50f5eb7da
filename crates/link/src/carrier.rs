//! Carrier state of interfaces, polled by a thread.
//!
//! Input: names of interfaces and a period. Any thread reads the states without a system call. `ETHTOOL_GLINK` waits
//! for a lock of the kernel, so the cyclic thread must not call it. The kernel's own link notification is late or
//! missing for some devices and is not used.

use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::error::LinkError;
use crate::{interface, kernel, realtime};

/// State of a carrier and how often it has changed, shared with the watching thread.
///
/// Cheap to clone; reading is one atomic load.
#[derive(Clone, Debug)]
pub struct Carrier {
    /// Twice the number of changes, plus 1 while there is a carrier.
    word: Arc<AtomicU32>,
}

impl Carrier {
    fn new(up: bool) -> Carrier {
        Carrier { word: Arc::new(AtomicU32::new(u32::from(up))) }
    }

    /// Whether there is a carrier.
    #[inline]
    pub fn is_up(&self) -> bool {
        self.word.load(Ordering::Acquire) & 1 != 0
    }

    /// Number of state changes since the watch began, modulo 2^31. Changes shorter than the period are not counted.
    #[inline]
    pub fn changes(&self) -> u32 {
        self.word.load(Ordering::Acquire) >> 1
    }

    fn set(&self, up: bool) {
        if self.is_up() != up {
            // Inverts the state and increments the counter; only the watching thread writes.
            let word = self.word.load(Ordering::Relaxed);
            self.word.store(((word >> 1).wrapping_add(1) << 1) | u32::from(up), Ordering::Release);
        }
    }
}

/// Polls the carriers of some interfaces until it is dropped.
#[derive(Debug)]
pub struct CarrierWatch {
    carriers: Vec<Carrier>,
    stop: Option<Arc<()>>,
    thread: Option<JoinHandle<()>>,
}

impl CarrierWatch {
    /// Detects a cut cable within 5 ms at a negligible load.
    pub const PERIOD: Duration = Duration::from_millis(5);

    /// Starts the thread. The first states are known on return. An interface that disappears has no carrier.
    ///
    /// # Errors
    /// An interface is missing, or the system cannot start a thread.
    pub fn start(interfaces: &[&str], period: Duration) -> Result<CarrierWatch, LinkError> {
        if let Some(missing) = interfaces.iter().find(|name| kernel::index_of(name).is_none()) {
            return Err(LinkError::NoInterface { name: missing.to_string(), present: interface::names() });
        }
        CarrierWatch::start_for_any(interfaces, period)
    }

    /// The same where interfaces may be missing: they have no carrier until they come. An address (colons) stands for
    /// the interface that has it then.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start_for_any(interfaces: &[&str], period: Duration) -> Result<CarrierWatch, LinkError> {
        let failed = |what| move |errno| LinkError::from_errno(&interfaces.join(" and "), what, errno);
        let socket = kernel::request_socket().map_err(failed("opening a socket to read the carrier"))?;
        let mut watched: Vec<Watched> = interfaces.iter().map(|name| Watched::new(&socket, name)).collect();
        let carriers = watched.iter().map(|it| it.carrier.clone()).collect();
        let stop = Arc::new(());
        let running = Arc::downgrade(&stop);
        let poll = move || {
            realtime::leave();
            while running.strong_count() > 0 {
                thread::park_timeout(period);
                watched.iter_mut().for_each(|it| it.look(&socket));
            }
        };
        let thread = thread::Builder::new()
            .name("carrier-watch".to_owned())
            .spawn(poll)
            .map_err(|error| failed("starting a thread")(error.raw_os_error().unwrap_or(0)))?;
        Ok(CarrierWatch { carriers, stop: Some(stop), thread: Some(thread) })
    }

    /// The carrier of the interface at this position in the list passed to [`CarrierWatch::start`].
    ///
    /// # Panics
    /// If there is no such position.
    pub fn carrier(&self, place: usize) -> &Carrier {
        &self.carriers[place]
    }
}

impl Drop for CarrierWatch {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // The panic message of the thread has already been printed.
            let _ = thread.join();
        }
    }
}

/// An interface that is watched.
struct Watched {
    name: String,
    carrier: Carrier,
    /// It has this address, and no name yet.
    address: Option<[u8; 6]>,
    /// Checks until its name is searched for again.
    pause: u32,
}

impl Watched {
    /// Checks between searches for a name, which take longer than the check of a carrier.
    const PAUSE: u32 = 100;

    fn new(socket: &OwnedFd, name: &str) -> Watched {
        let mut watched =
            Watched { name: name.to_owned(), carrier: Carrier::new(false), address: address(name), pause: 0 };
        watched.search();
        // The first state is no change.
        watched.carrier = Carrier::new(has_carrier(socket, &watched.name));
        watched
    }

    fn look(&mut self, socket: &OwnedFd) {
        self.search();
        self.carrier.set(has_carrier(socket, &self.name));
    }

    fn search(&mut self) {
        let Some(address) = self.address else { return };
        if self.pause > 0 {
            self.pause -= 1;
            return;
        }
        self.pause = Watched::PAUSE;
        if let Some(found) = interface::list().into_iter().find(|it| it.mac == address) {
            (self.name, self.address) = (found.name, None);
        }
    }
}

/// Six pairs of hexadecimal digits with colons, which no name of an interface has.
fn address(text: &str) -> Option<[u8; 6]> {
    let mut address = [0; 6];
    let mut parts = text.split(':');
    for byte in &mut address {
        *byte = u8::from_str_radix(parts.next()?, 16).ok()?;
    }
    parts.next().is_none().then_some(address)
}

fn has_carrier(socket: &OwnedFd, name: &str) -> bool {
    kernel::link_up(socket.as_raw_fd(), name).unwrap_or_else(|_| running(socket, name))
}

/// `IFF_RUNNING`, for drivers that do not support `ETHTOOL_GLINK`.
fn running(socket: &OwnedFd, name: &str) -> bool {
    kernel::interface_request(socket.as_raw_fd(), name, libc::SIOCGIFFLAGS as _).is_ok_and(|answer| {
        // SAFETY: `SIOCGIFFLAGS` has filled this member.
        let flags = libc::c_int::from(unsafe { answer.ifr_ifru.ifru_flags });
        flags & libc::IFF_UP != 0 && flags & libc::IFF_RUNNING != 0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_interface_is_named() {
        let error = CarrierWatch::start(&["lo", "no-such"], CarrierWatch::PERIOD).expect_err("no such interface");
        assert!(matches!(&error, LinkError::NoInterface { name, present } if name == "no-such" && !present.is_empty()));
    }

    #[test]
    fn changes_are_counted_once_each() {
        let carrier = Carrier::new(true);
        for up in [true, false, false, true] {
            carrier.set(up);
            assert_eq!(carrier.is_up(), up);
        }
        assert_eq!(carrier.changes(), 2);
    }

    #[test]
    fn an_address_stands_for_the_interface_that_has_it() {
        let (lo, list) = (interface::carrier("lo"), interface::list());
        let first = list.iter().find(|it| it.mac == [0; 6]).expect("the loopback has zeros");
        let names = ["00:00:00:00:00:00", "02:00:00:00:00:99"];
        let watch = CarrierWatch::start_for_any(&names, CarrierWatch::PERIOD).expect("a watch");
        assert!(first.name != "lo" || lo == Some(watch.carrier(0).is_up()));
        assert!(!watch.carrier(1).is_up());
        assert_eq!(
            [address("lo"), address("0:1:2:3:4:f5"), address("0:1:2:3:4:5:6")],
            [None, Some([0, 1, 2, 3, 4, 0xf5]), None]
        );
    }

    #[test]
    fn a_watch_ends_when_it_is_dropped_however_long_its_period() {
        let watch = CarrierWatch::start(&["lo"], Duration::from_secs(3600)).expect("a watch");
        assert_eq!(Some(watch.carrier(0).is_up()), interface::carrier("lo"));
        drop(watch);
    }
}
