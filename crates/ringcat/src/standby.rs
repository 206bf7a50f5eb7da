//! Two MainDevices in one ring: store-and-forward of the INACTIVE (protocol 9.7), and the types of roles and takeover
//! (protocol 9.6 to 9.10).
//!
//! The ring leads through both MainDevices: from the main link of the ACTIVE through the SubDevices into the redundant
//! link of the INACTIVE, and from its main link to the redundant link of the ACTIVE. [`StoreAndForward`] sends each
//! frame on at the other link, or back if that one is down, so that the ACTIVE has its ring. Frames of any MainDevice
//! that leaves two bits of its source address to the standby are forwarded (protocol 9.7.1).
//!
//! A [`MainDevice`](crate::MainDevice) with [`Options::standby`](crate::Options::standby) is one of both:
//! [`MainDevice::join`](crate::MainDevice::join) forwards and listens, and returns an application that follows the
//! ACTIVE, or is ACTIVE itself. A [`Policy`] decides when it takes over; [`RoleControl`] requests a role from any
//! thread. Below that are an [`Engine`](crate::Engine) with [`EngineOptions::standby`] and the
//! [`Exchange`](crate::Exchange) of its application, which `docs/standby.md` describes.

mod alarm;
mod diagnosis;
mod ethernet;
#[cfg(feature = "packet")]
pub mod guard;
#[cfg(feature = "eoe")]
mod interface;
mod joining;
pub(crate) mod policy;
#[cfg(feature = "daemon")]
pub mod remote;
mod roles;

use std::error::Error;
use std::fmt;
use std::time::Duration;

pub use ringcat_engine::event::StandbyEvent;
pub use ringcat_engine::exchange::PartnerMemory;
pub use ringcat_engine::layout::MasterSizes;
use ringcat_engine::link::Link;
pub use ringcat_engine::main_device::{
    Active, Listener, Options as EngineOptions, PartnerDiagnosis, PartnerMemoryError, PartnerStatus, StandbyOptions,
};
pub use ringcat_engine::role::{Partner, Requester, RoleCause, RoleControl, RoleRequest};
pub use ringcat_engine::standby::{
    ETHERNET_QUEUE, Forwarder, NotForwarded, NotQueued, Onward, PartnerEndpoint, PartnerTraffic,
};
use ringcat_engine::time::Instant;
pub use ringcat_engine::{Class, class_of};
use ringcat_wire::frame::MacAddress;
pub use ringcat_wire::master_frame::{Diagnosis, DomainRecord, ETHERNET_MTU, MAX_ETHERNET, NotReady, Stage};
pub use ringcat_wire::memory_write::{MemoryWrite, WriteKind};

#[cfg(feature = "eoe")]
pub use self::interface::{PartnerInterface, PartnerInterfaceError, PartnerInterfaceStatus};
pub use self::joining::{Joining, Next};
pub use self::policy::{OnCollision, Policy};
use crate::links::{Arrived, Links, PerLink, SendOn};

/// Most frames that one call of [`StoreAndForward::forward`] takes.
pub const MAX_AT_ONCE: usize = 256;
/// Default age from which frames are not forwarded: an ACTIVE MainDevice has given them up.
pub const MAX_AGE: Duration = Duration::from_millis(5);

/// What takes and fills frames that are forwarded.
pub(crate) trait Reads {
    /// A frame of another MainDevice, before it is sent on.
    fn before(&mut self, link: Link, frame: &mut [u8], at: Instant);

    /// The same after it was sent on.
    fn after(&mut self, _frame: &[u8]) {}

    /// An own frame of the time as ACTIVE has come back.
    fn own(&mut self, _frame: &[u8], _at: Instant) {}

    /// Whether a link has a carrier, if this object reports it.
    fn is_up(&self, _link: Link) -> bool {
        true
    }
}

/// Frames are only forwarded.
impl Reads for () {
    fn before(&mut self, _link: Link, _frame: &mut [u8], _at: Instant) {}
}

