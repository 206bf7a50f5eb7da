//! A simulated segment behind pipes for frames, in the process that simulates it.
//!
//! In: frames of both classes on each link. Out: frames that have come back, on the pipe of their class. Virtual time
//! follows `CLOCK_MONOTONIC`, so a round trip is as long as on a real segment. The segment lives on when its links are
//! connected anew, as SubDevices do when another process takes over.

use std::os::fd::OwnedFd;

use ringcat_engine::link::Link;
use ringcat_engine::{Class, class_of};
use ringcat_link::{FramePipe, LinkError, monotonic, wait_pipes};
use ringcat_sim::cable::HostLink;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;

use crate::simulated::host_link;

/// Longest sleep: a change from outside is seen within it.
const NAP_NS: u64 = 500_000;

/// A simulated segment with the far ends of its pipes.
#[derive(Debug)]
pub struct PipedSegment {
    network: Network,
    begin_ns: u64,
    pipes: Vec<Far>,
    /// When its links were connected last.
    connected_ns: u64,
    /// When the first frame came since.
    first_frame_ns: Option<u64>,
    /// Frames of the cyclic half since the beginning.
    cyclic_frames: u64,
}

/// The far end of a pipe.
#[derive(Debug)]
struct Far {
    link: Link,
    class: Class,
    pipe: FramePipe,
}

/// The near ends for a process that drives the segment, to be adopted by [`crate::piped::PipedLinks`].
#[derive(Debug)]
#[non_exhaustive]
pub struct NearEnds {
    /// Pipes of the cyclic half: main, redundant.
    pub cyclic: (OwnedFd, Option<OwnedFd>),
    /// Pipes of the acyclic half.
    pub acyclic: (OwnedFd, Option<OwnedFd>),
}

/// The far ends for the process with the segment.
#[derive(Debug)]
pub struct FarEnds(Vec<Far>);

/// New pipes to a segment with one link or two.
///
/// # Errors
/// The process has no more descriptors.
pub fn connect(is_ring: bool) -> Result<(NearEnds, FarEnds), LinkError> {
    let mut far = Vec::new();
    let mut pipe = |link, class| {
        let (near, end) = FramePipe::pair()?;
        far.push(Far { link, class, pipe: end });
        Ok::<OwnedFd, LinkError>(near.into_descriptor())
    };
    let mut half = |class| {
        let redundant = is_ring.then(|| pipe(Link::Redundant, class)).transpose()?;
        Ok::<_, LinkError>((pipe(Link::Main, class)?, redundant))
    };
    let (cyclic, acyclic) = (half(Class::Cyclic)?, half(Class::Acyclic)?);
    Ok((NearEnds { cyclic, acyclic }, FarEnds(far)))
}

impl FarEnds {
    /// Descriptors for the process with the segment, in the order in which [`FarEnds::adopt`] expects them.
    pub fn into_descriptors(mut self) -> Vec<OwnedFd> {
        self.0.sort_by_key(|far| place(far.link, far.class));
        self.0.into_iter().map(|far| far.pipe.into_descriptor()).collect()
    }

    /// The far ends from descriptors of another process: main link cyclic, main acyclic, then the same of the redundant
    /// link if there is one.
    ///
    /// # Errors
    /// There are not two or four descriptors, or one is no pipe for frames.
    pub fn adopt(descriptors: Vec<OwnedFd>) -> Result<FarEnds, String> {
        if !matches!(descriptors.len(), 2 | 4) {
            return Err(format!("expected two or four pipes for frames, got {}", descriptors.len()));
        }
        let adopt = |(at, fd): (usize, OwnedFd)| {
            let link = if at < 2 { Link::Main } else { Link::Redundant };
            let class = if at % 2 == 0 { Class::Cyclic } else { Class::Acyclic };
            Ok(Far { link, class, pipe: FramePipe::adopt(fd).map_err(|error| error.to_string())? })
        };
        Ok(FarEnds(descriptors.into_iter().enumerate().map(adopt).collect::<Result<_, String>>()?))
    }
}

fn place(link: Link, class: Class) -> usize {
    2 * link.index() + usize::from(class == Class::Acyclic)
}

impl PipedSegment {
    /// A segment whose virtual time, which is at zero, goes on from now. Nothing is connected to its links.
    pub fn new(network: Network) -> PipedSegment {
        let begin_ns = monotonic::now_ns();
        let (connected_ns, first_frame_ns, cyclic_frames) = (begin_ns, None, 0);
        PipedSegment { network, begin_ns, pipes: Vec::new(), connected_ns, first_frame_ns, cyclic_frames }
    }

    /// Whether it has two links.
    pub fn is_ring(&self) -> bool {
        self.network.host_cable(HostLink::Redundant).is_some()
    }

    /// Connects its links anew: nothing passes through earlier pipes from now on. Frames that are under way are lost.
    pub fn connect(&mut self, ends: FarEnds) {
        self.turn();
        self.pipes = ends.0;
        (self.connected_ns, self.first_frame_ns) = (monotonic::now_ns(), None);
    }

    /// When its links were connected last, on the monotonic clock.
    pub fn connected_ns(&self) -> u64 {
        self.connected_ns
    }

    /// When the first frame came since then.
    pub fn first_frame_ns(&self) -> Option<u64> {
        self.first_frame_ns
    }

    /// Frames of the cyclic half that have come since the beginning.
    pub fn cyclic_frames(&self) -> u64 {
        self.cyclic_frames
    }

    /// Whether no process is at the near ends: all are gone, or none has been connected yet.
    pub fn is_abandoned(&self) -> bool {
        self.pipes.iter().all(|far| far.pipe.is_ended())
    }

    /// The segment, to read from it or to inject faults.
    pub fn network_mut(&mut self) -> &mut Network {
        self.bring_up_to_date();
        &mut self.network
    }

    /// One turn: what is due happens, frames go in and out.
    pub fn turn(&mut self) {
        self.bring_up_to_date();
        let PipedSegment { network, pipes, first_frame_ns, cyclic_frames, .. } = self;
        for far in pipes.iter_mut() {
            while far.pipe.receive(&mut |frame| network.send(host_link(far.link), frame)) {
                first_frame_ns.get_or_insert_with(monotonic::now_ns);
                *cyclic_frames += u64::from(far.class == Class::Cyclic);
            }
        }
        for link in Link::ALL {
            while let Some(received) = network.receive(host_link(link)) {
                let class = class_of(&received.bytes).unwrap_or(Class::Cyclic);
                if let Some(far) = pipes.iter_mut().find(|far| (far.link, far.class) == (link, class)) {
                    far.pipe.send(&received.bytes);
                }
                network.give_back(received.bytes);
            }
        }
    }

    /// Waits until a frame arrives or something is due in the segment, but not for long.
    pub fn wait(&self) {
        let now = monotonic::now_ns();
        let due = self.network.next_event().map_or(u64::MAX, |at| at.0.saturating_add(self.begin_ns));
        let pipes: Vec<&FramePipe> = self.pipes.iter().map(|far| &far.pipe).collect();
        wait_pipes(&pipes, None, due.clamp(now, now + NAP_NS));
    }

    fn bring_up_to_date(&mut self) {
        self.network.advance(SimTime(monotonic::now_ns().saturating_sub(self.begin_ns)));
    }
}
