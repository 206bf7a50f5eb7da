//! Follows the path of a frame through the segment and attaches each SubDevice at the port at which the frame must have
//! reached it.
//!
//! If frames enter a SubDevice at port 0, they pass its processing unit before the SubDevices on its ports 3, 1, 2. If
//! they enter at another port, they pass the processing unit when they are about to leave through port 0 or have come
//! back there (protocol 2.1): SubDevices on ports before that have earlier positions, and are attached to it afterwards
//! ([`Walk::take_over`]).

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::register::PortKind;

use super::finding::Finding;
use super::port::PortOf;
use super::rings::Rings;
use super::tree::{Node, NodeStatus, Topology};
use crate::order::InOrder;

/// Order in which a frame passes the ports (protocol 2.1). The processing unit follows port 0.
pub(super) const TRAVEL: [u8; 4] = [0, 3, 1, 2];

/// Possible place of the next SubDevice: a port of another one, or (`None`) the link.
pub(super) type Slot = Option<PortOf>;

/// An attached SubDevice.
struct Placed {
    node: usize,
    slot: Slot,
    /// Number of open slots when it was attached: with no more than these, all SubDevices behind it have been passed.
    level: usize,
}

/// State of the walk.
pub(super) struct Walk<'s> {
    status: &'s [NodeStatus],
    rings: &'s Rings,
    pub(super) trust_times: bool,
    pub(super) nodes: Vec<Node>,
    /// Slots that the frame will still reach, the next one last.
    pub(super) slots: Vec<Slot>,
    placed: Vec<Placed>,
    /// Index of each SubDevice in `placed`.
    placed_at: Vec<usize>,
    /// Ports that are open but lead to no SubDevice.
    pub(super) open_ports: Vec<PortOf>,
    pub(super) findings: Vec<Finding>,
}

/// See [`Topology::build`].
pub(super) fn build(status: &[NodeStatus], main_count: usize, rings: &Rings) -> Topology {
    // In a closed ring frames come in from both sides, and the first frame need not be the one that the processing unit
    // processes: receive times say nothing about crossed lines (LC-02). One slot remains in a closed ring: that of the
    // redundant link.
    let mut walk = Walk::along_main(status, rings, main_count, false);
    if walk.slots.is_empty() {
        walk = Walk::along_main(status, rings, main_count, true);
    }
    let rest = main_count..status.len();
    let head = rest.clone().find(|node| !walk.is_open(*node, 0) && !walk.is_orphan(*node));
    let crossed = walk.crossed_stub(main_count);
    let redundant_head = match (crossed, head) {
        (Some(chain), _) => {
            walk.close();
            walk.chain(&chain);
            chain.first().map(|end| end.node)
        }
        (None, Some(head)) => {
            walk.close();
            walk.trust_times = true;
            walk.stub(rest, head);
            Some(head)
        }
        (None, None) => {
            // A closed ring: the frame of the main link left through the next slot, and frames of the redundant link
            // pass the SubDevices behind it. If the main link has no SubDevices, the redundant link has all of them.
            if !rest.is_empty() && walk.slots.last() != Some(&None) {
                walk.leave();
            }
            rest.for_each(|node| walk.place(node));
            None
        }
    };
    walk.close();
    for node in 0..status.len() {
        walk.report_ports(node, Some(node) == redundant_head || walk.is_orphan(node));
    }
    let is_open = redundant_head.is_some() || walk.open_ports.is_empty();
    let answering = if main_count == 0 && redundant_head.is_none() { status.len() } else { main_count };
    let towards = redundant_head.map_or(PortKind::Mii, |head| walk.kind(PortOf { node: head, port: 0 }));
    let main_end = if is_open { walk.certain_end(0..answering, towards) } else { None };
    let Walk { nodes, open_ports, mut findings, .. } = walk;
    findings.put_in_order_by_key(Finding::node);
    let local_rings = Vec::new();
    let mut topology = Topology { nodes, main_count, redundant_head, main_end, open_ports, findings, local_rings };
    rings.finish(&mut topology);
    topology
}

