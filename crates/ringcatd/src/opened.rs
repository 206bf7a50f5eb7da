//! Open links of a master, which a process drives: their descriptors, their interfaces as these come and go, and their
//! end.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ringcat::foreign::ListeningSockets;
use ringcat_control::message::{HandedLink, HandedLinks};
use ringcat_link::capabilities::{self, Capabilities};
use ringcat_link::packet_socket::binding::{give, given};
use ringcat_link::{LinkError, interface, revoke};

use crate::device::{Device, Found};
use crate::opener::SLOTS;

/// Address that stands for an interface that was never seen: locally administered, with the number of the link.
const UNSEEN: [u8; 6] = [0x02, b'R', b'C', 0, 0, 0];

/// Open links, to be duplicated for the process that drives them.
#[derive(Debug)]
pub struct Opened {
    links: HandedLinks,
    /// In the order of [`HandedLinks`].
    descriptors: Vec<OwnedFd>,
    state: Mutex<State>,
    /// How often sockets got an interface.
    bindings: AtomicU32,
}

/// What the sockets lead to.
#[derive(Debug)]
enum State {
    /// A simulated segment.
    Pipes,
    /// These interfaces.
    Interfaces(Vec<Followed>),
    /// Nothing any more: another process may still have them.
    Revoked,
}

/// An interface that may come and go.
#[derive(Debug)]
struct Followed {
    device: Device,
    /// Its last known name.
    name: String,
    is_there: bool,
    /// An owner has ordered it switched off.
    is_off: bool,
}

impl Opened {
    /// Pipes to a simulated segment.
    pub fn pipes(links: HandedLinks, descriptors: Vec<OwnedFd>) -> Opened {
        Opened { links, descriptors, state: Mutex::new(State::Pipes), bindings: AtomicU32::new(0) }
    }

    /// Sockets that get these interfaces, as far as they are there.
    ///
    /// # Errors
    /// No interface is there, one is no Ethernet interface, or there are not two sockets for each; for the operator.
    pub fn interfaces(devices: &[Device], sockets: Vec<OwnedFd>) -> Result<Opened, String> {
        let failed = |error: LinkError| error.to_string();
        let mut followed = Vec::new();
        let mut links = Vec::new();
        for (number, device) in devices.iter().enumerate() {
            let found = device.find(&[])?;
            if let Some(Found { name, interface }) = &found {
                for socket in of_link(&sockets, number, devices.len()) {
                    give(socket.as_fd(), name, *interface).map_err(failed)?;
                }
            }
            let absent_mac = found.is_none().then_some(stand_in(device, number));
            let is_there = found.is_some();
            let name = found.map_or_else(|| device.to_string(), |found| found.name);
            links.push(HandedLink::Interface { name: name.clone(), slots: SLOTS, absent_mac });
            followed.push(Followed { device: device.clone(), name, is_there, is_off: false });
        }
        if let Some(missing) = devices.first().filter(|_| !followed.iter().any(|it| it.is_there)) {
            return Err(missing.missing());
        }
        let mut links = links.into_iter();
        let main = links.next().ok_or_else(|| "a master has no link".to_owned())?;
        let links = HandedLinks::new(main, links.next());
        let state = Mutex::new(State::Interfaces(followed));
        Ok(Opened { links, descriptors: sockets, state, bindings: AtomicU32::new(0) })
    }

    /// Interfaces that are not there.
    pub fn absent(&self) -> Vec<String> {
        match &*self.state() {
            State::Interfaces(all) => all.iter().filter(|it| !it.is_there).map(|it| it.device.to_string()).collect(),
            State::Pipes | State::Revoked => Vec::new(),
        }
    }

    /// What the links are.
    pub fn links(&self) -> &HandedLinks {
        &self.links
    }

