//! Cyclic tasks: domains, image offsets of the commands, LRW commands by name, clocks (protocol 8.2).

use std::ops::Range;
use std::time::Duration;

use ringcat_engine::info::Direction;
use ringcat_engine::main_device::{DomainConfig, DomainMember, ExplicitLrw, SubDeviceId};
use ringcat_wire::address::Position;
use ringcat_wire::command::{Addressing, Command};
use ringcat_wire::register::map;

use super::areas::Piece;
use super::bus::Bus;
use super::messages::{command_name, named};
use super::notices::Notices;
use super::registers::is_complete;
use crate::eni::{CyclicCommand, CyclicState, Eni, EniError, Problem, Target};

/// Maximum number of comparisons of a logical command with a piece of process data: far more than a segment of 1,000
/// SubDevices needs.
const MAX_COMPARISONS: usize = 5_000_000;
/// Cycle time if the file has none.
const USUAL_CYCLE: Duration = Duration::from_millis(1);

/// The command that exchanges a piece of process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cover {
    /// The task.
    pub task: usize,
    /// First bit in the image according to the command's offset.
    pub image_bit: Option<u64>,
}

/// The result of all tasks.
#[derive(Default)]
pub(super) struct Cyclic {
    pub domains: Vec<DomainConfig>,
    pub explicit_lrw: Vec<ExplicitLrw>,
    /// By SubDevice and piece.
    pub covers: Vec<Vec<Option<Cover>>>,
    pub cycle: Option<Duration>,
    /// Whether a command distributes the time.
    pub distributes: bool,
    /// The SubDevice whose time is distributed.
    pub reference: Option<usize>,
    /// Whether the reference clock follows the host.
    pub bus_shift: bool,
}

/// Evaluates the tasks.
pub(super) fn follow(eni: &Eni, bus: &Bus, mappings: &[Vec<Piece>], notices: &mut Notices) -> Result<Cyclic, EniError> {
    let mut cyclic =
        Cyclic { covers: mappings.iter().map(|pieces| vec![None; pieces.len()]).collect(), ..Cyclic::default() };
    let commands = || {
        let tasks = eni.tasks.iter().enumerate();
        tasks.flat_map(|(task, found)| {
            let frames = found.frames.iter().enumerate();
            frames.flat_map(move |(frame, found)| {
                found.commands.iter().enumerate().map(move |(number, command)| ((task, frame, number), command))
            })
        })
    };
    let is_logical = |command: &CyclicCommand| command.datagram.command.addressing() == Addressing::Logical;
    let logical = commands().filter(|(_, command)| is_logical(command)).count();
    let pieces: usize = mappings.iter().map(|pieces| pieces.len() + 1).sum();
    if logical.saturating_mul(pieces) > MAX_COMPARISONS {
        return Err(EniError::of_file(Problem::TooMuch {
            what: "comparisons of cyclic commands and FMMUs",
            limit: MAX_COMPARISONS,
        }));
    }
    for (at, command) in commands() {
        if is_logical(command) {
            of_process_data(eni, at, command, mappings, &mut cyclic, notices);
        } else {
            of_registers(eni, bus, command, &mut cyclic, notices);
        }
    }
    let any_cover = cyclic.covers.iter().flatten().any(Option::is_some);
    domains(eni, mappings, any_cover, &mut cyclic, notices);
    Ok(cyclic)
}

/// A command as messages name it: `frame 1, command 3 "cyclic cmd"`.
fn name(at: (usize, usize, usize), tasks: usize, command: &CyclicCommand) -> String {
    let (task, frame, number) = (at.0 + 1, at.1 + 1, at.2 + 1);
    let task = if tasks > 1 { format!("task {task}, ") } else { String::new() };
    named(&format!("{task}frame {frame}, command {number}"), &command.comment)
}

