//! Cycles in parts: links that record what leaves and hold back what arrives, and a checker of outputs on the wire and
//! inside the SubDevices.
//!
//! Each write of the application fills all outputs of a domain with a number of its own. On the wire: a domain leaves
//! in a send after it was queued, with the number that it had then, and at no other time. Inside a SubDevice: each
//! number that it took has left, whole, and never follows a newer one.

use ringcat::simulated::SimulatedSegment;
use ringcat::{Direction, DomainId, Instant, Link, Links};
use ringcat_engine::{Class, class_of};
use ringcat_sim::network::Network;
use ringcat_wire::command::Command;
use ringcat_wire::frame::{Frame, MacAddress};

use crate::areas::Area;
use crate::truth::Departure;

/// Offset of the frame id in the source address, and of the first datagram's Idx.
const MARKS_AT: [usize; 2] = [7, 17];

/// Links into a simulated segment that record cyclic frames, and hold returned ones back on request.
#[derive(Debug)]
pub struct PartLinks {
    segment: SimulatedSegment,
    sent: Vec<(Link, Vec<u8>)>,
    is_holding: bool,
    held: Vec<(Link, Vec<u8>)>,
}

impl PartLinks {
    /// Links into a network.
    pub fn new(network: Network) -> PartLinks {
        PartLinks { segment: SimulatedSegment::new(network), sent: Vec::new(), is_holding: false, held: Vec::new() }
    }

    /// The segment.
    pub fn network(&self) -> &Network {
        self.segment.network()
    }

    /// The segment, for faults.
    pub fn network_mut(&mut self) -> &mut Network {
        self.segment.network_mut()
    }

    /// Cyclic frames that were sent since the last call.
    pub fn take_sent(&mut self) -> Vec<(Link, Vec<u8>)> {
        std::mem::take(&mut self.sent)
    }

    /// Whether returned cyclic frames are held back from now on.
    pub fn hold(&mut self, is_holding: bool) {
        self.is_holding = is_holding;
    }

    /// Frames that were held back.
    pub fn take_held(&mut self) -> Vec<(Link, Vec<u8>)> {
        std::mem::take(&mut self.held)
    }
}

impl Links for PartLinks {
    fn now(&self) -> Instant {
        self.segment.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.segment.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        if class_of(frame) == Some(Class::Cyclic) {
            self.sent.push((link, frame.to_vec()));
        }
        self.segment.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        loop {
            let (mut is_held, held) = (false, &mut self.held);
            let is_holding = self.is_holding;
            let any = self.segment.receive(&mut |link, frame| {
                is_held = is_holding && class_of(frame) == Some(Class::Cyclic);
                if is_held {
                    held.push((link, frame.to_vec()));
                } else {
                    take(link, frame);
                }
            });
            if !is_held {
                return any;
            }
        }
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.segment.carrier(link)
    }

    fn wait(&mut self, until: Instant) {
        self.segment.wait(until);
    }
}

/// Marks of frames, each once.
pub fn marks(frames: &[(Link, Vec<u8>)]) -> Departure {
    let of_main = frames.iter().filter(|(link, _)| *link == Link::Main);
    of_main.map(|(_, bytes)| (bytes[MARKS_AT[0]], bytes[MARKS_AT[1]])).collect()
}

/// Outputs of a domain.
#[derive(Debug, Default)]
struct Outputs {
    areas: Vec<Area>,
    /// The number that the application wrote last.
    written: u8,
    /// The number that leaves with the next send.
    queued: Option<u8>,
    /// Numbers that have left, in order.
    sent: Vec<u8>,
}

/// The checker of outputs.
#[derive(Debug)]
pub struct OutputsInParts {
    domains: Vec<Outputs>,
    links: usize,
    /// Numbers found inside SubDevices.
    pub found: u64,
    /// Datagrams compared on the wire.
    pub compared: u64,
}

impl OutputsInParts {
    /// For all areas of the domains, inputs too. Outputs have been zero so far.
    pub fn new(domains: usize, areas: impl Iterator<Item = Area>, links: usize) -> OutputsInParts {
        let mut all: Vec<Outputs> = Vec::new();
        all.resize_with(domains, || Outputs { sent: vec![0], ..Outputs::default() });
        for area in areas.filter(|area| !area.in_image.is_empty()) {
            all[area.domain.0].areas.push(area);
        }
        OutputsInParts { domains: all, links, found: 0, compared: 0 }
    }

