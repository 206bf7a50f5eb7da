//! The SubDevices of the redundant link in a broken ring, as a tree that is oriented like the intact ring.
//!
//! Frames of the redundant link run up the trunk from the link to the break without meeting a processing unit, pass the
//! branches that lie behind the trunk's ports on that way, and meet the units of the trunk on the way back, the one
//! next to the break first (facts 2.9). So branches come before the head in the order, and the rest behind it.

use alloc::vec::Vec;
use core::ops::Range;

use super::PortOf;
use super::place::{Slot, TRAVEL, Walk};

impl Walk<'_> {
    /// Hangs the SubDevices of the redundant link; `head` is the one with nothing on its port 0.
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

    /// Hangs a SubDevice of the trunk and says through which port the trunk goes on towards the link: the one at which
    /// frames of the redundant link come in. Branches on ports behind it were met before.
    fn trunk(&mut self, node: usize, slot: Slot, branches: &mut Vec<usize>, trunk: &mut Slot) {
        self.hang(node, slot, 0);
        let ports: Vec<u8> = TRAVEL[1..].iter().copied().filter(|port| self.is_open(node, *port)).collect();
        let by_time = self.earliest(node).and_then(|entry| ports.iter().position(|port| *port == entry));
        // Without receive times the branches that were met before belong as near to the break as they fit.
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
