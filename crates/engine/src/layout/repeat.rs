//! The part of a frame that may be sent again within the same cycle (decision 0045).
//!
//! Input: a planned frame, and for each SubDevice what it may receive twice in a cycle. Output: a frame with the
//! datagrams that may be repeated. A datagram is cut around the areas of SubDevices that must not see it twice. The
//! presence datagram is repeated, because it reads the AL status only. Clock and supervision datagrams never are:
//! first tries alone show the ring and the clocks.

use alloc::vec::Vec;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::{MAX_DATA, OVERHEAD};

use super::{PlacedArea, PlannedDatagram, PlannedDomain, PlannedFrame, contributions};
use crate::direction::Direction;

/// Whether outputs of a SubDevice may be sent twice in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutputsAgain {
    /// At any time: it runs free.
    #[default]
    Always,
    /// Before the next SYNC0 after the first try.
    BeforeSync0 {
        /// Cycle of SYNC0 in nanoseconds.
        cycle_ns: u32,
        /// Shift of SYNC0 after the multiples of its cycle in system time, in nanoseconds.
        shift_ns: i32,
    },
    /// Never: each write is an event for it, or there is one buffer.
    Never,
}

/// What a SubDevice may receive twice in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RepeatRule {
    /// Its outputs.
    pub outputs: OutputsAgain,
    /// Its inputs may be read twice.
    pub inputs: bool,
}

impl Default for RepeatRule {
    fn default() -> RepeatRule {
        RepeatRule { outputs: OutputsAgain::Always, inputs: true }
    }
}

impl RepeatRule {
    /// Nothing is sent again.
    pub const NEVER: RepeatRule = RepeatRule { outputs: OutputsAgain::Never, inputs: false };

    fn allows(self, direction: Direction) -> bool {
        match direction {
            Direction::Outputs => self.outputs != OutputsAgain::Never,
            Direction::Inputs => self.inputs,
        }
    }
}

/// Origin of a repeated datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Index of the datagram in the planned frame.
    pub datagram: usize,
    /// Index of its first input area in that datagram.
    pub first_part: usize,
}

/// A frame with the datagrams that may be repeated.
#[derive(Clone, Debug)]
pub struct PlannedRepeat {
    /// The frame.
    pub frame: PlannedFrame,
    /// Origin of each of its process data datagrams.
    pub pieces: Vec<Piece>,
}

impl PlannedDomain {
    /// The part of a frame of this domain that may be repeated; `None` if there is none. `most`: largest number of
    /// datagrams. Pieces that do not fit are left out.
    pub(crate) fn repeat(
        &self,
        frame: &PlannedFrame,
        most: Option<usize>,
        rule: impl Fn(usize) -> RepeatRule,
    ) -> Option<PlannedRepeat> {
        let bare = PlannedFrame { presence: frame.presence.clone(), ..PlannedFrame::default() };
        let mut repeat = PlannedRepeat { frame: bare, pieces: Vec::new() };
        for (index, datagram) in frame.datagrams.iter().enumerate() {
            for (piece, first_part) in self.pieces(datagram, &rule) {
                let length = OVERHEAD + usize::from(piece.outputs) + usize::from(piece.inputs);
                if repeat.frame.bytes() + length <= MAX_DATA + OVERHEAD && repeat.frame.takes(1, most) {
                    repeat.frame.datagrams.push(piece);
                    repeat.pieces.push(Piece { datagram: index, first_part });
                }
            }
        }
        (!repeat.pieces.is_empty()).then_some(repeat)
    }

    /// Repeatable parts of a datagram, each with the index of its first input area.
    fn pieces(&self, datagram: &PlannedDatagram, rule: &impl Fn(usize) -> RepeatRule) -> Vec<(PlannedDatagram, usize)> {
        let may = |placed: &PlacedArea| rule(placed.area.subdevice).allows(placed.area.direction);
        let (outputs, inputs) = (&datagram.output_areas, &datagram.input_areas);
        if outputs.iter().chain(inputs).all(may) {
            return Vec::from([(datagram.clone(), 0)]);
        }
        let written = runs(outputs, may).map(|(_, run)| (piece(Command::Lwr, run), 0));
        let read = runs(inputs, may).map(|(first, run)| (piece(Command::Lrd, run), first));
        written.chain(read).collect()
    }
}

