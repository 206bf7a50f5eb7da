//! Ethernet over EtherCAT as network interfaces of this host: one for each SubDevice that supports EoE.
//!
//! [`SupervisorThread::start_ethernet`] creates an interface for each SubDevice that is found: for declared ones, and
//! with idle operation for all others, with and without an application. From then on the supervisor thread moves frames
//! between interfaces and mailboxes. It takes frames of the host while the queue of the SubDevice has room; further
//! frames wait in the kernel. While a SubDevice is absent its interface has no carrier, but keeps its addresses, its
//! routes and its bridge. An interface stays while an application begins and ends; its counters begin anew. The
//! interfaces are removed when the MainDevice stops; one without a declaration also when its SubDevice leaves.
//!
//! An interface that cannot be created is reported once; all other interfaces work.

mod host_interface;

use std::any::Any;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Waker;
use std::time::Duration;

use ringcat_engine::mail::eoe::{EthernetStatus, MAX_FRAME, QUEUE};
use ringcat_engine::main_device::{Address, EthernetSubDevice, MainDevice as Engine};
use ringcat_engine::time::Instant;
use ringcat_link::tap::{TapError, TapInterface};

pub use self::host_interface::HostInterface;
use self::host_interface::Lasting;
use crate::error::Error;
use crate::supervisor_thread::SupervisorThread;

/// Interval of the search for new SubDevices and of the update of statistics.
const REFRESH: Duration = Duration::from_millis(20);
/// Maximum number of frames of one interface in one turn, so that other interfaces and the bus are served too.
const BURST: usize = 64;
/// Maximum number of events that are kept until they are taken.
const UNREAD_EVENTS: usize = 64;

/// Makes an interface, or gives one that is there; `None`: not yet.
type Make = Box<dyn FnMut(&str, [u8; 6]) -> Result<Option<Box<dyn HostInterface>>, TapError> + Send>;

/// Creates an interface with this name and MAC address.
pub type MakeInterface = Box<dyn FnMut(&str, [u8; 6]) -> Result<Box<dyn HostInterface>, TapError> + Send>;

/// Names and MAC addresses of the interfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EthernetOptions {
    /// Number of this MainDevice, for names.
    pub index: u16,
    /// MAC address of the main link; the addresses of the interfaces are derived from it.
    pub main: [u8; 6],
}

impl EthernetOptions {
    /// Interfaces of the MainDevice with this number, whose main link has this MAC address.
    pub const fn new(index: u16, main: [u8; 6]) -> EthernetOptions {
        EthernetOptions { index, main }
    }

    /// Name of a SubDevice's interface: `eoeXsY` by its position, `eoeXaY` by its alias where it has one.
    pub fn name(&self, subdevice: &EthernetSubDevice) -> String {
        match subdevice.alias {
            0 => format!("eoe{}s{}", self.index, subdevice.position.0),
            alias => format!("eoe{}a{alias}", self.index),
        }
    }

    /// Address of a SubDevice's interface, the same each time: locally administered, with the last three bytes of the
    /// main link's address and the position or the alias.
    pub fn mac(&self, subdevice: &EthernetSubDevice) -> [u8; 6] {
        let [.., a, b, c] = self.main;
        let (kind, number) = match subdevice.alias {
            0 => (0x02, subdevice.position.0),
            alias => (0x06, alias),
        };
        let [high, low] = number.to_be_bytes();
        [kind, a, b, c, high, low]
    }
}

/// A change of an interface.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EthernetEvent {
    /// It was created.
    Made {
        /// Its name.
        name: String,
        /// The SubDevice, by its index in the declaration, or by its position if it has no declaration.
        subdevice: Address,
    },
    /// Another program removed it. It is created again.
    Removed {
        /// Its name.
        name: String,
    },
    /// It cannot be created. Frames of its SubDevice are not transferred.
    Refused(TapError),
    /// Its SubDevice answers, or no longer answers.
    Carrier {
        /// Its name.
        name: String,
        /// Whether the interface has a carrier, so that frames can pass.
        carrier: bool,
    },
}

