//! SubDevices at another place than in the file. Two that have changed places are one difference, which names both.

use std::collections::BTreeMap;

use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::SubDeviceInfo;

use super::align::{Place, position};
use super::difference::{Difference, DifferenceKind};
use super::marks::Marks;
use super::moves::{Move, moves};
use crate::configuration::Configuration;

/// The places of the SubDevices that were found and are declared by position.
pub(super) struct Order {
    /// Declarations in the order of their positions.
    declared: Vec<Member>,
    /// Indices of these, by declaration.
    index: BTreeMap<usize, usize>,
    /// Their changes.
    moves: Vec<Option<Move>>,
    /// Indices of `declared` in the order of the bus.
    by_bus: Vec<usize>,
}

/// A SubDevice of the file that was found.
#[derive(Clone, Copy)]
struct Member {
    config: usize,
    /// Its position in the file.
    file: usize,
    /// Its position on the bus.
    bus: usize,
}

impl Order {
    pub(super) fn of(configuration: &Configuration, found: &[SubDeviceInfo], places: &[Place]) -> Order {
        let configs = &configuration.declaration.subdevices;
        let member = |place: &Place| {
            let Place::Both { config, info, .. } = *place else { return None };
            let file = position(&configs[config]);
            (file <= 0xFFFF).then(|| Member { config, file, bus: found[info].position.0.into() })
        };
        let mut declared: Vec<Member> = places.iter().filter_map(member).collect();
        declared.sort_by_key(|member| member.file);
        let index = declared.iter().enumerate().map(|(at, member)| (member.config, at)).collect();
        let bus: Vec<usize> = declared.iter().map(|member| member.bus).collect();
        let mut by_bus: Vec<usize> = (0..declared.len()).collect();
        by_bus.sort_by_key(|at| bus[*at]);
        Order { moves: moves(&bus), declared, index, by_bus }
    }

    /// A SubDevice of the file that is at another place, as a difference.
    pub(super) fn difference(
        &self,
        config: usize,
        names: &[String],
        marks: &Marks,
        info: &SubDeviceInfo,
    ) -> Option<Difference> {
        let fails = marks.fails(config)
            || self.other(config).is_some_and(|other| marks.fails(other))
            || self.shifted_with(config).any(|other| marks.fails(other));
        Some(Difference {
            subdevice: Some(SubDeviceId(config)),
            position: Some(info.position),
            kind: DifferenceKind::Order,
            prevents_op: fails,
            text: self.text(config, names)?,
        })
    }

    /// Where a SubDevice is, and where the file has it; `None` if it was named with the one that it has changed places
    /// with.
    pub(super) fn text(&self, config: usize, names: &[String]) -> Option<String> {
        let at = *self.index.get(&config)?;
        let Member { file, bus, .. } = self.declared[at];
        let name = &names[config];
        let Some(Move::With(other)) = self.moves[at] else {
            // Both positions may be the same number by chance if others are missing or additional before it.
            if file == bus {
                let (is, said) = (self.behind_on_bus(at, names), self.behind(at.checked_sub(1), names));
                return Some(format!("\"{name}\" is {is}, the file has it {said}"));
            }
            let more = match self.shifted_with(config).count() {
                0 => String::new(),
                1 => "; the one behind it is shifted by as much".to_owned(),
                count => format!("; {count} behind it are shifted by as much"),
            };
            return Some(format!("\"{name}\" is at position {bus}, the file has it at position {file}{more}"));
        };
        if other < at {
            return None;
        }
        let partner = self.declared[other];
        let second = &names[partner.config];
        Some(if (bus, partner.bus) == (partner.file, file) {
            format!(
                "\"{name}\" is at position {bus} instead of position {file}, and \"{second}\" at position {} instead \
                 of position {}",
                partner.bus, partner.file
            )
        } else {
            format!(
                "\"{name}\" and \"{second}\" have changed places: they are at positions {bus} and {}, the file has \
                 them at positions {file} and {}",
                partner.bus, partner.file
            )
        })
    }

    /// The SubDevices behind one that are as far from their positions as it is, up to the first that is not.
    pub(super) fn shifted_with(&self, config: usize) -> impl Iterator<Item = usize> {
        let shift = |member: &Member| member.bus as isize - member.file as isize;
        let at = self.index.get(&config).copied().filter(|at| self.moves[*at].is_none());
        let own = at.map(|at| shift(&self.declared[at])).filter(|shift| *shift != 0);
        let behind = self.declared.iter().zip(&self.moves).skip(at.map_or(self.declared.len(), |at| at + 1));
        let behind = behind.take_while(move |(member, change)| change.is_none() && Some(shift(member)) == own);
        behind.map(|(member, _)| member.config)
    }

    /// The SubDevice with which this one has changed places.
    pub(super) fn other(&self, config: usize) -> Option<usize> {
        match self.moves[*self.index.get(&config)?] {
            Some(Move::With(other)) => Some(self.declared[other].config),
            _ => None,
        }
    }

    fn behind_on_bus(&self, at: usize, names: &[String]) -> String {
        let own = self.by_bus.iter().position(|other| *other == at);
        self.behind(own.and_then(|own| own.checked_sub(1)).map(|before| self.by_bus[before]), names)
    }

    fn behind(&self, at: Option<usize>, names: &[String]) -> String {
        at.map_or_else(|| "first".to_owned(), |at| format!("behind \"{}\"", names[self.declared[at].config]))
    }
}
