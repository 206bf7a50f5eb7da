//! The incidents of the demonstration: which cable, which SubDevice, when.

use std::time::Duration;

use ringcat::sim::cable::{CableId, Endpoint, HostLink};
use ringcat::sim::network::Network;
use ringcat::{Direction, Position, Scan};

use super::incident::Incident;
use super::watch::Watch;

/// How long every stretch lasts.
const STRETCH: Duration = Duration::from_millis(1000);
/// How long the SubDevice is without power.
const OUTAGE: Duration = Duration::from_millis(500);

/// An incident and how long the demonstration goes on after it.
#[derive(Clone, Debug)]
pub struct Step {
    /// What happens.
    pub incident: Incident,
    /// How long until the next one.
    pub lasts: Duration,
}

/// The course of the demonstration.
#[derive(Debug)]
pub struct Plan {
    /// Its steps.
    pub steps: Vec<Step>,
    /// Cables that are plugged into the SubDevice that loses its power.
    pub cables_of_device: usize,
    /// Why a cable is not cut, where it is not.
    pub remark: Option<&'static str>,
}

impl Plan {
    /// Picks a cable of the ring and a SubDevice on it. Without a ring no cable is cut, and the last SubDevice of the
    /// line is the one that loses its power.
    pub fn new(scan: &Scan, watch: &Watch, network: &Network) -> Plan {
        let has_ring = network.host_cable(HostLink::Redundant).is_some();
        let path = trunk(scan, has_ring);
        let mut plan = Plan { steps: Vec::new(), cables_of_device: 0, remark: None };
        plan.add(Incident::Calm, STRETCH);
        match cable_to_cut(&path, watch, network).filter(|_| has_ring) {
            Some((cable, ends)) => {
                plan.add(Incident::Cut { cable, ends }, STRETCH);
                plan.add(Incident::Heal { cable, ends }, STRETCH);
            }
            None => plan.remark = Some("no cable is cut: without a ring all SubDevices behind it would be lost"),
        }
        if let Some(position) = device_to_cycle(&path, scan, watch, has_ring) {
            let device = watch.device(position);
            plan.cables_of_device = network
                .cables()
                .filter(|cable| {
                    [cable.a, cable.b].iter().any(|end| matches!(end, Endpoint::Device(at, _) if *at == device))
                })
                .count();
            plan.add(Incident::PowerOff { device, position }, OUTAGE);
            plan.add(Incident::PowerOn { device, position }, STRETCH);
        }
        plan
    }

    fn add(&mut self, incident: Incident, lasts: Duration) {
        self.steps.push(Step { incident, lasts });
    }

    /// Makes an incident happen.
    pub fn bring_about(&self, incident: &Incident, network: &mut Network) {
        match incident {
            Incident::Calm => {}
            Incident::Cut { cable, .. } => network.cut(*cable),
            Incident::Heal { cable, .. } => network.heal(*cable),
            Incident::PowerOff { device, .. } => network.power_off(*device),
            Incident::PowerOn { device, .. } => network.power_on(*device),
        }
    }
}

/// Positions from the main link to the redundant link, or to the end of the line.
fn trunk(scan: &Scan, has_ring: bool) -> Vec<usize> {
    let last = if has_ring { scan.topology.open_ports.last().map(|at| usize::from(at.position().0)) } else { None };
    let mut path = Vec::new();
    let mut node = last.or(scan.subdevices.len().checked_sub(1));
    while let Some(at) = node {
        path.push(at);
        node = scan
            .topology
            .connection_to(Position(at as u16))
            .map(|connection| usize::from(connection.near.position().0));
    }
    path.reverse();
    path
}

fn cable_to_cut(path: &[usize], watch: &Watch, network: &Network) -> Option<(CableId, (usize, usize))> {
    let middle = path.len() / 2;
    let (a, b) = (*path.get(middle.checked_sub(1)?)?, *path.get(middle)?);
    let cable = network.cable_between(watch.device(a), watch.device(b))?;
    Some((cable, (a, b)))
}

/// In a ring a SubDevice with inputs in its first half, and no drive; in a line the last one.
fn device_to_cycle(path: &[usize], scan: &Scan, watch: &Watch, has_ring: bool) -> Option<usize> {
    if !has_ring {
        return path.last().copied();
    }
    let has_inputs = |node: usize| scan.subdevices[node].pdos.iter().any(|pdo| pdo.direction == Direction::Inputs);
    let is_drive = |node: usize| watch.drives.iter().any(|drive| drive.subdevice == node);
    let quarter = path.len() / 4;
    path[quarter..].iter().find(|node| has_inputs(**node) && !is_drive(**node)).or(path.first()).copied()
}
