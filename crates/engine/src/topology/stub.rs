//! The SubDevices of the redundant link in a broken ring, as a tree that is oriented like the intact ring.
//!
//! Frames of the redundant link run along the trunk to the break without passing a processing unit of the trunk, but
//! pass the branches on its ports. On the way back they pass the processing units of the trunk, beginning next to the
//! break (protocol 2.9). So, by position, these branches precede the head, and the rest follows it.

use alloc::vec::Vec;
use core::ops::Range;

use super::place::{Slot, TRAVEL, Walk};
use super::{Finding, PortOf};
use crate::order::InOrder;

impl Walk<'_> {
    /// Attaches the SubDevices of the redundant link; `head` is the one with port 0 unconnected.
    pub(super) fn stub(&mut self, range: Range<usize>, head: usize) {
        let mut branches = Vec::new();
        for node in range.start..head {
            if self.slots.is_empty() {
                self.slots.push(None);
            }
            self.place(node);
        }
        branches.extend((range.start..head).filter(|node| self.nodes[*node].parent.is_none()));
        self.close();
        let mut trunk = None;
        self.trunk(head, None, &mut branches, &mut trunk);
        for node in head + 1..range.end {
            if trunk.is_some() && self.slots.last() == Some(&trunk) && !self.is_orphan(node) {
                let slot = self.slots.pop().flatten();
                self.trunk(node, slot, &mut branches, &mut trunk);
            } else {
                self.place(node);
            }
        }
    }

    /// Attaches a SubDevice of the trunk. Sets `trunk` to the port through which the trunk continues towards the link:
    /// frames of the redundant link come in there. Branches on the ports behind it precede this SubDevice by position.
    fn trunk(&mut self, node: usize, slot: Slot, branches: &mut Vec<usize>, trunk: &mut Slot) {
        self.attach(node, slot, 0);
        let ports: Vec<u8> = TRAVEL[1..].iter().copied().filter(|port| self.is_open(node, *port)).collect();
        let by_time = self.earliest(node).and_then(|entry| ports.iter().position(|port| *port == entry));
        // Without receive times, the branches that precede the head are placed as near to the break as they fit.
        let by_ports = || ports.len().checked_sub(1 + branches.len().min(ports.len().saturating_sub(1)));
        let Some(on) = by_time.or_else(by_ports) else {
            *trunk = None;
            return;
        };
        let (first, behind) = ports.split_at(on + 1);
        for port in behind.iter().rev().map(|port| PortOf { node, port: *port }) {
            match branches.pop() {
                Some(branch) => self.connect(port, branch),
                None => self.open_ports.push(port),
            }
        }
        self.slots.extend(first.iter().rev().map(|port| Some(PortOf { node, port: *port })));
        *trunk = Some(PortOf { node, port: ports[on] });
    }
}

/// A SubDevice of a stub without branches.
pub(super) struct ChainMember {
    pub(super) node: usize,
    /// IN and OUT are swapped.
    crossed: bool,
}

/// Stubs without branches that contain crossed SubDevices. Crossed SubDevices process frames of the redundant link on
/// the way to the break, the others on the way back. So the position of the SubDevice next to the break shows the
/// number of crossed SubDevices; only receive times show in which order both kinds are connected.
impl Walk<'_> {
    /// The SubDevices of the redundant link, from the break on, if the ring is open, has no branches, and some of these
    /// SubDevices are crossed. `None` if the redundant link has all SubDevices and all of them are crossed: this is a
    /// line on the redundant link.
    pub(super) fn crossed_stub(&mut self, main_count: usize) -> Option<Vec<ChainMember>> {
        let rest = main_count..self.nodes.len();
        if main_count > 0 {
            self.loose_end(0..main_count)?;
        }
        let PortOf { node: end, port } = self.loose_end(rest.clone())?;
        let crossed = port != 0;
        // The crossed SubDevices precede the one next to the break, by position; that one is crossed if its port 0 is
        // connected.
        let passed_first = rest.start..end + usize::from(crossed);
        if passed_first.is_empty() || (main_count == 0 && passed_first == rest) {
            return None;
        }
        let straight = passed_first.end..rest.end;
        let mut chain: Vec<ChainMember> = passed_first.rev().map(|node| ChainMember { node, crossed: true }).collect();
        chain.extend(straight.map(|node| ChainMember { node, crossed: false }));
        self.trust_times = true;
        let spans: Option<Vec<u32>> = rest.clone().map(|node| self.span(node)).collect();
        if let Some(spans) = spans {
            chain.put_in_order_by_key(|link| spans[link.node - rest.start]);
        }
        if let Some(at) = chain.iter().position(|link| link.node == end) {
            let last = chain.remove(at);
            chain.insert(0, last);
        }
        Some(chain)
    }

    /// Attaches the SubDevices of the redundant link in a row.
    pub(super) fn chain(&mut self, chain: &[ChainMember]) {
        let mut slot = None;
        for link in chain {
            let node = link.node;
            let other = (1..4).find(|port| self.is_open(node, *port)).unwrap_or(1);
            let (entry, on) = if link.crossed { (other, 0) } else { (0, other) };
            if link.crossed {
                self.findings.push(Finding::CrossedLine { node, entry_port: entry });
            }
            self.attach(node, slot, entry);
            slot = Some(PortOf { node, port: on });
        }
        self.open_ports.extend(slot);
    }
}
