//! Links that keep a copy of every frame: what a tap or a log of frames is compared with.

use std::sync::{Arc, Mutex, PoisonError};

use ringcat::{Instant, Link, Links};
use ringcat_wire::datagram::OVERHEAD;
use ringcat_wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, MacAddress};

/// A frame that passed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Passed {
    /// When.
    pub at: Instant,
    /// On which link.
    pub link: Link,
    /// Sent by the engine.
    pub is_sent: bool,
    /// Its bytes.
    pub frame: Vec<u8>,
}

/// Links below, and the frames that passed.
#[derive(Debug)]
pub struct Witness<L> {
    links: L,
    passed: Arc<Mutex<Vec<Passed>>>,
}

/// The frames of a [`Witness`].
#[derive(Clone, Debug)]
pub struct Frames(Arc<Mutex<Vec<Passed>>>);

impl Frames {
    /// The frames since the last call.
    pub fn take(&self) -> Vec<Passed> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Link, command and register address (ADO) of each datagram that the engine has sent since the last call. Frames
    /// are dropped.
    pub fn sent(&self) -> Vec<(Link, u8, u16)> {
        let sent = self.take().into_iter().filter(|passed| passed.is_sent);
        let of = |passed: Passed| datagrams(&passed.frame).into_iter().map(move |(it, at)| (passed.link, it, at));
        sent.flat_map(of).collect()
    }
}

/// Command and register address of each datagram of a frame.
pub fn datagrams(frame: &[u8]) -> Vec<(u8, u16)> {
    let (mut found, mut at) = (Vec::new(), ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN);
    while let Some(header) = frame.get(at..at + OVERHEAD - 2) {
        found.push((header[0], u16::from_le_bytes([header[4], header[5]])));
        let length = u16::from_le_bytes([header[6], header[7]]);
        at += OVERHEAD + usize::from(length & 0x07FF);
        if length & 0x8000 == 0 {
            break;
        }
    }
    found
}

impl<L: Links> Witness<L> {
    /// Watches links.
    pub fn new(links: L) -> (Witness<L>, Frames) {
        let passed = Arc::new(Mutex::default());
        (Witness { links, passed: passed.clone() }, Frames(passed))
    }

    /// The links below.
    pub fn links(&self) -> &L {
        &self.links
    }

    /// The links below.
    pub fn links_mut(&mut self) -> &mut L {
        &mut self.links
    }

    /// The links below, without the witness.
    pub fn into_links(self) -> L {
        self.links
    }

    fn note(&self, link: Link, is_sent: bool, frame: &[u8]) {
        let passed = Passed { at: self.links.now(), link, is_sent, frame: frame.to_vec() };
        self.passed.lock().unwrap_or_else(PoisonError::into_inner).push(passed);
    }
}

impl<L: Links> Links for Witness<L> {
    fn now(&self) -> Instant {
        self.links.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.links.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.note(link, true, frame);
        self.links.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let (mut received, now, passed) = (None, self.links.now(), &self.passed);
        let any = self.links.receive(&mut |link, frame| {
            received = Some(Passed { at: now, link, is_sent: false, frame: frame.to_vec() });
            take(link, frame);
        });
        passed.lock().unwrap_or_else(PoisonError::into_inner).extend(received);
        any
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.links.carrier(link)
    }

    fn wait(&mut self, until: Instant) {
        self.links.wait(until);
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        self.links.force_disconnect(link, disconnect)
    }
}
