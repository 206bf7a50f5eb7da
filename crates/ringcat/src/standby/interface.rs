//! A network interface of this host that leads to the other MainDevice (protocol 9.12).
//!
//! [`SupervisorThread::start_partner_interface`] makes it; from then on the thread of the acyclic half moves its
//! frames, before an application begins, while it runs, and in both roles. It has a carrier while the other MainDevice
//! answers. The administrator of the host gives it an address, and switches it on.

use std::error::Error as StdError;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Waker;
use std::time::Duration;

use ringcat_engine::main_device::MainDevice as Engine;
use ringcat_engine::standby::{ETHERNET_QUEUE, PartnerEndpoint, PartnerTraffic};
use ringcat_engine::time::Instant;
use ringcat_link::tap::{TapError, TapInterface};
use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::{ETHERNET_MTU, MAX_ETHERNET};

use crate::eoe::HostInterface;
use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;

/// Interval at which the status is published.
const REFRESH: Duration = Duration::from_millis(20);
/// Maximum number of received frames in one turn, so that the bus is served too.
const BURST: usize = 64;

/// Why there is no interface to the other MainDevice.
#[derive(Debug)]
#[non_exhaustive]
pub enum PartnerInterfaceError {
    /// The host does not make it.
    Tap(TapError),
    /// [`StandbyOptions::max_acyclic`](super::StandbyOptions::max_acyclic) is 0, or the endpoint is in use.
    NoEthernet,
    /// The thread has ended.
    Gone(Error),
}

impl fmt::Display for PartnerInterfaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PartnerInterfaceError::Tap(error) => error.fmt(f),
            PartnerInterfaceError::NoEthernet => {
                f.write_str("no Ethernet to the other MainDevice: it is off (max_acyclic), or in use")
            }
            PartnerInterfaceError::Gone(error) => error.fmt(f),
        }
    }
}

impl StdError for PartnerInterfaceError {
    fn source(&self) -> Option<&(dyn StdError + 'static)> {
        match self {
            PartnerInterfaceError::Tap(error) => Some(error),
            PartnerInterfaceError::NoEthernet => None,
            PartnerInterfaceError::Gone(error) => Some(error),
        }
    }
}

/// State and counters of the interface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PartnerInterfaceStatus {
    /// The other MainDevice answers: frames can pass.
    pub is_up: bool,
    /// Another program has removed the interface: no frame is moved any more.
    pub is_removed: bool,
    /// Counters of the frames between both MainDevices.
    pub traffic: PartnerTraffic,
    /// Frames that the host did not accept because the interface is switched off.
    pub refused: u64,
}

#[derive(Debug)]
struct Shared {
    ended: AtomicBool,
    status: Mutex<PartnerInterfaceStatus>,
    /// Wakes the supervisor's thread.
    waker: Waker,
}

/// The interface. It is removed when this is dropped.
#[derive(Debug)]
pub struct PartnerInterface(Arc<Shared>);

impl PartnerInterface {
    /// A MAC address for it, the same each time: locally administered, with bytes 3 to 5 of the main link's address,
    /// which differ between both MainDevices (protocol AC-07).
    pub const fn address(main: MacAddress) -> [u8; 6] {
        let MacAddress([.., a, b, c]) = main;
        [0x0A, a, b, c, b'R', b'C']
    }