    /// The descriptors in the order of [`HandedLinks`].
    pub fn descriptors(&self) -> &[OwnedFd] {
        &self.descriptors
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Duplicates, for this process.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn duplicates(&self) -> Result<Vec<OwnedFd>, String> {
        self.descriptors.iter().map(OwnedFd::try_clone).collect::<Result<_, _>>().map_err(|error| error.to_string())
    }

    /// Whether links can be switched off and on: they are interfaces, and this process may.
    pub fn can_switch(&self) -> bool {
        matches!(&*self.state(), State::Interfaces(_)) && capabilities::has(Capabilities::ADMIN)
    }

    /// Whether no network device is there: all interfaces were removed.
    pub fn is_without_device(&self) -> bool {
        matches!(&*self.state(), State::Interfaces(all) if !all.iter().any(|it| it.is_there))
    }

    /// Gives the sockets interfaces that have come, or come back, whichever process has them; a removed interface takes
    /// nothing with it but its frames. What has changed, for the operator.
    pub fn follow_interfaces(&self) -> Vec<String> {
        let mut state = self.state();
        let State::Interfaces(all) = &mut *state else { return Vec::new() };
        let count = all.len();
        let mut changes = Vec::new();
        for (number, one) in all.iter_mut().enumerate() {
            let sockets = || of_link(&self.descriptors, number, count);
            let Some(Found { name, interface }) = one.device.find(&[]).ok().flatten() else {
                if std::mem::replace(&mut one.is_there, false) {
                    changes.push(format!("interface {} was removed", one.name));
                }
                continue;
            };
            one.name = name;
            let has_it = |socket: &OwnedFd| given(socket.as_fd()).is_ok_and(|index| index == Some(interface.index));
            if sockets().all(has_it) {
                continue;
            }
            // It may be gone again; the next check tries again.
            let is_given = sockets().all(|socket| give(socket.as_fd(), &one.name, interface).is_ok());
            self.bindings.fetch_add(1, Ordering::AcqRel);
            if is_given && !std::mem::replace(&mut one.is_there, true) {
                changes.push(format!("interface {} is there", one.name));
            } else if is_given {
                changes.push(format!("interface {} is another one now", one.name));
            }
        }
        changes
    }

    /// Switches the interface of a link off or on, as an owner orders it. It is on again when the owner's time ends.
    ///
    /// # Errors
    /// There is no such interface, or the daemon may not; for the operator.
    pub fn switch(&self, link: usize, up: bool) -> Result<(), String> {
        let mut state = self.state();
        let one = match &mut *state {
            State::Interfaces(all) => all.get_mut(link),
            State::Pipes | State::Revoked => None,
        };
        let one = one.ok_or_else(|| "there is no interface to be switched".to_owned())?;
        interface::switch(&one.name, up).map_err(|error| error.to_string())?;
        one.is_off = !up;
        Ok(())
    }

    /// Takes the interfaces away from all processes that have these descriptors, and switches those on that were
    /// switched off. Pipes end when fresh ones are opened.
    pub fn revoke(&self) {
        let before = std::mem::replace(&mut *self.state(), State::Revoked);
        let State::Interfaces(all) = before else { return };
        // The kernel waits for all processors with each: they wait together.
        std::thread::scope(|scope| {
            for socket in &self.descriptors {
                // It was opened as a packet socket; nothing else can be wrong with it.
                let take = || _ = revoke(socket.as_fd());
                if std::thread::Builder::new().name("revoke".into()).spawn_scoped(scope, take).is_err() {
                    take();
                }
            }
        });
        for one in all.iter().filter(|one| one.is_off) {
            // It may be gone: then it comes back as its operator has it.
            let _ = interface::switch(&one.name, true);
        }
    }
}

impl ListeningSockets for Opened {
    fn binding(&self) -> Option<u32> {
        let state = self.state();
        let is_bound = match &*state {
            State::Pipes => true,
            State::Revoked => false,
            State::Interfaces(all) => all.iter().enumerate().all(|(number, one)| {
                // One that is not there has no carrier.
                let Some(Found { interface, .. }) = one.device.find(&[]).ok().flatten() else { return true };
                let has_it = |socket: &OwnedFd| given(socket.as_fd()).is_ok_and(|index| index == Some(interface.index));
                of_link(&self.descriptors, number, all.len()).all(has_it)
            }),
        };
        is_bound.then(|| self.bindings.load(Ordering::Acquire))
    }
}

/// The address that stands for an interface that is not there: its own if it is known.
fn stand_in(device: &Device, link: usize) -> [u8; 6] {
    let [a, b, c, d, e, _] = UNSEEN;
    match device {
        Device::Address(address) => *address,
        Device::Name(_) | Device::First => [a, b, c, d, e, link as u8],
    }
}

/// The sockets of a link: of the cyclic and of the acyclic half.
fn of_link(sockets: &[OwnedFd], link: usize, links: usize) -> impl Iterator<Item = &OwnedFd> {
    [sockets.get(link), sockets.get(links + link)].into_iter().flatten()
}
