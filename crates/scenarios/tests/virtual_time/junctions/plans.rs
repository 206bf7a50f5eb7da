//! Random segments with rings behind junctions and a hot connect group, built port by port.

use ringcat::{
    Declaration, DomainMember, Error, JunctionConnection, JunctionMode, Options, Scan, SubDeviceConfig, SubDeviceId,
    automatic,
};
use ringcat_sim::cable::{DeviceIndex, Endpoint};
use ringcat_sim::frame::Port::{self, A, B, C, D};
use ringcat_sim::network::Network;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{MAIN, REDUNDANT, at, descriptions, wired_with};
use scenarios::world::{CYCLE, World};

use crate::hot_connect::{TOOL, group, infos, tool};

const KINDS: [&str; 5] = ["digital-output-8", "digital-input-8", "servo", "analog-input-4", "block"];
/// Numbers of the group's devices until the number of the others is known.
const FIRST: usize = 1_000;

fn kind(dice: &mut Dice) -> &'static str {
    KINDS[dice.below(KINDS.len() as u64) as usize]
}

/// Place of the group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Nowhere,
    /// A part of a ring: before the member with this number.
    Before(u64),
    /// The end of a ring.
    Tail,
    /// A branch of a member.
    Branch,
    /// The end of the line.
    End,
}

/// A segment under construction.
#[derive(Debug, Default)]
pub struct Plan {
    pub kinds: Vec<&'static str>,
    pub cables: Vec<(Endpoint, Endpoint)>,
    pub connections: Vec<JunctionConnection>,
    /// Cables of local rings.
    pub local: Vec<usize>,
    /// The group is a part of a ring.
    pub in_ring: bool,
    pub has_group: bool,
    pub two_links: bool,
}

impl Plan {
    fn hang(&mut self, kind: &'static str, from: Endpoint) -> usize {
        self.cables.push((from, at(self.kinds.len(), A)));
        self.kinds.push(kind);
        self.kinds.len() - 1
    }

    fn hang_group(&mut self, from: Endpoint) -> Endpoint {
        self.cables.extend([(from, at(FIRST, A)), (at(FIRST, B), at(FIRST + 1, A))]);
        self.has_group = true;
        at(FIRST + 1, B)
    }

    /// Adds a ring behind a junction; returns the port from which the line continues.
    fn ring(&mut self, dice: &mut Dice, junction: usize, ports: (Port, Port), place: &mut Place, nested: bool) {
        let begin = self.cables.len();
        let (mut last, mut inner) = (at(junction, ports.0), Vec::new());
        for number in 0..1 + dice.below(3) {
            if *place == Place::Before(number) {
                *place = Place::Nowhere;
                self.in_ring = true;
                last = self.hang_group(last);
            }
            if nested && dice.one_in(4) {
                let member = self.hang("junction", last);
                let from = self.cables.len();
                self.ring(dice, member, (D, B), &mut { Place::Nowhere }, false);
                inner.extend(from..self.cables.len());
                last = at(member, C);
            } else if *place == Place::Branch || dice.one_in(3) {
                let member = self.hang("junction", last);
                let from = self.cables.len();
                if *place == Place::Branch {
                    *place = Place::Nowhere;
                    self.hang_group(at(member, D));
                } else {
                    self.hang(kind(dice), at(member, D));
                }
                inner.extend(from..self.cables.len());
                last = at(member, B);
            } else {
                last = at(self.hang(kind(dice), last), B);
            }
        }
        if *place == Place::Tail {
            *place = Place::Nowhere;
            self.in_ring = true;
            last = self.hang_group(last);
        }
        self.cables.push((last, at(junction, ports.1)));
        self.local.extend((begin..self.cables.len()).filter(|cable| !inner.contains(cable)));
        let Endpoint::Device(DeviceIndex(tail), tail_port) = last else { unreachable!("a ring has members") };
        let number = |port: Port| port.index() as u8;
        self.connections.push(JunctionConnection::new(
            SubDeviceId(junction),
            number(ports.1),
            SubDeviceId(tail),
            number(tail_port),
        ));
    }