impl fmt::Display for EthernetEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EthernetEvent::Made { name, subdevice } => {
                write!(f, "network interface {name} leads to {subdevice}")
            }
            EthernetEvent::Removed { name } => write!(f, "{name}: removed by another program; it is made again"),
            EthernetEvent::Refused(error) => write!(f, "EoE: {error}"),
            EthernetEvent::Carrier { name, carrier: true } => write!(f, "{name}: frames can pass"),
            EthernetEvent::Carrier { name, carrier: false } => write!(f, "{name}: no carrier, its SubDevice is away"),
        }
    }
}

/// State and counters of one interface.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EthernetInterface {
    /// Its name.
    pub name: String,
    /// The SubDevice.
    pub subdevice: EthernetSubDevice,
    /// Counters, rates and the queue; `tx` is to the SubDevice.
    pub status: EthernetStatus,
    /// Frames that the host did not accept because the interface is switched off.
    pub refused: u64,
}

#[derive(Debug)]
struct Shared {
    ended: AtomicBool,
    published: Mutex<Published>,
    /// Wakes the supervisor's thread.
    waker: Waker,
}

#[derive(Debug, Default)]
struct Published {
    interfaces: Vec<EthernetInterface>,
    events: Vec<EthernetEvent>,
}

impl Shared {
    fn published(&self) -> std::sync::MutexGuard<'_, Published> {
        self.published.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The interfaces. They are removed when this is dropped.
#[derive(Debug)]
pub struct Ethernet(Arc<Shared>);

impl Ethernet {
    /// The present interfaces with their counters, some milliseconds old.
    pub fn interfaces(&self) -> Vec<EthernetInterface> {
        self.0.published().interfaces.clone()
    }

    /// Events since the last call.
    pub fn take_events(&self) -> Vec<EthernetEvent> {
        std::mem::take(&mut self.0.published().events)
    }
}

impl Ethernet {
    /// No frame is moved from now on, as after a drop.
    pub fn end(&self) {
        self.0.ended.store(true, Ordering::Relaxed);
        self.0.waker.wake_by_ref();
    }
}

impl Drop for Ethernet {
    fn drop(&mut self) {
        self.end();
    }
}

impl SupervisorThread {
    /// The network interfaces of EoE; none if they were not started, or are removed.
    pub fn ethernet_interfaces(&self) -> Vec<EthernetInterface> {
        let shared = self.published_ethernet().and_then(|shared| shared.downcast::<Shared>().ok());
        let present = shared.filter(|shared| !shared.ended.load(Ordering::Relaxed));
        present.map(|shared| shared.published().interfaces.clone()).unwrap_or_default()
    }

    /// Creates a network interface for each SubDevice that supports EoE as soon as the SubDevice is known: from
    /// activation on, or with [`Options::idle_operation`](crate::Options) from the scan on.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn start_ethernet(&self, options: EthernetOptions) -> Result<Ethernet, Error> {
        let create = |name: &str, mac| TapInterface::create(name, mac).map(Some);
        self.start_taps(options, create, |tap| Box::new(tap))
    }

