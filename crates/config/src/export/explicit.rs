//! A configuration with everything that its ENI states and that the engine otherwise decides: station addresses, time
//! limits of state changes. The reader gives this configuration back.

use std::collections::HashSet;

use ringcat_engine::config::{StartupCommand, StateTimeout, SubDeviceConfig};
use ringcat_engine::info::Direction;
use ringcat_wire::al::AlState;

use super::error::LeftOut;
use super::layout::overlaps_in_lrw;
use super::lrw::Lrw;
use super::service;
use crate::configuration::Configuration;
use crate::xml::one_line;

/// The first station address.
const FIRST_STATION: u16 = 1001;
/// State changes with a limit in every file.
pub(super) const UP: [(AlState, AlState); 3] =
    [(AlState::Init, AlState::PreOp), (AlState::PreOp, AlState::SafeOp), (AlState::SafeOp, AlState::Op)];
/// State changes with a limit in every file, those of BOOT if there is a mailbox for it or the limit is not the usual
/// one.
pub(super) const OTHERS: [(AlState, AlState); 8] = [
    (AlState::Init, AlState::Boot),
    (AlState::Boot, AlState::Init),
    (AlState::PreOp, AlState::Init),
    (AlState::SafeOp, AlState::Init),
    (AlState::Op, AlState::Init),
    (AlState::Op, AlState::SafeOp),
    (AlState::SafeOp, AlState::PreOp),
    (AlState::Op, AlState::PreOp),
];

pub(super) fn explicit(configuration: &Configuration, lrw: &Lrw, left_out: &mut Vec<LeftOut>) -> Configuration {
    let mut whole = configuration.clone();
    for config in &mut whole.declaration.subdevices {
        limits(config);
        signals(config);
        // An ENI has the commands in the order in which they are sent.
        config.startup.sort_by_key(StartupCommand::is_after_pdos);
        for command in &mut config.startup {
            command.after_pdos = false;
            command.comment = command.comment.take().map(|text| one_line(&text)).filter(|text| !text.is_empty());
        }
    }
    stations(&mut whole);
    heads(&mut whole, left_out);
    for facts in &mut whole.subdevices {
        facts.name = one_line(&facts.name);
    }
    whole.groups.iter_mut().for_each(|name| *name = one_line(name));
    for variable in &mut whole.image.variables {
        variable.name = one_line(&variable.name);
        variable.data_type = one_line(&variable.data_type);
    }
    // An ENI lists the inputs first.
    whole.image.variables.sort_by_key(|variable| variable.direction == Direction::Outputs);
    if overlaps_in_lrw(&whole, lrw) {
        move_inputs(&mut whole, left_out);
    }
    if service::tasks(&whole) > 0 {
        let bytes = service::image_bytes(&whole);
        (whole.image.inputs_len, whole.image.outputs_len) = (bytes, bytes);
    }
    whole
}

/// An LRW has the outputs before the inputs, so the inputs of the image begin behind the outputs.
fn move_inputs(whole: &mut Configuration, left_out: &mut Vec<LeftOut>) {
    let bytes = whole.image.outputs_len;
    let bits = u32::try_from(bytes * 8).unwrap_or(u32::MAX);
    whole.image.inputs_len += bytes;
    let areas = whole.image.areas.iter_mut().filter(|area| area.direction == Direction::Inputs);
    areas.for_each(|area| area.image_bit = area.image_bit.saturating_add(bits));
    let variables = whole.image.variables.iter_mut().filter(|it| it.direction == Direction::Inputs);
    variables.for_each(|variable| variable.image_bit = variable.image_bit.saturating_add(bits));
    let reason = format!("an LRW has the outputs before the inputs: the inputs begin at byte {bytes} of their image");
    left_out.push(LeftOut::new(None, "place of the inputs", reason));
}

/// Time limits that an ENI states at the check of AL status, so that each change is waited for.
fn limits(config: &mut SubDeviceConfig) {
    if config.declared.is_none() {
        return;
    }
    let usual = SubDeviceConfig::default();
    for (from, to) in UP.into_iter().chain(OTHERS) {
        let limit = config.limit(from, to);
        let is_stated = config.state_timeouts.iter().any(|it| (it.from, it.to) == (from, to));
        let is_of_boot = (from == AlState::Boot || to == AlState::Boot) && config.declared_bootstrap.is_none();
        if !is_stated && (!is_of_boot || limit != usual.limit(from, to)) {
            config.state_timeouts.push(StateTimeout::new(from, to, limit));
        }
    }
}

/// Cycle and shift of SYNC1 are one register (protocol 7.3), which only an activated SYNC1 has. A SYNC1 without a cycle
/// has that of SYNC0, and a negative shift counts back from the next SYNC0.
fn signals(config: &mut SubDeviceConfig) {
    const SYNC1: u16 = 0x0400;
    let Some(sync) = &mut config.sync else { return };
    if sync.assign_activate & SYNC1 == 0 {
        (sync.sync1_cycle_ns, sync.sync1_shift_ns) = (0, 0);
        return;
    }
    if sync.sync0_cycle_ns > 0 {
        sync.sync1_cycle_ns = sync.sync1_cycle_ns.max(sync.sync0_cycle_ns);
        let cycle = i64::from(sync.sync0_cycle_ns);
        let shift = i64::from(sync.sync1_shift_ns).rem_euclid(cycle);
        sync.sync1_shift_ns = i32::try_from(shift).unwrap_or(sync.sync1_shift_ns);
    }
}

/// The head of a hot connect group has no place (protocol ES-136).
fn heads(whole: &mut Configuration, left_out: &mut Vec<LeftOut>) {
    let mut known = HashSet::new();
    for (index, config) in whole.declaration.subdevices.iter().enumerate() {
        let is_head = config.group.is_some_and(|group| known.insert(group));
        if is_head && whole.subdevices[index].plugged_into.take().is_some() {
            left_out.push(LeftOut::new(Some(index), "plugged_into", "the head of a hot connect group has no place"));
        }
    }
}

/// A station address for each SubDevice without one.
fn stations(whole: &mut Configuration) {
    let mut used: HashSet<u16> = whole.subdevices.iter().filter_map(|facts| facts.station).collect();
    let mut next = FIRST_STATION;
    for facts in &mut whole.subdevices {
        if facts.station.is_some_and(|station| station != 0) {
            continue;
        }
        while !used.insert(next) {
            next = next.wrapping_add(1);
        }
        facts.station = Some(next);
    }
}
