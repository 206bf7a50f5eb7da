//! Cables that differ, explained: two SubDevices that have changed places, and one that is at another place, change the
//! cables of their neighbours too. Each is one difference.

use std::collections::BTreeMap;

/// Where a cable ends towards the MainDevice. SubDevices are named by their positions on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum End {
    /// At the MainDevice.
    MainDevice,
    /// At a port of a SubDevice.
    Port(usize, u8),
}

/// The cable at port 0 of a SubDevice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cable {
    /// The SubDevice.
    pub(super) node: usize,
    /// Its other end in the file.
    pub(super) said: End,
    /// Its other end on the bus.
    pub(super) got: End,
}

/// What a difference is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// The cable of this index ends elsewhere.
    Cable(usize),
    /// The SubDevices of these two cables have changed places.
    Exchanged(usize, usize),
}

/// The differences, with indices of cables.
pub(super) fn changes(cables: &[Cable]) -> Vec<Change> {
    let lists = Lists::of(cables);
    let mut is_open: Vec<bool> = cables.iter().map(|cable| cable.said != cable.got).collect();
    let mut changes = Vec::new();
    for at in 0..cables.len() {
        let other = lists.partners(at).find(|other| is_open[at] && lists.have_changed_places(at, *other));
        if let Some(other) = other {
            lists.around(at, other).for_each(|index| is_open[index] = false);
            changes.push(Change::Exchanged(at, other));
        }
    }
    for at in 0..cables.len() {
        if !is_open[at] {
            continue;
        }
        // Its neighbours are connected as if it were at neither place.
        let beside = lists.beside(at, &is_open);
        if beside.iter().all(|index| lists.is_same_without(at, *index)) {
            beside.into_iter().for_each(|index| is_open[index] = false);
        }
    }
    changes.extend((0..cables.len()).filter(|at| is_open[*at]).map(Change::Cable));
    changes
}

/// The cables by what they connect.
struct Lists<'a> {
    cables: &'a [Cable],
    /// Index of a cable by the SubDevice at its port 0.
    of_node: BTreeMap<usize, usize>,
    /// By their other end in the file.
    said: BTreeMap<End, usize>,
    /// By the SubDevice at their other end: in the file, on the bus.
    said_behind: BTreeMap<usize, Vec<usize>>,
    got_behind: BTreeMap<usize, Vec<usize>>,
}

