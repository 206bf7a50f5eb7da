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
use crate::configuration::Configuration;
use crate::eni::Port;

/// Letters of the ports, by number.
const LETTERS: [char; 4] = ['A', 'B', 'C', 'D'];

impl Configuration {
    /// Cables that differ from those of the file. No difference is reported where the cabling is unknown: at missing
    /// SubDevices, where a ring is open, in rings behind junctions, and while crossed lines make neighbours uncertain.
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
    let configs = &configuration.declaration.subdevices;
    if topology.is_assumed() || facts.iter().all(|facts| facts.plugged_into.is_none()) {
        return Vec::new();
    }
    let mut place = vec![None; configs.len()];
    let mut config_at = BTreeMap::new();
    for (config, info) in pairs {
        let node = usize::from(found[*info].position.0);
        place[*config] = Some(node);
        config_at.insert(node, *config);
    }
    let names = configuration.names();
    // A SubDevice that is not in the file is named by its position.
    let name = |node: usize| match config_at.get(&node) {
        Some(config) => format!("\"{}\"", names[*config]),
        None => format!("position {node}"),
    };
    let into =
        |at: PortOf| format!("port {} of {}", LETTERS[usize::from(at.port() & 3)], name(usize::from(at.position().0)));
    let at = |node: usize| Position(node as u16);
    let mut differences = Vec::new();
    for (config, facts) in facts.iter().enumerate() {
        let Some(node) = place[config].filter(|node| !topology.is_in_local_ring(at(*node))) else { continue };
        let said = match facts.plugged_into {
            Some((previous, port)) => match place[previous] {
                Some(node) => Some(PortOf::new(Position(node as u16), number(port))),
                // A missing SubDevice: the next one is connected elsewhere.
                None => continue,
            },
            // A group's head may be connected anywhere.
            None if configs[config].group.is_some() => continue,
            None => None,
        };
        let got = topology.connection_to(at(node)).map(|cable| cable.near);
        if said == behind_additional(got, topology, &config_at) {
            continue;
        }
        // The cabling where a ring is open is unknown.
        if said == got || (got.is_none() && topology.redundant_head() == Some(at(node))) {
            continue;
        }
        let words = |at: Option<PortOf>| at.map_or_else(|| "the MainDevice".to_owned(), into);
        let text = format!("{} is plugged into {}; the file says {}", name(node), words(got), words(said));
        differences.push(Difference {
            subdevice: Some(SubDeviceId(config)),
            position: Some(Position(node as u16)),
            kind: DifferenceKind::Cable,
            prevents_op: false,
            text,
        });
    }
    differences
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