/// LRD, LWR, LRW.
fn of_process_data(
    eni: &Eni,
    at: (usize, usize, usize),
    command: &CyclicCommand,
    mappings: &[Vec<Piece>],
    cyclic: &mut Cyclic,
    notices: &mut Notices,
) {
    let Target::Logical(logical) = command.datagram.target else { return };
    let code = command.datagram.command;
    let begin = u64::from(logical.0) * 8;
    let end = begin + command.datagram.data.len() as u64 * 8;
    let (met, count) = cover(eni, at, command, begin..end, mappings, &mut cyclic.covers, notices);
    let element = format!("Cyclic {}", name(at, eni.tasks.len(), command));
    let is_mailbox = eni.main_device.mailbox_states.is_some_and(|states| {
        let start = u64::from(states.start.0) * 8;
        begin < start + u64::from(states.count) * 8 && start < end
    });
    if met.is_empty() {
        if !is_mailbox {
            let reason = format!("{} at {logical} matches no FMMU of the file: not sent", command_name(code));
            notices.add(Some(command.place), None, element, reason);
        }
        return;
    }
    let both = [CyclicState::SafeOp, CyclicState::Op];
    if !command.states.is_empty() && !both.iter().all(|state| command.states.contains(state)) {
        let states: Vec<String> = command.states.iter().map(ToString::to_string).collect();
        let reason = format!("State is {}: RingCAT exchanges process data in SAFEOP and OP", states.join(", "));
        notices.add(Some(command.place), None, element.clone(), reason);
    }
    if let Some(expected) = command.datagram.count.filter(|expected| !is_mailbox && u32::from(*expected) != count) {
        let reason = format!(
            "Cnt is {expected}, but the FMMUs of the file give {count}: RingCAT expects the value of its mapping"
        );
        notices.add(Some(command.place), None, element, reason);
    }
    if code == Command::Lrw {
        let name = format!("{} ({})", name(at, eni.tasks.len(), command), command.place);
        cyclic.explicit_lrw.push(ExplicitLrw::new(
            name,
            logical,
            command.datagram.data.len(),
            met.into_iter().map(SubDeviceId).collect(),
        ));
    }
}

/// Records the pieces that a command exchanges, by their bits in the logical address space. Returns the addressed
/// SubDevices and the resulting working counter.
fn cover(
    eni: &Eni,
    at: (usize, usize, usize),
    command: &CyclicCommand,
    bits: Range<u64>,
    mappings: &[Vec<Piece>],
    covers: &mut [Vec<Option<Cover>>],
    notices: &mut Notices,
) -> (Vec<usize>, u32) {
    let code = command.datagram.command;
    let mut met = Vec::new();
    let mut count = 0_u32;
    for (subdevice, (pieces, covers)) in mappings.iter().zip(covers).enumerate() {
        let (mut reads, mut writes) = (false, false);
        for (piece, cover) in pieces.iter().zip(covers) {
            let (offset, meets) = match piece.direction {
                Direction::Outputs => (command.output_offset, code.writes()),
                Direction::Inputs => (command.input_offset, code.reads()),
            };
            let piece_end = piece.logical_bit + u64::from(piece.bits);
            if !meets || piece.logical_bit >= bits.end || piece_end <= bits.start {
                continue;
            }
            match piece.direction {
                Direction::Outputs => writes = true,
                Direction::Inputs => reads = true,
            }
            if piece.logical_bit < bits.start || piece_end > bits.end {
                let reason = format!("{} covers a part of it only", name(at, eni.tasks.len(), command));
                notices.add(Some(piece.place), Some(subdevice), "process data of an FMMU", reason);
            }
            if cover.is_none() {
                let image_bit =
                    offset.and_then(|offset| (u64::from(offset) * 8 + piece.logical_bit).checked_sub(bits.start));
                *cover = Some(Cover { task: at.0, image_bit });
            }
        }
        if reads || writes {
            met.push(subdevice);
            // Protocol 1.4: LRW increments by 1 for a read and by 2 for a write.
            let write = if code == Command::Lrw { 2 } else { 1 };
            count += u32::from(reads) + if writes { write } else { 0 };
        }
    }
    (met, count)
}

/// All other commands: RingCAT itself handles clocks and supervision.
fn of_registers(eni: &Eni, bus: &Bus, command: &CyclicCommand, cyclic: &mut Cyclic, notices: &mut Notices) {
    let Target::Register { adp, ado } = command.datagram.target else { return };
    let code = command.datagram.command;
    match (code, ado) {
        (Command::Nop, _) => {}
        (Command::Armw | Command::Frmw, map::DC_SYSTEM_TIME) => {
            if !cyclic.distributes {
                cyclic.reference = addressed(eni, bus, code, adp);
            }
            cyclic.distributes = true;
        }
        (Command::Apwr | Command::Fpwr | Command::Bwr, map::DC_SYSTEM_TIME) => cyclic.bus_shift = true,
        (code, map::AL_STATUS | map::DC_SYSTEM_TIME | map::DC_SYSTEM_TIME_DIFFERENCE) if !code.writes() => {}
        (code, ado) => {
            let reason = format!("{} to register {ado} in the cycle: not sent", command_name(code));
            notices.add(Some(command.place), None, named("Cyclic command", &command.comment), reason);
        }
    }
}