impl<'a> Lists<'a> {
    fn of(cables: &'a [Cable]) -> Lists<'a> {
        let of_node = cables.iter().enumerate().map(|(at, cable)| (cable.node, at)).collect();
        let said = cables.iter().enumerate().map(|(at, cable)| (cable.said, at)).collect();
        let behind = |end: fn(&Cable) -> End| {
            let mut behind: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
            for (at, cable) in cables.iter().enumerate() {
                if let End::Port(node, _) = end(cable) {
                    behind.entry(node).or_default().push(at);
                }
            }
            behind
        };
        let (said_behind, got_behind) = (behind(|cable| cable.said), behind(|cable| cable.got));
        Lists { cables, of_node, said, said_behind, got_behind }
    }

    /// With which a SubDevice may have changed places: the one that the file has at its place, or the one before it.
    fn partners(&self, at: usize) -> impl Iterator<Item = usize> {
        let got = self.cables[at].got;
        let before = match got {
            End::Port(node, _) => self.of_node.get(&node).copied(),
            End::MainDevice => None,
        };
        self.said.get(&got).copied().into_iter().chain(before).filter(move |other| *other != at)
    }

    /// Two cables, and those that the file has behind their SubDevices.
    fn around(&self, one: usize, other: usize) -> impl Iterator<Item = usize> {
        let behind = [one, other].into_iter().filter_map(|at| self.said_behind.get(&self.cables[at].node));
        [one, other].into_iter().chain(behind.flatten().copied())
    }

    /// Whether all cables around two SubDevices are those of the file with both exchanged.
    fn have_changed_places(&self, one: usize, other: usize) -> bool {
        let (first, second) = (self.cables[one].node, self.cables[other].node);
        let exchanged = |node: usize| match node {
            node if node == first => second,
            node if node == second => first,
            node => node,
        };
        self.around(one, other).all(|at| {
            let Cable { node, said, .. } = self.cables[at];
            let said = match said {
                End::Port(node, port) => End::Port(exchanged(node), port),
                End::MainDevice => End::MainDevice,
            };
            self.of_node.get(&exchanged(node)).is_some_and(|at| self.cables[*at].got == said)
        })
    }

    /// Open cables behind a SubDevice, in the file or on the bus.
    fn beside(&self, at: usize, is_open: &[bool]) -> Vec<usize> {
        let node = self.cables[at].node;
        let mut beside: Vec<usize> = [&self.said_behind, &self.got_behind]
            .into_iter()
            .filter_map(|behind| behind.get(&node))
            .flatten()
            .copied()
            .filter(|other| *other != at && is_open[*other])
            .collect();
        beside.sort_unstable();
        beside.dedup();
        beside
    }

    /// Whether a cable is the same in the file and on the bus without a SubDevice.
    fn is_same_without(&self, left_out: usize, at: usize) -> bool {
        let without = self.cables[left_out];
        let past = |end: End, its: End| match end {
            End::Port(node, _) if node == without.node => its,
            end => end,
        };
        past(self.cables[at].said, without.said) == past(self.cables[at].got, without.got)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cables of lines that begin at the MainDevice; port 1 is that to the next SubDevice.
    fn line(file: &[usize], bus: &[usize]) -> Vec<Change> {
        let end = |order: &[usize], node: usize| {
            let place = order.iter().position(|it| *it == node).expect("it is in both");
            place.checked_sub(1).map_or(End::MainDevice, |before| End::Port(order[before], 1))
        };
        let cable = |node: &usize| Cable { node: *node, said: end(file, *node), got: end(bus, *node) };
        changes(&file.iter().map(cable).collect::<Vec<_>>())
    }

    // covers: network-file
    #[test]
    fn two_that_have_changed_places_are_one_change() {
        let file = [0, 1, 2, 3, 4, 5];
        assert_eq!(line(&file, &file), []);
        for one in 0..file.len() {
            for other in one + 1..file.len() {
                let mut bus = file;
                bus.swap(one, other);
                let changes = line(&file, &bus);
                assert!(
                    matches!(changes[..], [Change::Exchanged(a, b)] if [a.min(b), a.max(b)] == [one, other]),
                    "{bus:?}: {changes:?}"
                );
            }
        }
        assert_eq!(line(&file, &[1, 0, 2, 3, 5, 4]).len(), 2);
    }

    // covers: network-file
    #[test]
    fn one_that_is_at_another_place_is_one_change() {
        let file = [0, 1, 2, 3, 4, 5, 6];
        for from in 0..file.len() {
            for to in (0..file.len()).filter(|to| to.abs_diff(from) > 1) {
                let mut bus = file.to_vec();
                let moved = bus.remove(from);
                bus.insert(to, moved);
                assert_eq!(line(&file, &bus), [Change::Cable(from)], "{bus:?}");
            }
        }
    }

    // covers: network-file
    #[test]
    fn a_cable_in_another_port_is_its_own_change() {
        let end = |node, port| End::Port(node, port);
        let cable = |node, said, got| Cable { node, said, got };
        let tree = [
            cable(0, End::MainDevice, End::MainDevice),
            cable(1, end(0, 1), end(0, 2)),
            cable(2, end(1, 1), end(1, 1)),
            cable(3, end(0, 3), end(2, 1)),
        ];
        assert_eq!(changes(&tree), [Change::Cable(1), Change::Cable(3)]);
        // The branches of a junction exchanged: two cables, because all that is behind them has moved too.
        let branches = [
            cable(0, End::MainDevice, End::MainDevice),
            cable(1, end(0, 1), end(0, 2)),
            cable(2, end(1, 1), end(1, 1)),
            cable(3, end(0, 2), end(0, 1)),
        ];
        assert_eq!(changes(&branches), [Change::Cable(1), Change::Cable(3)]);
    }
}