    /// The same with interfaces that outlast this MainDevice: `source` gives a duplicate of the one with this name and
    /// address, makes it, or reports that it is not there yet, and is then called again. It runs in the thread of the
    /// acyclic half and must not wait.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn start_lasting_ethernet(
        &self,
        options: EthernetOptions,
        source: impl FnMut(&str, [u8; 6]) -> Result<Option<TapInterface>, TapError> + Send + 'static,
    ) -> Result<Ethernet, Error> {
        self.start_taps(options, source, |tap| Box::new(Lasting(tap)))
    }

    fn start_taps(
        &self,
        options: EthernetOptions,
        mut source: impl FnMut(&str, [u8; 6]) -> Result<Option<TapInterface>, TapError> + Send + 'static,
        end: impl Fn(TapInterface) -> Box<dyn HostInterface> + Send + 'static,
    ) -> Result<Ethernet, Error> {
        let wake_up = self.wake_up();
        let is_called = wake_up.is_some();
        let make = move |name: &str, mac| {
            let Some(tap) = source(name, mac)? else { return Ok(None) };
            // Without it frames of the host wait for the next turn of the thread.
            if let Some(wake_up) = &wake_up {
                wake_up.watch(&tap);
            }
            Ok(Some(end(tap)))
        };
        self.start_switch(options, Box::new(make), is_called)
    }

    fn start_switch(&self, options: EthernetOptions, make: Make, is_called: bool) -> Result<Ethernet, Error> {
        let (ethernet, mut switch) = Switch::new(options, make, self.waker());
        self.publish_ethernet(&(ethernet.0.clone() as Arc<dyn Any + Send + Sync>));
        if is_called {
            self.attend(move |engine, now| switch.work(engine, now))?;
        } else {
            self.attend_often(move |engine, now| switch.work(engine, now))?;
        }
        Ok(ethernet)
    }

    /// As [`SupervisorThread::start_ethernet`], with interfaces of another kind, which are read every half millisecond.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn start_ethernet_on(&self, options: EthernetOptions, mut make: MakeInterface) -> Result<Ethernet, Error> {
        self.start_switch(options, Box::new(move |name, mac| make(name, mac).map(Some)), false)
    }
}

/// One interface and the SubDevice behind it.
struct End {
    name: String,
    subdevice: EthernetSubDevice,
    interface: Box<dyn HostInterface>,
    /// `None`: not known yet.
    carrier: Option<bool>,
    refused: u64,
}

/// Runs in the supervisor's thread.
struct Switch {
    options: EthernetOptions,
    make: Make,
    shared: Arc<Shared>,
    ends: Vec<End>,
    /// SubDevices with an interface that cannot be created.
    refused: Vec<EthernetSubDevice>,
    refresh_at: Instant,
}

impl Switch {
    fn new(options: EthernetOptions, make: Make, waker: Waker) -> (Ethernet, Switch) {
        let shared = Arc::new(Shared { ended: AtomicBool::new(false), published: Mutex::default(), waker });
        let (ends, refused, refresh_at) = (Vec::new(), Vec::new(), Instant(0));
        (Ethernet(shared.clone()), Switch { options, make, shared, ends, refused, refresh_at })
    }

    /// Moves frames between interfaces and mailboxes; true when the interfaces are dropped.
    fn work(&mut self, engine: &mut Engine, now: Instant) -> bool {
        if self.shared.ended.load(Ordering::Relaxed) {
            self.ends.clear();
            return true;
        }
        if now >= self.refresh_at {
            self.refresh_at = now + REFRESH;
            self.refresh(engine);
        }
        for end in &mut self.ends {
            if let Some(up) = end.pass(engine) {
                end.interface.set_carrier(up);
                if end.carrier.replace(up).is_some() || up {
                    publish(&self.shared, EthernetEvent::Carrier { name: end.name.clone(), carrier: up });
                }
            }
        }
        false
    }

    /// Creates interfaces for new SubDevices; removes those of a stopped MainDevice.
    fn refresh(&mut self, engine: &mut Engine) {
        let found = engine.ethernet_subdevices();
        self.ends.retain_mut(|end| {
            let removed = !end.interface.exists();
            if removed {
                publish(&self.shared, EthernetEvent::Removed { name: end.name.clone() });
            }
            // A declaration with this SubDevice may have begun or ended.
            let now = found.iter().find(|it| it.is_at_place_of(&end.subdevice));
            end.subdevice = *now.unwrap_or(&end.subdevice);
            if now.is_none() {
                // Nothing moves the frames of one that outlasts this MainDevice.
                end.interface.set_carrier(false);
            }
            !removed && now.is_some()
        });
        self.refused.retain(|refused| found.iter().any(|it| it.is_at_place_of(refused)));
        for subdevice in found {
            let known = self.ends.iter().map(|end| &end.subdevice).chain(&self.refused);
            if known.into_iter().any(|known| known.is_at_place_of(&subdevice)) {
                continue;
            }
            match self.make(subdevice) {
                Ok(None) => {}
                Ok(Some(end)) => {
                    let name = end.name.clone();
                    publish(&self.shared, EthernetEvent::Made { name, subdevice: subdevice.subdevice });
                    self.ends.push(end);
                }
                Err(error) => {
                    self.refused.push(subdevice);
                    publish(&self.shared, EthernetEvent::Refused(error));
                }
            }
        }
        let interfaces = self.ends.iter().filter_map(|end| {
            let status = engine.ethernet_port(end.subdevice.subdevice)?.status();
            let End { name, subdevice, refused, .. } = end;
            Some(EthernetInterface { name: name.clone(), subdevice: *subdevice, status, refused: *refused })
        });
        let interfaces: Vec<EthernetInterface> = interfaces.collect();
        // The last counters are kept when the interfaces are removed.
        if !interfaces.is_empty() {
            self.shared.published().interfaces = interfaces;
        }
    }