/// Forwards the frames of an ACTIVE MainDevice.
#[derive(Debug)]
pub struct StoreAndForward {
    forwarder: Forwarder,
    max_age: Duration,
    counters: ForwardingCounters,
}

/// Frames that an INACTIVE MainDevice has received, since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ForwardingCounters {
    /// Sent on at the main link.
    pub on_main: u64,
    /// Sent on at the redundant link.
    pub on_redundant: u64,
    /// Of these, sent back at the link on which they came, because the other one is down.
    pub sent_back: u64,
    /// Of these, frames with the identity of this MainDevice, which it has not sent: another one has the same bytes 3
    /// to 5 in its address, and it must not become ACTIVE (protocol SM-09).
    pub same_identity: u64,
    /// Not sent: forwarded on that link before.
    pub again: u64,
    /// Not sent: own frames, from the time when this MainDevice was ACTIVE.
    pub own: u64,
    /// Not sent: no EtherCAT frames with datagrams.
    pub not_ethercat: u64,
    /// Not sent: too old, because this MainDevice was stopped.
    pub too_old: u64,
    /// Not sent: no link is up.
    pub no_link: u64,
}

/// An INACTIVE MainDevice needs two links.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NeedsTwoLinks;

impl fmt::Display for NeedsTwoLinks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an INACTIVE MainDevice forwards between two links: expected a redundant link, got none")
    }
}

impl Error for NeedsTwoLinks {}

impl ForwardingCounters {
    /// Frames that were not forwarded, for any reason.
    pub const fn not_forwarded(&self) -> u64 {
        self.again + self.own + self.not_ethercat + self.too_old + self.no_link
    }

    /// Number of counters.
    pub(crate) const COUNT: usize = 9;

    /// The counters as words.
    pub(crate) const fn to_words(self) -> [u64; Self::COUNT] {
        let ForwardingCounters { on_main, on_redundant, sent_back, same_identity, again, own, .. } = self;
        let ForwardingCounters { not_ethercat, too_old, no_link, .. } = self;
        [on_main, on_redundant, sent_back, same_identity, again, own, not_ethercat, too_old, no_link]
    }

    /// The counters of [`ForwardingCounters::to_words`].
    pub(crate) const fn from_words(words: [u64; Self::COUNT]) -> ForwardingCounters {
        let [on_main, on_redundant, sent_back, same_identity, again, own, not_ethercat, too_old, no_link] = words;
        ForwardingCounters {
            on_main,
            on_redundant,
            sent_back,
            same_identity,
            again,
            own,
            not_ethercat,
            too_old,
            no_link,
        }
    }

    /// The error of a MainDevice that has received frames with its own identity from another one.
    pub const fn check_identity(&self) -> Result<(), SameIdentity> {
        if self.same_identity == 0 { Ok(()) } else { Err(SameIdentity) }
    }
}

/// The ACTIVE has the identity of this MainDevice: neither can distinguish its frames from those of the other one
/// (protocol SM-09, REQ006).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SameIdentity;

impl fmt::Display for SameIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "the ACTIVE has the same bytes 3 to 5 in its address as an interface here, so neither can distinguish its \
             frames from those of the other: give that interface another address (ip link set IF address ...)",
        )
    }
}

impl Error for SameIdentity {}

impl StoreAndForward {
    /// With the addresses of the own interfaces, of a MainDevice that has sent nothing. Frames older than [`MAX_AGE`]
    /// are not forwarded.
    ///
    /// # Errors
    /// There is no redundant link.
    pub fn new(addresses: PerLink<MacAddress>) -> Result<StoreAndForward, NeedsTwoLinks> {
        let forwarder = Forwarder::new(addresses.main, addresses.redundant.ok_or(NeedsTwoLinks)?);
        Ok(StoreAndForward { forwarder, max_age: MAX_AGE, counters: ForwardingCounters::default() })
    }

