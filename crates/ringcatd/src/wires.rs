//! The links of a master: opened, taken away from a process that had them, opened anew.
//!
//! Descriptors cannot be revoked. Pipes to a simulated segment lose their far ends; packet sockets are bound to the
//! loopback interface, which acts on the one socket that both processes hold. The next owner gets fresh ones.

use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::Child;
use std::sync::Arc;

use ringcat::piped::segment::connect;
use ringcat_control::message::{HandedLink, HandedLinks};
use ringcat_link::descriptors;
use ringcat_link::interface::{self, free};

use crate::device::Device;
use crate::opened::Opened;
use crate::opener::Opener;
use crate::segment_process;
use crate::source::Source;

/// Sets of sockets that are prepared: applications that end in quick succession find one each.
const SETS: usize = 2;

/// Where fresh links come from.
#[derive(Debug)]
pub enum Wires {
    /// The process of a simulated segment.
    Segment {
        /// Takes the far ends of pipes.
        control: UnixStream,
        /// It has two links.
        is_ring: bool,
        /// The process, if this one has started it.
        child: Option<Child>,
    },
    /// Network interfaces.
    Interfaces(Interfaces),
}

/// Network interfaces, with sockets for the next process.
#[derive(Debug)]
pub struct Interfaces {
    /// Main, redundant.
    devices: Vec<Device>,
    /// Those of other masters: never the first one that is free.
    others: Vec<Device>,
    /// Address of the interface that was the first one that was free.
    chosen: Option<[u8; 6]>,
    /// No link is used while one lacks its interface.
    needs_all: bool,
    /// Sets of sockets that wait without an interface, since the kernel takes long to make their rings; each in the
    /// order of [`HandedLinks`].
    spares: Vec<Vec<OwnedFd>>,
    opener: Arc<Opener>,
}

/// What makes sockets for the next process, without the lock of the links.
#[derive(Clone, Debug)]
pub struct Lacking {
    links: usize,
    opener: Arc<Opener>,
}

impl Wires {
    /// The links that an option names; starts the process of a simulated segment. `others` are the interfaces of other
    /// masters.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn of(source: &Source, others: &[Device], opener: &Arc<Opener>) -> Result<Wires, String> {
        match source {
            Source::Simulated(file) => {
                let (child, control, is_ring) = segment_process::start(file)?;
                Ok(Wires::Segment { control, is_ring, child: Some(child) })
            }
            Source::Interfaces(..) => Ok(Wires::Interfaces(Interfaces {
                devices: source.devices().cloned().collect(),
                others: others.to_vec(),
                chosen: None,
                needs_all: false,
                spares: Vec::new(),
                opener: opener.clone(),
            })),
        }
    }

    /// No link is used while one lacks its interface, also of a ring.
    pub fn need_all(&mut self) {
        if let Wires::Interfaces(interfaces) = self {
            interfaces.needs_all = true;
        }
    }

    /// Why the interface that was chosen is to be left alone from now on, if it is: it is gone, or the host uses it.
    pub fn misfit(&self) -> Option<String> {
        let Wires::Interfaces(Interfaces { chosen, .. }) = self else { return None };
        misfit((*chosen)?)
    }

    /// Whether other programs and machines may have access to the segment.
    pub const fn are_shared(&self) -> bool {
        matches!(self, Wires::Interfaces(_))
    }

    /// Leaves the interface that was chosen. The next open chooses again.
    pub fn leave(&mut self) {
        if let Wires::Interfaces(Interfaces { chosen, .. }) = self {
            *chosen = None;
        }
    }

    /// The links to a segment that another thread or process simulates, which it has said.
    ///
    /// # Errors
    /// What is wrong with the segment.
    pub fn to_segment(control: UnixStream) -> Result<Wires, String> {
        let is_ring = segment_process::greeting(&control)?;
        Ok(Wires::Segment { control, is_ring, child: None })
    }

    /// Opens fresh links. Of two interfaces one may be absent.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn open(&mut self) -> Result<Opened, String> {
        match self {
            Wires::Segment { control, is_ring, child } => {
                if child.as_mut().is_some_and(|child| child.try_wait().is_ok_and(|status| status.is_some())) {
                    return Err("the process of the simulated segment has ended".to_owned());
                }
                let (near, far) = connect(*is_ring).map_err(|error| error.to_string())?;
                let far = far.into_descriptors();
                let raw: Vec<_> = far.iter().map(AsRawFd::as_raw_fd).collect();
                let sent = descriptors::send(control, b"links", &raw);
                sent.map_err(|error| format!("the process of the simulated segment: {error}"))?;
                let half = |(main, redundant): (OwnedFd, Option<OwnedFd>)| [Some(main), redundant];
                let all = [half(near.cyclic), half(near.acyclic)];
                let links = HandedLinks::new(HandedLink::Pipe, is_ring.then_some(HandedLink::Pipe));
                Ok(Opened::pipes(links, all.into_iter().flatten().flatten().collect()))
            }
            Wires::Interfaces(interfaces) => interfaces.open(),
        }
    }

    /// Whether sockets for the next process are to be prepared.
    pub fn lacking(&self) -> Option<Lacking> {
        match self {
            Wires::Interfaces(Interfaces { devices, spares, opener, .. }) if spares.len() < SETS => {
                Some(Lacking { links: devices.len(), opener: opener.clone() })
            }
            Wires::Interfaces(_) | Wires::Segment { .. } => None,
        }
    }

    /// Keeps a set of sockets.
    pub fn keep(&mut self, prepared: Vec<OwnedFd>) {
        if let Wires::Interfaces(Interfaces { spares, .. }) = self {
            spares.push(prepared);
        }
    }
}

