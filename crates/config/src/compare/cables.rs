//! The cables of a network compared with those of a file: the neighbour and the port of each SubDevice.
//!
//! A difference is only reported: process data depends on the order of the SubDevices, not on their ports. But the
//! search for a broken cable with the drawing of the machine needs the real cabling.

use std::collections::BTreeMap;

use ringcat_engine::config::{Resolution, resolve};
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::{PortOf, Topology};
use ringcat_wire::address::Position;

use super::difference::{Difference, DifferenceKind};
use super::replugged::{Cable, Change, End, changes};
use crate::configuration::Configuration;
use crate::eni::Port;

/// Letters of the ports, by number.
const LETTERS: [char; 4] = ['A', 'B', 'C', 'D'];

impl Configuration {
    /// Cables that differ from those of the file. Two SubDevices that have changed places are one difference, of the
    /// kind [`DifferenceKind::Order`]; so is one that is at another place. No difference is reported where the cabling
    /// is unknown: at missing SubDevices, where a ring is open, in rings behind junctions, and while crossed lines make
    /// neighbours uncertain.
    pub fn compare_cables(&self, found: &[SubDeviceInfo], topology: &Topology) -> Vec<Difference> {
        let pairs: Vec<(usize, usize)> = resolve(&self.declaration.subdevices, found)
            .into_iter()
            .filter_map(|resolution| match resolution {
                Resolution::Found { config, info } => Some((config, info)),
                _ => None,
            })
            .collect();
        compare(self, &pairs, found, topology)
    }
}

/// The same for pairs of indices, in the file and in the scan.
pub(super) fn compare(
    configuration: &Configuration,
    pairs: &[(usize, usize)],
    found: &[SubDeviceInfo],
    topology: &Topology,
) -> Vec<Difference> {
    let facts = &configuration.subdevices;
    if topology.is_assumed() || facts.iter().all(|facts| facts.plugged_into.is_none()) {
        return Vec::new();
    }
    let node = |info: usize| usize::from(found[info].position.0);
    let places = Places {
        node_of: pairs.iter().map(|(config, info)| (*config, node(*info))).collect(),
        config_at: pairs.iter().map(|(config, info)| (node(*info), *config)).collect(),
        names: configuration.names(),
    };
    let cables = cables(configuration, &places, topology);
    let difference = |change: Change| {
        let at = match change {
            Change::Cable(at) | Change::Exchanged(at, _) => cables[at],
        };
        let (kind, text) = match change {
            Change::Cable(_) => (DifferenceKind::Cable, places.plugged(at, topology)),
            Change::Exchanged(_, other) => (DifferenceKind::Order, places.exchanged(at.node, cables[other].node)),
        };
        Difference {
            subdevice: places.config_at.get(&at.node).copied().map(SubDeviceId),
            position: Some(Position(at.node as u16)),
            kind,
            prevents_op: false,
            text,
        }
    };
    changes(&cables).into_iter().map(difference).collect()
}

/// The cables that are known on both sides.
fn cables(configuration: &Configuration, places: &Places, topology: &Topology) -> Vec<Cable> {
    let facts = configuration.subdevices.iter().zip(&configuration.declaration.subdevices);
    let mut cables = Vec::new();
    for (config, (facts, declared)) in facts.enumerate() {
        let Some(node) = places.node_of.get(&config).copied() else { continue };
        if topology.is_in_local_ring(Position(node as u16)) {
            continue;
        }
        let said = match facts.plugged_into {
            Some((previous, port)) => match places.node_of.get(&previous) {
                Some(node) => End::Port(*node, number(port)),
                // A missing SubDevice: the next one is connected elsewhere.
                None => continue,
            },
            // A group's head may be connected anywhere.
            None if declared.group.is_some() => continue,
            None => End::MainDevice,
        };
        let near = near(node, topology);
        let (got, without) = (end(near), end(behind_additional(near, topology, &places.config_at)));
        // The cabling where a ring is open is unknown.
        let is_unknown = near.is_none() && topology.redundant_head() == Some(Position(node as u16));
        let got = if got == said || is_unknown { said } else { without };
        cables.push(Cable { node, said, got });
    }
    cables
}

/// The port that a SubDevice is plugged into.
fn near(node: usize, topology: &Topology) -> Option<PortOf> {
    topology.connection_to(Position(node as u16)).map(|cable| cable.near)
}

fn end(near: Option<PortOf>) -> End {
    near.map_or(End::MainDevice, |near| End::Port(near.position().0.into(), near.port() & 3))
}

/// The SubDevices of both sides.
struct Places {
    /// Positions on the bus, by index in the file.
    node_of: BTreeMap<usize, usize>,
    /// Indices in the file, by position on the bus.
    config_at: BTreeMap<usize, usize>,
    names: Vec<String>,
}

impl Places {
    /// A SubDevice that is not in the file is named by its position.
    fn name(&self, node: usize) -> String {
        match self.config_at.get(&node) {
            Some(config) => format!("\"{}\"", self.names[*config]),
            None => format!("position {node}"),
        }
    }

    fn words(&self, end: End) -> String {
        match end {
            End::MainDevice => "the MainDevice".to_owned(),
            End::Port(node, port) => format!("port {} of {}", LETTERS[usize::from(port & 3)], self.name(node)),
        }
    }

    fn plugged(&self, cable: Cable, topology: &Topology) -> String {
        let (got, said) = (self.words(end(near(cable.node, topology))), self.words(cable.said));
        format!("{} is plugged into {got}; the file says {said}", self.name(cable.node))
    }

    fn exchanged(&self, one: usize, other: usize) -> String {
        let (first, second) = (self.name(one), self.name(other));
        format!("{first} and {second} have changed places: they are at positions {one} and {other}")
    }
}

/// Where a cable would end without the additional SubDevices, which are differences themselves.
fn behind_additional(got: Option<PortOf>, topology: &Topology, known: &BTreeMap<usize, usize>) -> Option<PortOf> {
    let mut end = got;
    // A line has at most as many SubDevices as there are positions.
    for _ in 0..=u16::MAX {
        match end {
            Some(near) if !known.contains_key(&usize::from(near.position().0)) => {
                end = topology.connection_to(near.position()).map(|cable| cable.near);
            }
            _ => break,
        }
    }
    end
}

const fn number(port: Port) -> u8 {
    match port {
        Port::A => 0,
        Port::B => 1,
        Port::C => 2,
        Port::D => 3,
    }
}