impl<'s> Walk<'s> {
    /// Attaches the SubDevices on the main link.
    fn along_main(status: &'s [NodeStatus], rings: &'s Rings, main_count: usize, trust_times: bool) -> Walk<'s> {
        let mut walk = Walk {
            status,
            rings,
            trust_times,
            nodes: vec![Node::default(); status.len()],
            slots: vec![None],
            placed: Vec::new(),
            placed_at: vec![usize::MAX; status.len()],
            open_ports: Vec::new(),
            findings: Vec::new(),
        };
        (0..main_count).for_each(|node| walk.place(node));
        walk
    }

    /// Whether frames pass a port. Ports of closing cables are left out of the tree.
    pub(super) fn is_open(&self, node: usize, port: u8) -> bool {
        let state = self.status[node].dl_status.ports[usize::from(port)];
        self.exists(node, port) && state.communication && !state.loop_closed && !self.rings.closes(node, port)
    }

    /// Whether a SubDevice is a member of a broken local ring with port 0 unconnected.
    pub(super) fn is_orphan(&self, node: usize) -> bool {
        self.rings.orphans.contains(&node)
    }

    /// End of a stub of SubDevices that are connected through ports 0 and 1: the only SubDevice with one of both ports
    /// open.
    pub(super) fn loose_end(&self, stub: core::ops::Range<usize>) -> Option<PortOf> {
        let mut end = None;
        for node in stub {
            match [0, 1, 2, 3].map(|port| self.is_open(node, port)) {
                [true, true, false, false] => {}
                [towards_0, towards_1, false, false] if towards_0 != towards_1 && end.is_none() => {
                    end = Some(PortOf { node, port: u8::from(towards_0) });
                }
                _ => return None,
            }
        }
        end.filter(|at| self.exists(at.node, at.port))
    }

    /// End of a stub: the end of its line over ports 0 and 1, or a port without a link on that line, if the assumed
    /// line is a branch like the terminals of a coupler. A cable connects two ports of one kind; `towards` is the kind
    /// at the other end. `None` if several ports are possible.
    pub(super) fn certain_end(&self, stub: core::ops::Range<usize>, towards: PortKind) -> Option<PortOf> {
        let is_loose = |at: &PortOf| self.exists(at.node, at.port) && !self.is_open(at.node, at.port);
        let ports = |node: usize| (0..4).map(move |port| PortOf { node, port });
        let fits = |at: &PortOf| self.kind(*at) == towards;
        let usual = self.loose_end(stub.clone());
        let of_others = || stub.clone().filter(|node| usual.is_none_or(|end| end.node != *node)).flat_map(ports);
        if !self.joins_like_kinds() || (usual.is_some() && !of_others().any(|at| is_loose(&at))) {
            // The kinds of ports give no information, or only the ports of the last SubDevice are possible.
            return usual;
        }
        let own = usual.and_then(|end| [end].into_iter().chain(ports(end.node).filter(is_loose)).find(fits));
        let mut others = of_others().filter(is_loose).filter(fits);
        match (own, others.next(), others.next()) {
            (Some(own), None, _) => Some(own),
            (None, Some(other), None) => Some(other),
            _ => None,
        }
    }

    /// Whether all known cables connect ports of one kind, as real cables do.
    fn joins_like_kinds(&self) -> bool {
        let kind_above =
            |node: &Node| node.parent.map_or(PortKind::Mii, |(node, port)| self.kind(PortOf { node, port }));
        let mut nodes = self.nodes.iter().enumerate();
        nodes.all(|(at, node)| self.kind(PortOf { node: at, port: node.entry_port }) == kind_above(node))
    }

    pub(super) fn kind(&self, at: PortOf) -> PortKind {
        self.status[at.node].ports[usize::from(at.port & 3)]
    }

    /// Whether the controller has the port. If a controller reports no port at all, its report is ignored.
    fn exists(&self, node: usize, port: u8) -> bool {
        let kinds = &self.status[node].ports;
        kinds[usize::from(port)] != PortKind::NotImplemented || *kinds == [PortKind::NotImplemented; 4]
    }

    /// Open ports among those that a frame passes after it came in at `entry`, in its order.
    pub(super) fn open_after(&self, node: usize, entry: u8) -> impl DoubleEndedIterator<Item = u8> + use<'_, 's> {
        let at = TRAVEL.iter().position(|port| *port == entry).unwrap_or(0);
        (1..4).map(move |step| TRAVEL[(at + step) % 4]).filter(move |port| self.is_open(node, *port))
    }

    /// The open port at which the frame came in first, by the receive times (LC-05); `None` if they do not show it.
    pub(super) fn earliest(&self, node: usize) -> Option<u8> {
        let trusted = self.trust_times && !self.rings.untimed[node];
        let times = self.status[node].receive_times.filter(|_| trusted)?;
        let open = || (0..4).filter(|port| self.is_open(node, *port));
        let first = open().reduce(|a, b| if before(&times, b, a) { b } else { a })?;
        open().all(|port| port == first || before(&times, first, port)).then_some(first)
    }

    /// Time from the frame's first to its last passage, in nanoseconds.
    pub(super) fn span(&self, node: usize) -> Option<u32> {
        let times = self.status[node].receive_times?;
        let first = times[usize::from(self.earliest(node)?)];
        (0..4).filter(|port| self.is_open(node, *port)).map(|port| times[usize::from(port)].wrapping_sub(first)).max()
    }

    /// Attaches the SubDevice that the frame passed next.
    pub(super) fn place(&mut self, node: usize) {
        if self.is_orphan(node) {
            return self.orphan(node);
        }
        let entry = self.entry(node);
        if entry != 0 && self.is_open(node, 0) && self.take_over(node, entry) {
            return;
        }
        let entry = if self.is_open(node, 0) { 0 } else { entry };
        if let Some(slot) = self.slots.pop() {
            if entry != 0 {
                self.findings.push(Finding::CrossedLine { node, entry_port: entry });
            }
            self.attach(node, slot, entry);
            self.expect_children(node, entry);
            return;
        }
        // No slot left: frames must have entered this SubDevice at another port before they passed its processing unit.
        let swapped = (1..4).rev().find(|port| self.is_open(node, *port));
        if !swapped.is_some_and(|entry| self.is_open(node, 0) && self.take_over(node, entry)) {
            self.findings.push(Finding::Inconsistent { node });
            self.attach(node, None, entry);
            self.expect_children(node, entry);
        }
    }

    /// The port at which frames come in, by receive times, otherwise by open ports.
    fn entry(&self, node: usize) -> u8 {
        let by_ports = || {
            if self.is_open(node, 0) {
                return 0;
            }
            // With the last open port in the order of processing as the entry, no other SubDevice needs to precede this
            // one.
            TRAVEL.into_iter().rev().find(|port| self.is_open(node, *port)).unwrap_or(0)
        };
        self.earliest(node).unwrap_or_else(by_ports)
    }

    /// Attaches a SubDevice that frames enter at another port than 0, with the earlier SubDevices on its other ports as
    /// children. False if there are none: then frames do not enter there.
    fn take_over(&mut self, node: usize, entry: u8) -> bool {
        let passed: Vec<u8> = self.passed_before(node, entry);
        let mut taken = Vec::new();
        for port in passed.iter().rev() {
            match self.last_complete(self.span(node)) {
                Some(at) => taken.push((*port, self.detach(at))),
                None => break,
            }
        }
        let slot = match (taken.is_empty(), self.slots.pop()) {
            (false, Some(slot)) => slot,
            (_, popped) => {
                self.slots.extend(popped);
                return false;
            }
        };
        self.findings.push(Finding::CrossedLine { node, entry_port: entry });
        self.attach(node, slot, entry);
        for port in passed.iter().take(passed.len() - taken.len()) {
            self.open_ports.push(PortOf { node, port: *port });
        }
        for (port, child) in taken {
            self.connect(PortOf { node, port }, child);
        }
        self.expect_children(node, entry);
        true
    }

    /// Open ports that a frame entering at `entry` passes before the processing unit.
    fn passed_before(&self, node: usize, entry: u8) -> Vec<u8> {
        if entry == 0 {
            return Vec::new();
        }
        let at = TRAVEL.iter().position(|port| *port == entry).unwrap_or(0);
        let to_unit = (at + 1..=4).map(|step| TRAVEL[step % 4]);
        to_unit.filter(|port| self.is_open(node, *port)).collect()
    }

    /// The tree to attach as a child: the smallest complete one; or, if `span` is known, the largest complete one in
    /// which the frame spent less time.
    fn last_complete(&self, span: Option<u32>) -> Option<usize> {
        let complete = |at: usize| self.placed.get(at).filter(|placed| self.slots.len() <= placed.level);
        let mut at = self.placed.len().checked_sub(1)?;
        complete(at)?;
        while let Some(PortOf { node, .. }) = self.placed[at].slot {
            let parent = self.placed_at[node];
            let fits = match (self.span(node), span) {
                (Some(inner), Some(outer)) => inner < outer,
                _ => false,
            };
            if !fits || complete(parent).is_none() {
                break;
            }
            at = parent;
        }
        Some(at)
    }

    /// Detaches a tree from its slot and frees the slot.
    fn detach(&mut self, at: usize) -> usize {
        let Placed { node, slot, .. } = self.placed[at];
        self.placed.truncate(at);
        if let Some(PortOf { node, port }) = slot {
            self.nodes[node].children[usize::from(port)] = None;
        }
        self.slots.push(slot);
        node
    }

    /// Attaches a SubDevice to a slot that was removed from the stack.
    pub(super) fn attach(&mut self, node: usize, slot: Slot, entry_port: u8) {
        self.nodes[node].entry_port = entry_port;
        if let Some(parent) = slot {
            self.connect(parent, node);
        }
        self.placed_at[node] = self.placed.len();
        self.placed.push(Placed { node, slot, level: self.slots.len() });
    }

    pub(super) fn connect(&mut self, parent: PortOf, child: usize) {
        self.nodes[child].parent = Some((parent.node, parent.port));
        self.nodes[parent.node].children[usize::from(parent.port)] = Some(child);
    }

    /// Slots for the ports that the frame passes after the SubDevice's processing unit.
    pub(super) fn expect_children(&mut self, node: usize, entry: u8) {
        let passed = self.passed_before(node, entry);
        let after: Vec<u8> = self.open_after(node, entry).filter(|port| !passed.contains(port)).collect();
        self.slots.extend(after.into_iter().rev().map(|port| Some(PortOf { node, port })));
    }

    /// The frame left through the next slot.
    fn leave(&mut self) {
        self.open_ports.extend(self.slots.pop().flatten());
    }

    /// Ends the walk: the remaining slots have no SubDevice.
    pub(super) fn close(&mut self) {
        while !self.slots.is_empty() {
            self.leave();
        }
    }

    fn report_ports(&mut self, node: usize, at_break: bool) {
        for port in 0..4u8 {
            let state = self.status[node].dl_status.ports[usize::from(port)];
            if !self.exists(node, port) {
                continue;
            }
            let finding = match (state.link, state.communication, state.loop_closed) {
                (_, false, false) => Finding::ForcedOpen { node, port },
                (_, true, true) => Finding::ClosedWithLink { node, port },
                (true, false, true) => Finding::LinkWithoutCommunication { node, port },
                (false, false, true) if port == 0 && !at_break => Finding::UnconnectedPort0 { node },
                (false, false, true) | (_, true, false) => continue,
            };
            self.findings.push(finding);
        }
    }

    /// Adds a member of a broken ring with an unconnected port 0 without a parent, with port 0 as its entry port.
    pub(super) fn orphan(&mut self, node: usize) {
        self.attach(node, None, 0);
        self.expect_children(node, 0);
    }
}

/// Whether the time of port `a` is earlier than that of port `b`; the clock may have wrapped between them.
fn before(times: &[u32; 4], a: u8, b: u8) -> bool {
    (times[usize::from(a)].wrapping_sub(times[usize::from(b)]) as i32) < 0
}
