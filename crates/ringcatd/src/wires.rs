//! The links of a master: opened, taken away from a process that had them, opened anew.
//!
//! Descriptors cannot be revoked. Pipes to a simulated segment lose their far ends; packet sockets are bound to the
//! loopback interface, which acts on the one socket that both processes hold. The next owner gets fresh ones.

use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::Child;

use ringcat::piped::segment::connect;
use ringcat_control::message::{HandedLink, HandedLinks};
use ringcat_link::packet_socket::prepared::Prepared;
use ringcat_link::{ClassFilter, LinkError, PacketOptions, PacketSocket, ReceiveMode, descriptors, revoke};

use crate::segment_process;
use crate::source::Source;

/// Sets of sockets that are prepared: applications that end in quick succession find one each.
const SETS: usize = 2;
/// Slots of a receive ring for one class of frames, 2 KiB each.
const SLOTS: u32 = 128;

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
    main: String,
    redundant: Option<String>,
    /// Sets of sockets that wait without an interface, since the kernel takes long to make their rings; each in the
    /// order of [`HandedLinks`].
    spares: Vec<Vec<Prepared>>,
}

/// What makes sockets for the next process, without the lock of the links.
#[derive(Clone, Copy, Debug)]
pub struct Lacking {
    links: usize,
}

/// Descriptors of links, to be duplicated for the process that drives them.
#[derive(Debug)]
pub struct Opened {
    /// What they are.
    pub links: HandedLinks,
    /// The descriptors in the order of [`HandedLinks`].
    pub descriptors: Vec<OwnedFd>,
}

impl Wires {
    /// The links that an option names; starts the process of a simulated segment.
    ///
    /// # Errors
    /// What is wrong, for the operator.
    pub fn of(source: &Source) -> Result<Wires, String> {
        match source {
            Source::Simulated(file) => {
                let (child, control, is_ring) = segment_process::start(file)?;
                Ok(Wires::Segment { control, is_ring, child: Some(child) })
            }
            Source::Interfaces(main, redundant) => {
                let (main, redundant) = (main.clone(), redundant.clone());
                Ok(Wires::Interfaces(Interfaces { main, redundant, spares: Vec::new() }))
            }
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

    /// Opens fresh links.
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
                let redundant = is_ring.then_some(HandedLink::Pipe);
                Ok(Opened {
                    links: HandedLinks { main: HandedLink::Pipe, redundant },
                    descriptors: all.into_iter().flatten().flatten().collect(),
                })
            }
            Wires::Interfaces(interfaces) => interfaces.open(),
        }
    }

    /// Whether sockets for the next process are to be prepared.
    pub fn lacking(&self) -> Option<Lacking> {
        match self {
            Wires::Interfaces(Interfaces { redundant, spares, .. }) if spares.len() < SETS => {
                Some(Lacking { links: 1 + usize::from(redundant.is_some()) })
            }
            Wires::Interfaces(_) | Wires::Segment { .. } => None,
        }
    }

    /// Keeps a set of sockets.
    pub fn keep(&mut self, prepared: Vec<Prepared>) {
        if let Wires::Interfaces(Interfaces { spares, .. }) = self {
            spares.push(prepared);
        }
    }
}

impl Lacking {
    /// Makes a set. The kernel takes 10 to 20 ms for each.
    ///
    /// # Errors
    /// This user may not, or there is no memory for them.
    pub fn prepare(self) -> Result<Vec<Prepared>, LinkError> {
        let both = [ClassFilter::Cyclic, ClassFilter::Acyclic];
        let each = both.into_iter().flat_map(|filter| std::iter::repeat_n(filter, self.links));
        each.map(|filter| Prepared::new(&options(filter))).collect()
    }
}

impl Interfaces {
    /// Opens the links with the sockets that were prepared, or with new ones.
    fn open(&mut self) -> Result<Opened, String> {
        let Interfaces { main, redundant, spares } = self;
        let mut prepared = spares.pop().unwrap_or_default().into_iter();
        let mut descriptors = Vec::new();
        for filter in [ClassFilter::Cyclic, ClassFilter::Acyclic] {
            for name in [Some(&*main), redundant.as_ref()].into_iter().flatten() {
                descriptors.push(socket(name, filter, prepared.next())?);
            }
        }
        let link = |name: &String| HandedLink::Interface { name: name.clone(), slots: SLOTS };
        let links = HandedLinks { main: link(main), redundant: redundant.as_ref().map(link) };
        Ok(Opened { links, descriptors })
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

fn options(filter: ClassFilter) -> PacketOptions {
    PacketOptions::default().with_filter(filter).with_receive(ReceiveMode::Blocking).with_ring_frames(SLOTS)
}

/// A packet socket for one class of frames. Its ring is unmapped here, and mapped by the process that drives it.
fn socket(interface: &str, filter: ClassFilter, prepared: Option<Prepared>) -> Result<OwnedFd, String> {
    let socket = match prepared {
        Some(prepared) => prepared.bind(interface),
        None => PacketSocket::open(interface, &options(filter)),
    };
    let socket = socket.map_err(|error| error.to_string())?;
    socket.as_fd().try_clone_to_owned().map_err(|error| format!("{interface}: {error}"))
}

impl Opened {
    /// Duplicates, for this process.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn duplicates(&self) -> Result<Vec<OwnedFd>, String> {
        self.descriptors.iter().map(OwnedFd::try_clone).collect::<Result<_, _>>().map_err(|error| error.to_string())
    }

    /// Takes the interfaces away from all processes that have these descriptors. Pipes end when fresh ones are opened.
    pub fn revoke(&self) {
        if matches!(self.links.main, HandedLink::Interface { .. }) {
            for socket in &self.descriptors {
                // It was opened as a packet socket; nothing else can be wrong with it.
                let _ = revoke(socket.as_fd());
            }
        }
    }
}
