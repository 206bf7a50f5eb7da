//! A bus as it arrives from a daemon: links, a lock, network interfaces, what is known of the segment.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::Duration;

use ringcat_control::connection::Connection;
use ringcat_control::message::{Content, HandedBus, MOST_DEBUG_INTERFACES};
use ringcat_control::refusal::Refusal;
use ringcat_control::wire::Limits;
use ringcat_engine::knowledge::Knowledge;
use ringcat_link::{TapInterface, Taps};

use super::error::DaemonError;
use super::links::{DaemonLinks, adopt_links, tapped};
use super::orders::Orders;
use crate::either_links::EitherLinks;

/// The daemon hands a bus over within this time: it waits for the end of a scan.
const TAKE: Duration = Duration::from_secs(30);

/// A bus that has arrived.
#[derive(Debug)]
pub(super) struct Received {
    /// What it is.
    pub bus: HandedBus,
    /// Links of the cyclic half.
    pub cyclic: DaemonLinks,
    /// Links of the acyclic half.
    pub acyclic: DaemonLinks,
    /// A daemon that is started anew detects by it that this process has the bus.
    pub lock: Option<OwnedFd>,
    /// Network interfaces of EoE.
    pub interfaces: Vec<OwnedFd>,
    /// Debug interfaces.
    pub debug_interfaces: Vec<TapInterface>,
    /// Taps of both halves, where something may read them.
    pub taps: Option<Taps>,
    /// What is known of the segment.
    pub knowledge: Option<Knowledge>,
}

impl Received {
    /// Requests the bus of a master, and waits for it. Its links order what they cannot do themselves.
    ///
    /// # Errors
    /// The daemon refuses or gives no answer, or what it has sent cannot be used.
    pub fn take(connection: &Connection, master: u32, orders: &Arc<Orders>) -> Result<Received, DaemonError> {
        connection.send(&Content::Take { master, ethernet: cfg!(feature = "eoe") }.into())?;
        let (message, descriptors) = connection.receive_with_descriptors(Limits::OWNER, Some(TAKE))?;
        let bus = match message.content {
            Content::Taken(bus) => bus,
            Content::Refused(refusal) => return Err(refusal.into()),
            _ => return Err(unexpected("links of a master")),
        };
        let (links, lock) = (bus.links.descriptors(), usize::from(bus.has_lock));
        let (ethernet, debug) = (bus.interfaces.len(), bus.debug_interfaces.len());
        if descriptors.len() != links + lock + ethernet + debug || debug > MOST_DEBUG_INTERFACES {
            return Err(unexpected("a descriptor for each part of a bus"));
        }
        let mut descriptors = descriptors.into_iter();
        let (cyclic, acyclic) = adopt_links(&bus.links, descriptors.by_ref().take(links).collect())?;
        let acyclic = match acyclic {
            EitherLinks::First(links) if bus.can_switch => EitherLinks::First(links.with_switch(orders.clone())),
            links => links,
        };
        let has_taps = bus.settings.debug_ring.is_on || debug > 0;
        let taps = has_taps.then(|| Taps::new(bus.links.names().len()));
        let (cyclic, acyclic) = (tapped(cyclic, taps.as_ref()), tapped(acyclic, taps.as_ref()));
        let lock = descriptors.by_ref().take(lock).next();
        let interfaces = descriptors.by_ref().take(ethernet).collect();
        // One that was removed meanwhile is no interface any more.
        let debug_interfaces = descriptors.filter_map(|descriptor| TapInterface::adopt(descriptor).ok()).collect();
        let knowledge = if message.bytes.is_empty() { None } else { Some(Knowledge::from_bytes(&message.bytes)?) };
        Ok(Received { bus, cyclic, acyclic, lock, interfaces, debug_interfaces, taps, knowledge })
    }
}

fn unexpected(expected: &str) -> DaemonError {
    Refusal::Unexpected { expected: expected.to_owned() }.into()
}
