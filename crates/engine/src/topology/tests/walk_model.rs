//! Reference model of a frame's path over ports (protocol 2.1, 2.4, 11.3), on wiring instead of port status.

use std::vec;
use std::vec::Vec;

use ringcat_wire::register::{DlStatus, PortKind};

use crate::topology::NodeStatus;

/// The end of a cable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    Main,
    Redundant,
    Port(usize, u8),
}

/// SubDevices and the connections of their ports.
#[derive(Clone, Debug, Default)]
pub struct Segment {
    links: Vec<[Option<End>; 4]>,
    main: Option<(usize, u8)>,
    redundant: Option<(usize, u8)>,
    /// Parent of each SubDevice, without the cable that was cut.
    parents: Vec<Option<(usize, u8)>>,
}

/// SubDevices that the frames of both links pass.
pub struct Walked {
    /// SubDevices in the order of the processing units.
    pub order: Vec<usize>,
    pub main_count: usize,
    times: Vec<[Option<u32>; 4]>,
    open: Vec<[bool; 4]>,
}

impl Segment {
    pub fn new() -> Segment {
        Segment::default()
    }

    pub fn len(&self) -> usize {
        self.links.len()
    }

    /// Adds a SubDevice whose port `entry` is plugged into `end`.
    pub fn add(&mut self, end: End, entry: u8) {
        let node = self.links.len();
        self.links.push([None; 4]);
        self.parents.push(match end {
            End::Port(parent, port) => Some((parent, port)),
            End::Main | End::Redundant => None,
        });
        self.connect(End::Port(node, entry), end);
    }

    pub fn connect(&mut self, a: End, b: End) {
        for (from, to) in [(a, b), (b, a)] {
            match (from, to) {
                (End::Port(node, port), to) => self.links[node][usize::from(port)] = Some(to),
                (End::Main, End::Port(node, port)) => self.main = Some((node, port)),
                (End::Redundant, End::Port(node, port)) => self.redundant = Some((node, port)),
                (End::Main | End::Redundant, _) => unreachable!(),
            }
        }
    }

    pub fn free_ports(&self) -> Vec<(usize, u8)> {
        let all = (0..self.len()).flat_map(|node| (1..4).map(move |port| (node, port)));
        all.filter(|(node, port)| self.links[*node][usize::from(*port)].is_none()).collect()
    }

    /// SubDevices between the main link and `tail`, `tail` first.
    pub fn trunk(&self, tail: usize) -> Vec<usize> {
        core::iter::successors(Some(tail), |node| self.parents[*node].map(|parent| parent.0)).collect()
    }

    /// Removes the cable at a port.
    pub fn cut(&mut self, node: usize, port: u8) {
        match self.links[node][usize::from(port)].take() {
            Some(End::Port(other, other_port)) => self.links[other][usize::from(other_port)] = None,
            Some(End::Main) => self.main = None,
            Some(End::Redundant) => self.redundant = None,
            None => {}
        }
        self.parents[node] = None;
    }

    pub fn walk(&self) -> Walked {
        let open = self.links.iter().map(|links| links.map(|end| end.is_some())).collect();
        let mut seen = Walked { order: vec![], main_count: 0, times: vec![[None; 4]; self.len()], open };
        self.send(self.main, &mut seen);
        seen.main_count = seen.order.len();
        self.send(self.redundant, &mut seen);
        seen
    }

    /// Sends a frame into a port. A SubDevice keeps the times of the frame that its processing unit processed.
    fn send(&self, start: Option<(usize, u8)>, seen: &mut Walked) {
        let Some((mut node, mut port)) = start else { return };
        let mut times = vec![[None; 4]; self.len()];
        let mut circulating = false;
        let mut now = 0xFFFF_FF00u32;
        let first = seen.order.len();
        'cable: loop {
            times[node][usize::from(port)].get_or_insert(now);
            loop {
                if port == 0 {
                    if self.links[node][0].is_none() {
                        assert!(!circulating, "a frame passes one unconnected port 0");
                        circulating = true;
                    }
                    seen.order.push(node);
                }
                port = [3, 2, 0, 1][usize::from(port)];
                now = now.wrapping_add(10);
                match self.links[node][usize::from(port)] {
                    Some(End::Port(next, entry)) => {
                        now = now.wrapping_add(100);
                        (node, port) = (next, entry);
                        continue 'cable;
                    }
                    Some(End::Main | End::Redundant) => break 'cable,
                    None => {}
                }
            }
        }
        for passed in &seen.order[first..] {
            seen.times[*passed] = times[*passed];
        }
    }
}

impl Walked {
    /// Port registers of the SubDevices, in the order of the processing units.
    pub fn status(&self, times: bool) -> Vec<NodeStatus> {
        let of = |node: &usize| {
            let mut bits = 0;
            for (port, open) in self.open[*node].iter().enumerate() {
                bits |= if *open { 0x0010 << port | 0x0200 << (2 * port) } else { 0x0100 << (2 * port) };
            }
            let receive_times = times.then_some(self.times[*node].map(|time| time.unwrap_or(0)));
            NodeStatus { dl_status: DlStatus::from_bits(bits), receive_times, ports: [PortKind::Mii; 4] }
        };
        self.order.iter().map(of).collect()
    }

    /// Parents as wired, by place in the order.
    pub fn parents(&self, segment: &Segment) -> Vec<Option<(usize, u8)>> {
        let place = |node| self.order.iter().position(|passed| *passed == node).unwrap();
        self.order.iter().map(|node| segment.parents[*node].map(|(parent, port)| (place(parent), port))).collect()
    }
}
