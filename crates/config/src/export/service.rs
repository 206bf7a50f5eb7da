//! What the first task has besides process data, the time and the states, and its room in the image: each cyclic
//! command has a place there. Both images have the same length, as those of other tools.

use ringcat_wire::command::Command;
use ringcat_wire::register::map;

use super::clocks;
use crate::configuration::Configuration;
use crate::eni::{CyclicCommand, CyclicState, Datagram, Place, Target};

/// The commands, with their places behind the process data.
pub(super) fn commands(whole: &Configuration) -> Vec<CyclicCommand> {
    let mut commands = clocks::cyclic(whole);
    commands.push(states(whole));
    let mut offset = begin(whole);
    for command in &mut commands {
        let place = u32::try_from(offset).ok();
        (command.input_offset, command.output_offset) = (place, place);
        offset += command.datagram.data.len();
    }
    commands
}

/// Number of tasks: one per domain; without domains one if there is something to send.
pub(super) fn tasks(whole: &Configuration) -> usize {
    let is_cyclic = whole.cycle.is_some() || whole.declaration.clocks.is_some();
    whole.declaration.domains.len().max(usize::from(is_cyclic))
}

/// Bytes of both images with the places of these commands.
pub(super) fn image_bytes(whole: &Configuration) -> usize {
    let service: usize = commands(whole).iter().map(|command| command.datagram.data.len()).sum();
    whole.image.inputs_len.max(whole.image.outputs_len).max(begin(whole) + service)
}

/// The first byte behind the process data in both images. Variables without a SubDevice may be there: in other tools
/// they are what these commands read.
fn begin(whole: &Configuration) -> usize {
    let areas = whole.image.areas.iter().map(|area| u64::from(area.image_bit) + u64::from(area.bits));
    let bits = areas.max().unwrap_or_default();
    usize::try_from(bits.div_ceil(8)).unwrap_or(usize::MAX)
}

fn states(whole: &Configuration) -> CyclicCommand {
    let count = u16::try_from(whole.declaration.subdevices.len()).ok().filter(|_| whole.groups.is_empty());
    CyclicCommand {
        place: Place::default(),
        states: vec![CyclicState::PreOp, CyclicState::SafeOp, CyclicState::Op],
        comment: "states of all".to_owned(),
        datagram: Datagram {
            command: Command::Brd,
            target: Target::Register { adp: 0, ado: map::AL_STATUS },
            data: vec![0; 2],
            count,
        },
        input_offset: None,
        output_offset: None,
        copies: Vec::new(),
    }
}
