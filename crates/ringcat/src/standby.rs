//! Two MainDevices in one ring: store-and-forward of the INACTIVE (protocol 9.7), and the types of roles and takeover
//! (protocol 9.6 to 9.10).
//!
//! The ring leads through both MainDevices: from the main link of the ACTIVE through the SubDevices into the redundant
//! link of the INACTIVE, and from its main link to the redundant link of the ACTIVE. [`StoreAndForward`] sends each
//! frame on at the other link, or back if that one is down, so that the ACTIVE has its ring. Frames of any MainDevice
//! that leaves two bits of its source address to the standby are forwarded (protocol 9.7.1).
//!
//! An INACTIVE that follows, takes over and hands its role over is an [`Engine`](crate::Engine) with
//! [`EngineOptions::standby`], and the [`Exchange`](crate::Exchange) of its application. The application drives both,
//! and a [`Forwarder`], as `docs/standby.md` describes; the threads and the cycles of
//! [`MainDevice`](crate::MainDevice) do not do this yet.

use std::error::Error;
use std::fmt;

pub use ringcat_engine::event::StandbyEvent;
pub use ringcat_engine::layout::MasterSizes;
use ringcat_engine::link::Link;
pub use ringcat_engine::main_device::{Active, Heard, Options as EngineOptions, StandbyOptions};
pub use ringcat_engine::role::{Partner, RoleCause, RoleControl, RoleRequest};
pub use ringcat_engine::standby::{Forwarder, NotForwarded};
pub use ringcat_engine::{Class, class_of};
use ringcat_wire::frame::{MAX_FRAME_VLAN, MacAddress};
pub use ringcat_wire::master_frame::{NotReady, Stage};

use crate::links::{Links, PerLink};

/// Most frames that one call of [`StoreAndForward::forward`] takes.
pub const MAX_AT_ONCE: usize = 256;

/// Forwards the frames of an ACTIVE MainDevice.
#[derive(Debug)]
pub struct StoreAndForward {
    forwarder: Forwarder,
    buffer: Box<[u8; MAX_FRAME_VLAN]>,
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
    /// Not sent: forwarded on that link before.
    pub again: u64,
    /// Not sent: own frames, from the time when this MainDevice was ACTIVE.
    pub own: u64,
    /// Not sent: no EtherCAT frames with datagrams, or too long for Ethernet.
    pub not_ethercat: u64,
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

impl StoreAndForward {
    /// With the addresses of the own interfaces.
    ///
    /// # Errors
    /// There is no redundant link.
    pub fn new(addresses: PerLink<MacAddress>) -> Result<StoreAndForward, NeedsTwoLinks> {
        let forwarder = Forwarder::new(addresses.main, addresses.redundant.ok_or(NeedsTwoLinks)?);
        Ok(StoreAndForward {
            forwarder,
            buffer: Box::new([0; MAX_FRAME_VLAN]),
            counters: ForwardingCounters::default(),
        })
    }

    /// Forwards the frames that have arrived, at most [`MAX_AT_ONCE`]; the number of frames taken. Neither allocates
    /// nor waits.
    pub fn forward(&mut self, links: &mut impl Links) -> usize {
        let carriers = Link::ALL.map(|link| links.carrier(link) != Some(false));
        let mut taken = 0;
        while taken < MAX_AT_ONCE {
            let mut received = None;
            let buffer = &mut self.buffer;
            let any = links.receive(&mut |link, frame| {
                received = buffer.get_mut(..frame.len()).map(|place| {
                    place.copy_from_slice(frame);
                    (link, frame.len())
                });
            });
            if !any {
                break;
            }
            taken += 1;
            match received {
                Some((link, length)) => self.pass_on(links, link, length, carriers),
                None => self.counters.not_ethercat += 1,
            }
        }
        taken
    }

    /// Sends the frame in the buffer on.
    fn pass_on(&mut self, links: &mut impl Links, received_on: Link, length: usize, carriers: [bool; 2]) {
        let frame = &mut self.buffer[..length];
        let counter = match self.forwarder.forward(frame, received_on, carriers) {
            Ok(link) => {
                links.send(link, frame);
                self.counters.sent_back += u64::from(link == received_on);
                match link {
                    Link::Main => &mut self.counters.on_main,
                    Link::Redundant => &mut self.counters.on_redundant,
                }
            }
            Err(NotForwarded::Own) => &mut self.counters.own,
            Err(NotForwarded::Again) => &mut self.counters.again,
            Err(NotForwarded::NoLink) => &mut self.counters.no_link,
            Err(_) => &mut self.counters.not_ethercat,
        };
        *counter += 1;
    }

    /// What it has done since it began.
    pub fn counters(&self) -> ForwardingCounters {
        self.counters
    }
}