    fn make(&mut self, subdevice: EthernetSubDevice) -> Result<Option<End>, TapError> {
        let mut name = self.options.name(&subdevice);
        if self.ends.iter().any(|end| end.name == name) {
            // An alias that two SubDevices share is not used in names.
            name = self.options.name(&EthernetSubDevice::new(subdevice.subdevice, subdevice.position, 0));
        }
        let interface = (self.make)(&name, self.options.mac(&subdevice))?;
        Ok(interface.map(|interface| {
            let carrier = (!interface.may_have_carrier()).then_some(false);
            End { name, subdevice, interface, carrier, refused: 0 }
        }))
    }
}

fn publish(shared: &Shared, events: EthernetEvent) {
    let unread = &mut shared.published().events;
    if unread.len() < UNREAD_EVENTS {
        unread.push(events);
    }
}

impl End {
    /// Moves frames in both directions. Returns the new carrier state if it has to change.
    fn pass(&mut self, engine: &mut Engine) -> Option<bool> {
        let mut room = [0; MAX_FRAME + 1];
        let port = engine.ethernet_port(self.subdevice.subdevice);
        let Some(port) = port.filter(|port| port.is_up()) else {
            // Frames for an absent SubDevice must not reach it after its return.
            for _ in 0..QUEUE {
                if self.interface.receive(&mut room).is_none() {
                    break;
                }
            }
            return (self.carrier != Some(false)).then_some(false);
        };
        for _ in 0..BURST {
            let Some(frame) = port.pop_frame() else { break };
            self.refused += u64::from(!self.interface.send(&frame.bytes));
        }
        while port.room() > 0 {
            let Some(length) = self.interface.receive(&mut room) else { break };
            // A frame that is too long cannot pass; there is room for it.
            let _ = port.send(&room[..length]);
        }
        (self.carrier != Some(true)).then_some(true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_engine::main_device::SubDeviceId;
    use ringcat_wire::address::Position;

    // covers: eoe-interfaces
    #[test]
    fn interfaces_are_named_and_addressed_by_position_or_alias() {
        let options = EthernetOptions::new(0, [0x00, 0x1B, 0x21, 0xAA, 0xBB, 0xCC]);
        let by_position = EthernetSubDevice::new(SubDeviceId(4), Position(2), 0);
        let by_alias = EthernetSubDevice::new(SubDeviceId(4), Position(2), 1000);
        assert_eq!((options.name(&by_position), options.name(&by_alias)), ("eoe0s2".into(), "eoe0a1000".into()));
        assert_eq!(options.mac(&by_position), [0x02, 0xAA, 0xBB, 0xCC, 0, 2]);
        assert_eq!(options.mac(&by_alias), [0x06, 0xAA, 0xBB, 0xCC, 0x03, 0xE8]);
        let longest = EthernetOptions { index: u16::MAX, ..options };
        let last = EthernetSubDevice::new(SubDeviceId(4), Position(u16::MAX), 0);
        assert_eq!(longest.name(&last).len(), 14, "the kernel allows 15");
    }
}