    pub fn random(dice: &mut Dice) -> Plan {
        let mut plan = Plan::default();
        let before = dice.below(3);
        let mut place = *dice.pick(&[
            Place::Nowhere,
            Place::Before(before),
            Place::Before(0),
            Place::Tail,
            Place::Branch,
            Place::End,
        ]);
        let mut end = MAIN;
        // At least one device has process data.
        for _ in 0..1 + dice.below(2) {
            end = at(plan.hang(kind(dice), end), B);
        }
        let junction = plan.hang("junction", end);
        let ports = if dice.one_in(4) { *dice.pick(&[(D, C), (B, C)]) } else { (D, B) };
        plan.ring(dice, junction, ports, &mut place, true);
        let goes_on = ports.1 == B;
        end = at(junction, C);
        if goes_on {
            for _ in 0..1 + dice.below(2) {
                end = at(plan.hang(kind(dice), end), B);
            }
            if dice.one_in(3) {
                let junction = plan.hang("junction", end);
                plan.ring(dice, junction, (D, B), &mut place, false);
                end = at(junction, C);
            }
            if place == Place::End {
                plan.hang_group(end);
            } else if dice.one_in(2) {
                plan.two_links = true;
                plan.cables.push((end, REDUNDANT));
            }
        }
        plan.number_group();
        plan
    }

    /// The group's devices come last.
    fn number_group(&mut self) {
        let base = self.kinds.len();
        let moved = |device: usize| if device >= FIRST { base + device - FIRST } else { device };
        let end = |end: Endpoint| match end {
            Endpoint::Device(DeviceIndex(device), port) => at(moved(device), port),
            host => host,
        };
        self.cables.iter_mut().for_each(|(one, other)| (*one, *other) = (end(*one), end(*other)));
        self.connections.iter_mut().for_each(|it| (it.head.0, it.tail.0) = (moved(it.head.0), moved(it.tail.0)));
    }

    pub fn world(&self, seed: u64, strict: bool, group_is_on: bool) -> World {
        self.try_world(seed, strict, group_is_on, |_| ()).unwrap_or_else(|error| panic!("{error}"))
    }

    /// A world with a change before power-on, if the declaration is accepted.
    pub fn try_world(
        &self,
        seed: u64,
        strict: bool,
        group_is_on: bool,
        before: impl FnOnce(&mut Network),
    ) -> Result<World, Error> {
        let devices = descriptions(&self.kinds).into_iter().chain(if self.has_group { tool() } else { Vec::new() });
        let mut network = wired_with(devices.collect(), &self.cables);
        if self.has_group && !group_is_on {
            self.group().iter().for_each(|device| network.power_off(*device));
        }
        before(&mut network);
        let junctions = if strict { JunctionMode::Strict } else { JunctionMode::Automatic };
        let options = Options::default().with_junctions(junctions);
        let connections: &[JunctionConnection] = if strict { &self.connections } else { &[] };
        let declare = |_: &Scan| self.declaration().with_sends_again(seeds::sends_again(seed));
        World::with_junctions(seed, network, &options, declare, connections)
    }

    fn declaration(&self) -> Declaration {
        let mut declaration = automatic(&infos(&self.kinds), CYCLE);
        if self.has_group {
            let members = declaration.add_group(group(SubDeviceConfig::at_alias(TOOL, 0))).members;
            let of_domain = members.into_iter().map(DomainMember::new);
            declaration.domains[0].members.extend(of_domain);
        }
        declaration
    }

    pub fn group(&self) -> [DeviceIndex; 2] {
        [DeviceIndex(self.kinds.len()), DeviceIndex(self.kinds.len() + 1)]
    }

    /// Cables of which one may break without the loss of a SubDevice.
    pub fn redundant_cables(&self) -> Vec<usize> {
        let mut cables = self.local.clone();
        if self.two_links {
            // From the interfaces to the first junction, and behind the last.
            cables.extend([0, self.cables.len() - 1]);
        }
        cables
    }
}