    /// The application fills the outputs of a domain with the next number. False where all numbers are used.
    pub fn write(&mut self, domain: DomainId, image: &mut [u8]) -> bool {
        let outputs = &mut self.domains[domain.0];
        let Some(next) = outputs.written.checked_add(1) else { return false };
        outputs.written = next;
        let ranges = outputs.areas.iter().filter(|area| area.direction == Direction::Outputs);
        ranges.for_each(|area| image[area.in_image.clone()].fill(next));
        true
    }

    /// A domain was queued.
    pub fn queue(&mut self, domain: DomainId) {
        let outputs = &mut self.domains[domain.0];
        outputs.queued = Some(outputs.written);
    }

    /// Compares the frames of a send, and notes what has left. Returns the domains that left.
    ///
    /// # Panics
    /// When the wire has something else than what was queued.
    pub fn send(&mut self, frames: &[(Link, Vec<u8>)]) -> Vec<DomainId> {
        let queued: Vec<Option<u8>> = self.domains.iter_mut().map(|outputs| outputs.queued.take()).collect();
        let seen = self.compare(frames, |domain| queued[domain]);
        for (domain, outputs) in self.domains.iter_mut().enumerate() {
            let Some(number) = queued[domain] else { continue };
            outputs.sent.push(number);
            for area in &outputs.areas {
                let copies = seen.iter().filter(|at| **at == (domain, area.logical)).count();
                assert_eq!(copies, self.links, "domain {domain}, {area:?}: copies on the wire");
            }
        }
        (0..queued.len()).filter(|domain| queued[*domain].is_some()).map(DomainId).collect()
    }

    /// Compares frames that left outside of a send: further tries of the last cycle, if any are allowed.
    ///
    /// # Panics
    /// When the wire has something else than what was sent last.
    pub fn send_again(&mut self, frames: &[(Link, Vec<u8>)], is_allowed: bool) {
        assert!(is_allowed || frames.is_empty(), "frames left without a send: {frames:02x?}");
        let last: Vec<Option<u8>> = self.domains.iter().map(|outputs| outputs.sent.last().copied()).collect();
        self.compare(frames, |domain| last[domain]);
    }

    /// Compares frames with the numbers that may leave by domain. Returns the areas in them.
    fn compare(&mut self, frames: &[(Link, Vec<u8>)], number: impl Fn(usize) -> Option<u8>) -> Vec<(usize, u32)> {
        let mut seen = Vec::new();
        for (_, bytes) in frames {
            let frame = Frame::parse(bytes).expect("a sent frame is a frame");
            for datagram in frame.datagrams() {
                if !matches!(datagram.header.command, Command::Lrd | Command::Lwr | Command::Lrw) {
                    continue;
                }
                let (first, data) = (datagram.header.address, datagram.data);
                let end = u64::from(first) + data.len() as u64;
                for (domain, area) in
                    self.domains.iter().enumerate().flat_map(|(at, it)| it.areas.iter().map(move |area| (at, area)))
                {
                    let length = area.in_image.len();
                    if area.logical < first || u64::from(area.logical) + length as u64 > end {
                        continue;
                    }
                    let expected = number(domain).unwrap_or_else(|| panic!("domain {domain} leaves unqueued"));
                    let expected = if area.direction == Direction::Outputs { expected } else { 0 };
                    let at = (area.logical - first) as usize;
                    let found = &data[at..at + length];
                    assert!(
                        found.iter().all(|byte| *byte == expected),
                        "{area:?}: {expected} was queued: {found:02x?}"
                    );
                    seen.push((domain, area.logical));
                    self.compared += 1;
                }
            }
        }
        seen
    }

    /// Checks what the SubDevices took.
    ///
    /// # Panics
    /// When one took a number that never left, a part of one, or an older one after a newer one.
    pub fn check_devices(&mut self, network: &Network) {
        for (domain, outputs) in self.domains.iter().enumerate() {
            for area in outputs.areas.iter().filter(|area| area.direction == Direction::Outputs) {
                let mut newest = 0;
                for access in network.device(area.device).controller.logical_accesses() {
                    let Some(at) = area.logical.checked_sub(access.address) else { continue };
                    let bytes = at as usize..at as usize + area.in_image.len();
                    let Some(taken) = access.data.get(bytes.clone()) else { continue };
                    if !access.written || !access.has_moved(bytes, true) {
                        continue;
                    }
                    let number = taken[0];
                    assert!(taken.iter().all(|byte| *byte == number), "domain {domain}, {area:?}: {taken:02x?}");
                    // A number may leave more than once.
                    let later = outputs.sent.iter().skip(newest).position(|sent| *sent == number);
                    let Some(later) = later else {
                        panic!("domain {domain}, {area:?}: {number} after {newest} of {:?}", outputs.sent);
                    };
                    newest += later;
                    self.found += 1;
                }
            }
        }
    }
}
