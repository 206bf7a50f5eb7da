//! Which ports to close, one set after the other, so that what is behind forks without a clock can be measured
//! (protocol 7.1).
//!
//! A clock in front of such a fork sees what all of its branches take together. With all of them closed but one, it
//! sees that one: the way to the fork, then the way into each branch. What follows from these sums is exact. In: the
//! cables, and who has a clock. Out: sets of ports. SubDevices behind them are out of reach meanwhile, so this is for
//! the set-up, before anything is exchanged with them.

use alloc::vec;
use alloc::vec::Vec;

use super::wiring::Wiring;
use crate::topology::{PortOf, Topology};

/// Sets that are measured at most: four for each of sixteen forks. What is not known then is told.
const MOST_SETS: usize = 64;

/// Ports to close, set by set. `has_clock` by position.
pub fn sets(wiring: &Wiring, has_clock: &[bool]) -> Vec<Vec<PortOf>> {
    let tree = Tree::new(wiring, has_clock);
    let forks = (0..wiring.count()).filter(|node| tree.is_fork(*node));
    let sets = forks.flat_map(|fork| {
        let branches = tree.branches[fork].clone();
        core::iter::once(None).chain(branches.into_iter().map(Some)).map(move |open| (fork, open))
    });
    sets.filter_map(|(fork, open)| tree.closed(fork, open)).take(MOST_SETS).collect()
}

/// Whether a fork without a clock, with a clock in front, has branches.
pub fn are_hidden(topology: &Topology, has_clock: &[bool]) -> bool {
    !sets(&Wiring::new(topology, false, |_| true), has_clock).is_empty()
}

/// Who is behind whom, as frames meet them.
struct Tree<'a> {
    wiring: &'a Wiring,
    has_clock: &'a [bool],
    /// By position, the port of whom it hangs on.
    parents: Vec<Option<PortOf>>,
    /// By position, the ports at which something hangs, in the order of the way.
    branches: Vec<Vec<PortOf>>,
}

impl<'a> Tree<'a> {
    fn new(wiring: &'a Wiring, has_clock: &'a [bool]) -> Tree<'a> {
        let count = wiring.count();
        let mut tree = Tree { wiring, has_clock, parents: vec![None; count], branches: vec![Vec::new(); count] };
        let mut is_reached = vec![false; count];
        for arrival in (0..super::wiring::TREES).flat_map(|link| wiring.path(link)) {
            if !core::mem::replace(&mut is_reached[arrival.at.node], true)
                && let Some(near) = wiring.far(arrival.at).filter(|near| is_reached[near.node])
            {
                tree.parents[arrival.at.node] = Some(near);
                tree.branches[near.node].push(near);
            }
        }
        tree
    }

    fn is_fork(&self, node: usize) -> bool {
        !self.has_clock.get(node).copied().unwrap_or(false) && self.branches[node].len() > 1
    }

    /// All that leads away from the way to a fork and, beyond it, into one of its branches. `None` where no clock is in
    /// front: nothing measures that way.
    fn closed(&self, fork: usize, open: Option<PortOf>) -> Option<Vec<PortOf>> {
        let mut closed = Vec::new();
        let mut close = |node: usize, but: Option<PortOf>| {
            closed.extend(self.branches[node].iter().filter(|port| Some(**port) != but).copied());
        };
        close(fork, open);
        let mut at = fork;
        // Up to a clock, which sees for itself.
        for _ in 0..self.parents.len() {
            let near = self.parents[at]?;
            if self.has_clock.get(near.node).copied().unwrap_or(false) {
                break;
            }
            close(near.node, Some(near));
            at = near.node;
        }
        // Down to the next clock or fork.
        let mut at = open;
        for _ in 0..self.parents.len() {
            let Some(far) = at.and_then(|at| self.wiring.far(at)) else { break };
            if self.has_clock.get(far.node).copied().unwrap_or(false) {
                break;
            }
            if self.is_fork(far.node) {
                close(far.node, None);
                break;
            }
            at = self.branches[far.node].first().copied();
        }
        Some(closed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::Node;

    /// A clock 0; a fork 1 with a clock 2, a clock 3, and behind it a fork 4 with two clocks.
    #[test]
    fn the_way_to_each_fork_and_into_each_of_its_branches_is_left_open_alone() {
        let mut topology = Topology { nodes: vec![Node::default(); 7], main_count: 7, ..Topology::default() };
        for (parent, port, child) in [(0, 1, 1), (1, 3, 2), (1, 1, 3), (1, 2, 4), (4, 3, 5), (4, 1, 6)] {
            topology.nodes[parent].children[usize::from(port)] = Some(child);
            topology.nodes[child].parent = Some((parent, port));
        }
        let wiring = Wiring::new(&topology, false, |_| true);
        let has_clock = [true, false, true, true, false, true, true];
        let sets: Vec<Vec<(usize, u8)>> = sets(&wiring, &has_clock)
            .into_iter()
            .map(|set| set.into_iter().map(|at| (at.node, at.port)).collect())
            .collect();
        let of_first = [
            vec![(1, 3), (1, 1), (1, 2)],
            vec![(1, 1), (1, 2)],
            vec![(1, 3), (1, 2)],
            vec![(1, 3), (1, 1), (4, 3), (4, 1)],
        ];
        let of_second =
            [vec![(4, 3), (4, 1), (1, 3), (1, 1)], vec![(4, 1), (1, 3), (1, 1)], vec![(4, 3), (1, 3), (1, 1)]];
        assert_eq!(sets, [of_first.to_vec(), of_second.to_vec()].concat());
        assert!(super::sets(&wiring, &[true; 7]).is_empty());
        assert!(super::sets(&wiring, &[false, false, true, true, false, true, true]).is_empty());
        assert!(super::sets(&Wiring::default(), &[]).is_empty());
    }
}
