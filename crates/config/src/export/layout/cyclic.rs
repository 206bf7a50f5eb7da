//! `Cyclic`: the tasks with their frames.

use std::collections::{BTreeSet, HashMap};

use ringcat_engine::info::Direction;
use ringcat_wire::address::LogicalAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::OVERHEAD;

use super::{Layout, Stream, Window, bytes};
use crate::configuration::Configuration;
use crate::eni::{CopyInfo, CyclicCommand, CyclicState, CyclicTask, Datagram, Frame, Place, Target};
use crate::export::error::ExportError;
use crate::export::service;
use crate::xml::one_line;

/// Bytes of the datagrams of a frame (protocol 1.3).
const FRAME: usize = 1498;
/// Datagrams of a frame.
const DATAGRAMS: usize = 15;

impl Layout {
    /// The tasks, by domain.
    pub fn tasks(&self, whole: &Configuration, names: &[String]) -> Result<Vec<CyclicTask>, ExportError> {
        let copies = copies(whole)?;
        let domains = &whole.declaration.domains;
        let task = |number: usize| {
            let period = domains.get(number).map(|domain| domain.period).or(whole.cycle);
            let mut commands = if number == 0 { service::commands(whole) } else { Vec::new() };
            for ((_, stream), window) in self.windows.range((number, Stream::Outputs)..=(number, Stream::Both)) {
                commands.extend(window.commands.iter().map(|areas| command(whole, window, *stream, areas, &copies)));
            }
            CyclicTask {
                place: Place::default(),
                comment: names.get(number).map(|name| one_line(name)).unwrap_or_default(),
                // Without a cycle time in its file a network has the usual one.
                cycle_us: period.filter(|_| whole.cycle.is_some()).and_then(|it| u32::try_from(it.as_micros()).ok()),
                frames: frames(commands),
            }
        };
        Ok((0..service::tasks(whole)).map(task).collect())
    }
}

/// The command for areas without a gap.
fn command(
    whole: &Configuration,
    window: &Window,
    stream: Stream,
    areas: &[usize],
    copies: &HashMap<usize, Vec<CopyInfo>>,
) -> CyclicCommand {
    let of = |direction| areas.iter().map(|it| &whole.image.areas[*it]).filter(move |it| it.direction == direction);
    let all = || areas.iter().map(|it| bytes(&whole.image.areas[*it]));
    let begin = all().map(|range| range.start).min().unwrap_or_default();
    let end = all().map(|range| range.end).max().unwrap_or_default();
    let [writers, readers] = [Direction::Outputs, Direction::Inputs]
        .map(|direction| of(direction).map(|area| area.subdevice).collect::<BTreeSet<usize>>().len());
    // Protocol 1.4: LRW increments by 1 for a read and by 2 for a write.
    let (command, comment, count) = match stream {
        Stream::Outputs => (Command::Lwr, "outputs", writers),
        Stream::Inputs => (Command::Lrd, "inputs", readers),
        Stream::Both => (Command::Lrw, "outputs and inputs", 2 * writers + readers),
    };
    let offset = u32::try_from(begin).unwrap_or(u32::MAX);
    CyclicCommand {
        place: Place::default(),
        states: vec![CyclicState::SafeOp, CyclicState::Op],
        comment: comment.to_owned(),
        datagram: Datagram {
            command,
            target: Target::Logical(LogicalAddress(window.begin.saturating_add(offset))),
            data: vec![0; end - begin],
            count: u16::try_from(count).ok(),
        },
        input_offset: Some(offset),
        output_offset: Some(offset),
        copies: areas.iter().filter_map(|area| copies.get(area)).flatten().copied().collect(),
    }
}

/// Copies by their source.
fn copies(whole: &Configuration) -> Result<HashMap<usize, Vec<CopyInfo>>, ExportError> {
    let areas = &whole.image.areas;
    let mut found: HashMap<usize, Vec<CopyInfo>> = HashMap::new();
    for copy in &whole.image.copies {
        let place = |area: usize, bit: u32| areas.get(area)?.image_bit.checked_add(bit);
        let pair = place(copy.source_area, copy.source_bit).zip(place(copy.target_area, copy.target_bit));
        let (source, target) = pair.ok_or_else(|| ExportError::whole("copies", "one is outside of the image"))?;
        let copy_info = CopyInfo { place: Place::default(), source, target, bits: copy.bits };
        found.entry(copy.source_area).or_default().push(copy_info);
    }
    Ok(found)
}

/// The commands in as few frames as hold them.
fn frames(commands: Vec<CyclicCommand>) -> Vec<Frame> {
    let mut frames: Vec<Frame> = Vec::new();
    let mut used = FRAME;
    for command in commands {
        let length = OVERHEAD + command.datagram.data.len();
        match frames.last_mut().filter(|last| used + length <= FRAME && last.commands.len() < DATAGRAMS) {
            Some(last) => last.commands.push(command),
            None => {
                used = 0;
                frames.push(Frame { commands: vec![command] });
            }
        }
        used += length;
    }
    frames
}