    /// Its status, some milliseconds old.
    pub fn status(&self) -> PartnerInterfaceStatus {
        *self.0.status.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for PartnerInterface {
    fn drop(&mut self) {
        self.0.ended.store(true, Ordering::Relaxed);
        self.0.waker.wake_by_ref();
    }
}

impl SupervisorThread {
    /// Makes a network interface with this name and MAC address that leads to the other MainDevice, in the network
    /// namespace of the calling thread. Its MTU is [`ETHERNET_MTU`]. It has no carrier before the
    /// other MainDevice answers.
    ///
    /// # Errors
    /// A missing permission or device, a name that is taken, no [`max_acyclic`](super::StandbyOptions::max_acyclic), or
    /// the thread has ended.
    pub fn start_partner_interface(&self, name: &str, mac: [u8; 6]) -> Result<PartnerInterface, PartnerInterfaceError> {
        let tap = TapInterface::create(name, mac).map_err(PartnerInterfaceError::Tap)?;
        tap.set_mtu(ETHERNET_MTU as u16).map_err(PartnerInterfaceError::Tap)?;
        let wake_up = self.wake_up();
        // Without it frames of the host wait for the next turn of the thread.
        if let Some(wake_up) = &wake_up {
            wake_up.watch(&tap);
        }
        self.start_partner_bridge(Box::new(tap), wake_up.is_some())
    }

    /// As [`SupervisorThread::start_partner_interface`], with an interface of another kind, which is read every half
    /// millisecond.
    ///
    /// # Errors
    /// No [`max_acyclic`](super::StandbyOptions::max_acyclic), or the thread has ended.
    pub fn start_partner_interface_on(
        &self,
        interface: Box<dyn HostInterface>,
    ) -> Result<PartnerInterface, PartnerInterfaceError> {
        self.start_partner_bridge(interface, false)
    }

    fn start_partner_bridge(
        &self,
        interface: Box<dyn HostInterface>,
        is_called: bool,
    ) -> Result<PartnerInterface, PartnerInterfaceError> {
        let endpoint = self.partner_endpoint().map_err(PartnerInterfaceError::Gone)?;
        let endpoint = endpoint.ok_or(PartnerInterfaceError::NoEthernet)?;
        let shared = Arc::new(Shared { ended: AtomicBool::new(false), status: Mutex::default(), waker: self.waker() });
        let bridge =
            Bridge { endpoint, interface, shared: shared.clone(), up: None, refused: 0, refresh_at: Instant(0) };
        let mut bridge = Some(bridge);
        let work = move |engine: &mut Engine, now| {
            let goes_on = bridge.as_mut().is_some_and(|moving| !moving.work(now));
            if !goes_on {
                // Another interface may use it.
                bridge.take().into_iter().for_each(|ended| engine.return_partner_endpoint(ended.endpoint));
            }
            !goes_on
        };
        let begun = if is_called { self.attend(work) } else { self.attend_often(work) };
        begun.map_err(PartnerInterfaceError::Gone)?;
        Ok(PartnerInterface(shared))
    }
}

/// Moves frames between the interface and the endpoint, in the supervisor's thread.
struct Bridge {
    endpoint: PartnerEndpoint,
    interface: Box<dyn HostInterface>,
    shared: Arc<Shared>,
    /// `None`: not known yet.
    up: Option<bool>,
    refused: u64,
    refresh_at: Instant,
}

impl Bridge {
    /// Moves the frames that wait; true when no more are to be moved.
    fn work(&mut self, now: Instant) -> bool {
        if self.shared.ended.load(Ordering::Relaxed) {
            return true;
        }
        let is_up = self.endpoint.is_up();
        if self.up.replace(is_up) != Some(is_up) {
            self.interface.set_carrier(is_up);
            self.refresh_at = now;
        }
        self.move_frames(is_up);
        if now < self.refresh_at {
            return false;
        }
        self.refresh_at = now + REFRESH;
        let (is_removed, traffic, refused) = (!self.interface.exists(), self.endpoint.traffic(), self.refused);
        let status = PartnerInterfaceStatus { is_up, is_removed, traffic, refused };
        *self.shared.status.lock().unwrap_or_else(PoisonError::into_inner) = status;
        is_removed
    }

    fn move_frames(&mut self, is_up: bool) {
        // One byte more than fits: a frame that is too long is counted, and not cut.
        let mut room = [0; MAX_ETHERNET + 1];
        for _ in 0..BURST {
            let Some(length) = self.endpoint.receive(&mut room) else { break };
            self.refused += u64::from(!self.interface.send(&room[..length]));
        }
        // While the queue is full further frames wait in the kernel. Without the other MainDevice they are dropped:
        // they must not reach it after its return.
        for _ in 0..if is_up { self.endpoint.room() } else { ETHERNET_QUEUE } {
            let Some(length) = self.interface.receive(&mut room) else { break };
            // Counted there.
            let _ = self.endpoint.send(&room[..length]);
        }
    }
}
