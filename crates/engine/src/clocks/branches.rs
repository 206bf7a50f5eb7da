//! Sets of ports to close, one after the other, to measure the branches behind forks without a clock (protocol 7.1).
//!
//! A clock upstream of such a fork measures the time of all branches together. With all branches closed, it measures
//! the path to the fork; with one branch open, the path into this branch. The single times follow exactly from these
//! sums. Input: the cables, and which SubDevices have a clock. Output: sets of ports. SubDevices behind closed ports
//! are not reachable, so this is done at set-up only, before the exchange of process data.

use alloc::vec;
use alloc::vec::Vec;

use super::wiring::Wiring;
use crate::topology::{PortOf, Topology};

/// Largest number of sets: four for each of sixteen forks. Delays that remain unknown are reported.
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

/// Whether a fork without a clock, with a clock upstream of it, has branches.
pub fn are_hidden(topology: &Topology, has_clock: &[bool]) -> bool {
    !sets(&Wiring::new(topology, false, |_| true), has_clock).is_empty()
}

/// The SubDevices as a tree, in the order in which frames reach them.
struct Tree<'a> {
    wiring: &'a Wiring,
    has_clock: &'a [bool],
    /// By position: the port to which the SubDevice is connected.
    parents: Vec<Option<PortOf>>,
    /// By position: the ports with a SubDevice behind them, in the order of the path.
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

    /// The ports that lead away from the path to a fork and on into its branch `open`. `None` if there is no clock in
    /// front of the fork: then nothing measures this path.
    fn closed(&self, fork: usize, open: Option<PortOf>) -> Option<Vec<PortOf>> {
        let mut closed = Vec::new();
        let mut close = |node: usize, but: Option<PortOf>| {
            closed.extend(self.branches[node].iter().filter(|port| Some(**port) != but).copied());
        };
        close(fork, open);
        let mut at = fork;
        // Up to the next clock.
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

    /// Clock 0; fork 1 with the clocks 2 and 3 and the fork 4, which has two clocks.
    #[test]
    fn each_set_leaves_the_path_to_a_fork_and_into_one_branch_open() {
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