/// The SubDevice that a command addresses.
fn addressed(eni: &Eni, bus: &Bus, command: Command, adp: u16) -> Option<usize> {
    if command.addressing() == Addressing::Station {
        return eni.subdevices.iter().position(|subdevice| subdevice.station == Some(adp));
    }
    let by_increment = eni.subdevices.iter().position(|subdevice| subdevice.auto_increment == Some(adp));
    let position = ringcat_engine::config::ConfigAddress::Position(Position(adp).auto_increment());
    let by_position = || (0..).zip(&bus.addresses).find(|(index, at)| bus.groups[*index].is_none() && **at == position);
    by_increment.or_else(|| by_position().map(|(index, _)| index))
}

/// One domain per task that exchanges process data.
fn domains(eni: &Eni, mappings: &[Vec<Piece>], any_cover: bool, cyclic: &mut Cyclic, notices: &mut Notices) {
    let fastest_clock = eni.subdevices.iter().filter_map(|subdevice| subdevice.clock.as_ref());
    let clock_cycle = fastest_clock.map(|clock| clock.cycle_0_ns).filter(|cycle| *cycle > 0).min();
    let period = |task: usize| {
        let said = eni.tasks.get(task).and_then(|task| task.cycle_us).filter(|cycle| *cycle > 0);
        said.map(|cycle| Duration::from_micros(cycle.into()))
    };
    let substitute = clock_cycle.map_or(USUAL_CYCLE, |cycle| Duration::from_nanos(cycle.into()));
    cyclic.cycle = (0..eni.tasks.len()).filter_map(period).min();
    let tasks = eni.tasks.len().max(1);
    let mut members: Vec<Vec<DomainMember>> = vec![Vec::new(); tasks];
    if !any_cover && mappings.iter().any(|pieces| !pieces.is_empty()) {
        let reason = "no logical command exchanges process data: all of it is exchanged in one domain";
        notices.add(None, None, "Cyclic", reason);
    }
    for (subdevice, pieces) in mappings.iter().enumerate() {
        let left_to_sii = !is_complete(&eni.subdevices[subdevice].init_commands);
        if left_to_sii || (!any_cover && !pieces.is_empty()) {
            members[0].push(DomainMember::new(SubDeviceId(subdevice)));
            continue;
        }
        let mut by_task: Vec<(usize, u8)> = Vec::new();
        for (piece, cover) in pieces.iter().zip(&cyclic.covers[subdevice]) {
            match cover {
                Some(cover) => by_task.push((cover.task, piece.sync_manager)),
                None => {
                    let reason = "no cyclic command covers its logical addresses: not exchanged";
                    notices.add(
                        Some(piece.place),
                        Some(subdevice),
                        format!("SyncManager {}", piece.sync_manager),
                        reason,
                    );
                }
            }
        }
        // A SyncManager is exchanged as a whole, by the first task that contains a part of it.
        by_task.sort_unstable_by_key(|(task, sync_manager)| (*sync_manager, *task));
        by_task.dedup_by_key(|(_, sync_manager)| *sync_manager);
        let covered = by_task.len();
        let all: std::collections::BTreeSet<u8> = pieces.iter().map(|piece| piece.sync_manager).collect();
        by_task.sort_unstable();
        for chunk in by_task.chunk_by(|a, b| a.0 == b.0) {
            let whole = chunk.len() == covered && covered == all.len();
            let sync_managers = (!whole).then(|| chunk.iter().map(|(_, sync_manager)| *sync_manager).collect());
            members[chunk[0].0].push(DomainMember::new(SubDeviceId(subdevice)).with_sync_managers(sync_managers));
        }
    }
    for (task, members) in members.into_iter().enumerate().filter(|(_, members)| !members.is_empty()) {
        if period(task).is_none() {
            let place = eni.tasks.get(task).map(|task| task.place);
            let reason = format!("missing: {substitute:?} is taken");
            notices.add(place, None, "Cyclic/CycleTime", reason);
        }
        cyclic.domains.push(DomainConfig::new(period(task).unwrap_or(substitute), members));
    }
}