impl Interfaces {
    /// Of two interfaces one may be absent, unless all are needed.
    fn open(&mut self) -> Result<Opened, String> {
        let devices =
            self.devices.clone().into_iter().map(|device| self.settled(device)).collect::<Result<Vec<_>, _>>()?;
        if self.needs_all {
            let is_absent = |device: &&Device| !matches!(device.find(&[]), Ok(Some(_)));
            if let Some(absent) = devices.iter().find(is_absent) {
                return Err(format!("waits for interface {absent}"));
            }
        }
        let set = self.spares.pop().map_or_else(|| self.opener.set(devices.len()), Ok)?;
        Opened::interfaces(&devices, set)
    }

    /// The first interface that is free is chosen once, and stays until it is left: after an application that has it
    /// the daemon brings its SubDevices to their safe state in any case.
    fn settled(&mut self, device: Device) -> Result<Device, String> {
        if device != Device::First {
            return Ok(device);
        }
        let is_there = |address: &[u8; 6]| interface::list().iter().any(|it| it.mac == *address);
        let chosen = match self.chosen.take().filter(is_there) {
            Some(address) => address,
            None => device.find(&self.others)?.ok_or_else(|| device.missing())?.interface.mac,
        };
        self.chosen = Some(chosen);
        Ok(Device::Address(chosen))
    }
}

/// Why an interface that was chosen must be left alone.
fn misfit(address: [u8; 6]) -> Option<String> {
    let device = Device::Address(address);
    match interface::list().into_iter().find(|it| device.is(it)) {
        None => Some(format!("interface {device} was removed")),
        Some(interface) => free::in_use(&interface).map(|why| format!("leaves {} alone: {why}", interface.name)),
    }
}

impl Lacking {
    /// Makes a set. The kernel takes 10 to 20 ms for each socket.
    ///
    /// # Errors
    /// This user may not, or there is no memory for them.
    pub fn prepare(&self) -> Result<Vec<OwnedFd>, String> {
        self.opener.set(self.links)
    }
}

impl Drop for Wires {
    fn drop(&mut self) {
        if let Wires::Segment { child: Some(child), .. } = self {
            // It may live on for an application; if it has ended no zombie is left.
            let _ = child.try_wait();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An application may get the interface between the check and the decision: it stays chosen then.
    // covers: daemon
    #[test]
    fn an_interface_stays_chosen_until_it_is_left_whatever_hinders_it() {
        let source = Source::Interfaces(Device::First, None);
        let mut wires = Wires::of(&source, &[], &Arc::new(Opener::Here)).expect("it has a name");
        assert_eq!(wires.misfit(), None, "none is chosen");
        let Wires::Interfaces(interfaces) = &mut wires else { panic!("it has interfaces") };
        interfaces.chosen = Some([2, 0, 0, 0, 0, 0x99]);
        for _ in 0..2 {
            assert_eq!(wires.misfit().as_deref(), Some("interface 02:00:00:00:00:99 was removed"));
        }
        wires.leave();
        assert_eq!(wires.misfit(), None);
    }
}