    /// This MainDevice was ACTIVE, and has sent its last frame at this time.
    #[must_use]
    pub fn after_sending(mut self, last_sent: Instant) -> StoreAndForward {
        self.forwarder = self.forwarder.after_sending(last_sent);
        self
    }

    /// Sets the age from which frames are not forwarded: those that came while this MainDevice was stopped would bring
    /// SubDevices back to earlier outputs.
    #[must_use]
    pub fn with_max_age(mut self, max_age: Duration) -> StoreAndForward {
        self.max_age = max_age;
        self
    }

    /// From now on: this MainDevice was ACTIVE, and has sent its last frame at this time.
    pub(crate) fn note_sent(&mut self, last_sent: Instant) {
        self.forwarder = self.forwarder.after_sending(last_sent);
    }

    /// Forwards the frames that have arrived, at most [`MAX_AT_ONCE`]; the number of frames taken. Neither allocates
    /// nor waits.
    pub fn forward(&mut self, links: &mut impl Links) -> usize {
        self.forward_and_read(links, &mut ())
    }

    /// The same, and reads the frames.
    pub(crate) fn forward_and_read(&mut self, links: &mut impl Links, reader: &mut impl Reads) -> usize {
        for taken in 0..MAX_AT_ONCE {
            let now = links.now();
            let since = Instant(now.0.saturating_sub(u64::try_from(self.max_age.as_nanos()).unwrap_or(u64::MAX)));
            let mut pass = |arrived: Arrived<'_>, links: &mut dyn SendOn| {
                if arrived.at < since {
                    self.counters.too_old += 1;
                } else {
                    self.pass_on(arrived, links, reader, now);
                }
            };
            if !links.receive_and_pass(since, &mut pass) {
                return taken;
            }
        }
        MAX_AT_ONCE
    }

    /// Sends a frame on.
    fn pass_on(&mut self, arrived: Arrived<'_>, links: &mut dyn SendOn, reader: &mut impl Reads, now: Instant) {
        let Arrived { link: received_on, at, frame } = arrived;
        let carriers = Link::ALL.map(|link| links.is_up(link) && reader.is_up(link));
        if self.forwarder.is_of_another(frame, now) {
            reader.before(received_on, frame, at.min(now));
        }
        let forwarder = self.forwarder;
        let passed = forwarder.forward(frame, received_on, carriers, now).and_then(|onward| {
            if links.send(onward.link, frame) {
                return Ok(onward);
            }
            let back = forwarder.turn_back(frame, received_on, onward)?;
            if links.send(back.link, frame) { Ok(back) } else { Err(NotForwarded::NoLink) }
        });
        match passed {
            Ok(_) => reader.after(frame),
            Err(NotForwarded::Own) => reader.own(frame, now),
            Err(_) => {}
        }
        self.count(passed, received_on);
    }

    fn count(&mut self, passed: Result<Onward, NotForwarded>, received_on: Link) {
        let counters = &mut self.counters;
        let counter = match passed {
            Ok(Onward { link, has_own_identity, .. }) => {
                counters.sent_back += u64::from(link == received_on);
                counters.same_identity += u64::from(has_own_identity);
                match link {
                    Link::Main => &mut counters.on_main,
                    Link::Redundant => &mut counters.on_redundant,
                }
            }
            Err(NotForwarded::Own) => &mut counters.own,
            Err(NotForwarded::Again) => &mut counters.again,
            Err(NotForwarded::NoLink) => &mut counters.no_link,
            Err(_) => &mut counters.not_ethercat,
        };
        *counter += 1;
    }

    /// What it has done since it began.
    pub fn counters(&self) -> ForwardingCounters {
        self.counters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OWN: PerLink<MacAddress> =
        PerLink::new(MacAddress([0, 0, 0x5E, 0, 0x53, 0x11]), Some(MacAddress([0, 0, 0x5E, 0, 0x53, 0x12])));

    /// Links with one frame after the other, whose interfaces fail to send.
    struct Failing {
        arriving: Vec<(Link, Instant, Vec<u8>)>,
        sent: Vec<(Link, u8)>,
        fails: [bool; 2],
        now: Instant,
    }

    impl Failing {
        fn new(fails: [bool; 2]) -> Failing {
            Failing { arriving: Vec::new(), sent: Vec::new(), fails, now: Instant(1_000_000_000) }
        }

        /// A frame of the MainDevice of the trace arrives.
        fn arrive(&mut self, link: Link, ago: Duration) {
            let mut frame = vec![0; 60];
            frame[6..12].copy_from_slice(&[0x08, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
            frame[12..16].copy_from_slice(&[0x88, 0xA4, 0x0E, 0x10]);
            self.arriving.push((link, Instant(self.now.0 - ago.as_nanos() as u64), frame));
        }

        fn forwarded(&mut self, max_age: Duration) -> ForwardingCounters {
            let mut forwarder = StoreAndForward::new(OWN).expect("two links").with_max_age(max_age);
            let count = self.arriving.len();
            assert_eq!(forwarder.forward(self), count);
            forwarder.counters()
        }
    }

    impl Links for Failing {
        fn now(&self) -> Instant {
            self.now
        }

        fn addresses(&self) -> PerLink<MacAddress> {
            OWN
        }

        fn send(&mut self, _link: Link, _frame: &[u8]) {
            unreachable!("frames are sent on in place");
        }

        fn receive(&mut self, _take: &mut dyn FnMut(Link, &[u8])) -> bool {
            unreachable!("frames are received in place");
        }

        fn receive_and_pass(&mut self, _since: Instant, pass: &mut dyn FnMut(Arrived<'_>, &mut dyn SendOn)) -> bool {
            if self.arriving.is_empty() {
                return false;
            }
            let (link, at, mut frame) = self.arriving.remove(0);
            pass(Arrived::new(link, at, &mut frame), self);
            true
        }

        fn wait(&mut self, _until: Instant) {}
    }

    impl SendOn for Failing {
        fn is_up(&self, _link: Link) -> bool {
            true
        }

        fn send(&mut self, link: Link, frame: &[u8]) -> bool {
            let leaves = !self.fails[link.index()];
            if leaves {
                self.sent.push((link, frame[6]));
            }
            leaves
        }
    }

    // covers: standby, 9.7.5
    #[test]
    fn a_frame_that_an_interface_does_not_send_goes_back_at_once() {
        let cases = [
            ([false, false], vec![(Link::Redundant, 0x88)], 0, 0),
            ([false, true], vec![(Link::Main, 0x0C)], 1, 0),
            ([true, false], vec![(Link::Redundant, 0x88)], 0, 0),
            ([true, true], vec![], 0, 1),
        ];
        for (fails, expected, sent_back, no_link) in cases {
            let mut links = Failing::new(fails);
            links.arrive(Link::Main, Duration::ZERO);
            let counters = links.forwarded(MAX_AGE);
            assert_eq!(links.sent, expected, "{fails:?}");
            assert_eq!((counters.sent_back, counters.no_link), (sent_back, no_link), "{fails:?}");
        }
    }

    // covers: standby
    #[test]
    fn frames_older_than_the_limit_are_not_sent() {
        let ms = Duration::from_millis;
        let mut links = Failing::new([false; 2]);
        [9, 3, 2, 1, 0].into_iter().for_each(|ago| links.arrive(Link::Main, ms(ago)));
        let counters = links.forwarded(ms(2));
        assert_eq!((counters.too_old, counters.on_redundant, links.sent.len()), (2, 3, 3));
    }

    // covers: standby, SM-09
    #[test]
    fn a_maindevice_with_the_same_identity_is_counted_and_forwarded() {
        let mut links = Failing::new([false; 2]);
        links.arrive(Link::Main, Duration::ZERO);
        links.arriving[0].2[9..12].copy_from_slice(&[0, 0x53, 0x12]);
        let counters = links.forwarded(MAX_AGE);
        assert_eq!((counters.same_identity, counters.own, counters.on_redundant), (1, 0, 1));
    }
}