/// Neighbouring areas that may all be repeated, each run with the index of its first area.
fn runs(areas: &[PlacedArea], may: impl Fn(&PlacedArea) -> bool) -> impl Iterator<Item = (usize, &[PlacedArea])> {
    let joined =
        |a: &PlacedArea, b: &PlacedArea| may(a) == may(b) && a.logical.0 + u32::from(a.area.length) == b.logical.0;
    let mut first = 0;
    let mut found = Vec::new();
    for run in areas.chunk_by(joined) {
        if may(&run[0]) {
            found.push((first, run));
        }
        first += run.len();
    }
    found.into_iter()
}

/// A datagram of these areas.
fn piece(command: Command, areas: &[PlacedArea]) -> PlannedDatagram {
    let length = areas.iter().map(|placed| placed.area.length).sum();
    let (reads, writes): (&[PlacedArea], &[PlacedArea]) =
        if command == Command::Lrd { (areas, &[]) } else { (&[], areas) };
    PlannedDatagram {
        command,
        logical: areas[0].logical,
        outputs: if command == Command::Lrd { 0 } else { length },
        inputs: if command == Command::Lrd { length } else { 0 },
        contributions: contributions(command, reads, writes),
        output_areas: writes.to_vec(),
        input_areas: reads.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use core::time::Duration;

    use super::*;
    use crate::layout::{AreaSpec, DomainSpec, ImageOrder, Layout, LrwPolicy, Rules};
    use crate::link::LinkSet;

    fn layout(links: LinkSet, count: usize, length: u16) -> Layout {
        let area = |subdevice, direction| AreaSpec { subdevice, sync_manager: direction as u8, direction, length };
        let areas = (0..count).flat_map(|s| [area(s, Direction::Outputs), area(s, Direction::Inputs)]).collect();
        let spec =
            DomainSpec { period: Duration::from_millis(1), under_way: 1, lrw: true, areas, image: ImageOrder::Packed };
        let lrw = LrwPolicy::Automatic;
        let rules = Rules { links, supervision: true, lrw, witnesses: &[], session: 0, max_datagrams: None };
        Layout::with(&[spec], rules).expect("it fits")
    }

    fn repeat(layout: &Layout, never: &[usize]) -> Option<PlannedRepeat> {
        let domain = &layout.domains[0];
        let rule = |subdevice: usize| {
            let outputs = if never.contains(&subdevice) { OutputsAgain::Never } else { OutputsAgain::Always };
            RepeatRule { outputs, inputs: true }
        };
        domain.repeat(&domain.frames[0], None, rule)
    }

    // covers: lost-frames
    #[test]
    fn datagrams_are_cut_around_outputs_that_must_not_come_twice() {
        let layout = layout(LinkSet::Ring, 4, 2);
        let whole = repeat(&layout, &[]).expect("all may be repeated");
        assert_eq!(whole.frame.datagrams.len(), 2, "LWR and LRD as they are");
        let cut = repeat(&layout, &[1]).expect("three may be repeated");
        let seen: Vec<(Command, u32, u16, u16)> =
            cut.frame.datagrams.iter().map(|it| (it.command, it.logical.0, it.outputs, it.inputs)).collect();
        let expected = [(Command::Lwr, 0, 2, 0), (Command::Lwr, 4, 4, 0), (Command::Lrd, 8, 0, 8)];
        assert_eq!(seen, expected);
        assert!(!cut.frame.supervision && !cut.frame.clocks);
    }

    // covers: lost-frames
    #[test]
    fn an_lrw_becomes_a_read_where_no_output_may_be_repeated() {
        let layout = layout(LinkSet::Single, 2, 3);
        let read = repeat(&layout, &[0, 1]).expect("inputs may be repeated");
        let commands: Vec<Command> = read.frame.datagrams.iter().map(|it| it.command).collect();
        assert_eq!(commands, [Command::Lrd]);
        assert_eq!(read.pieces, [Piece { datagram: 0, first_part: 0 }]);
        let domain = &layout.domains[0];
        assert!(domain.repeat(&domain.frames[0], None, |_| RepeatRule::NEVER).is_none());
    }

    // covers: lost-frames
    #[test]
    fn pieces_that_do_not_fit_a_frame_are_left_out() {
        let layout = layout(LinkSet::Ring, 100, 6);
        let odd: Vec<usize> = (0..100).filter(|subdevice| subdevice % 2 == 1).collect();
        let cut = repeat(&layout, &odd).expect("inputs may be repeated");
        assert!(cut.frame.bytes() <= MAX_DATA + OVERHEAD, "{}", cut.frame.bytes());
        assert_eq!(cut.frame.datagrams.len(), cut.pieces.len());
    }
}
