//! SYNC signals of one SubDevice, and waiting until its clock is good enough for them (protocol 7.3).

use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::map;

use super::not_locked::{NotLocked, SignalsError};
use super::set_up::set_up_one;
use super::watch::drift_phase;
use crate::clocks::{extend, first_pulse, start::whole_cycle};
use crate::config::SyncSignals;
use crate::procedures::shared_clocks::{Clocks, HiddenDelay, Node};
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::{Bus, BusError};

/// From the look at the clock to the first pulse at the least (protocol 7.3).
const AHEAD_NS: u64 = 100_000_000;
/// Signals are started when the clock differs by at most this (protocol 7.2: as IgH does).
const GOOD_ENOUGH_NS: u32 = 10_000;
/// A segment that changes all the time is not waited for any longer.
const MEASURING_LIMIT: Duration = Duration::from_secs(1);
/// Pause between two looks.
const PAUSE: Duration = Duration::from_millis(1);

/// Sets up anew what a clock has lost with its power, or what one that came later has never had.
pub(in crate::procedures) async fn restore(bus: &Bus, segment: &SharedSegment, member: usize) -> Result<(), BusError> {
    let Some(index) = index_of(segment, member) else { return Ok(()) };
    // The first clock of a segment begins with the set-up of all, which takes in whoever is there by then.
    let until = bus.now() + MEASURING_LIMIT;
    while !segment.clocks.access().is_set_up {
        if bus.now() >= until {
            return Ok(());
        }
        bus.sleep(PAUSE).await;
    }
    let (station, expected, is_new) = {
        let clocks = segment.clocks.access();
        let node = &clocks.nodes[index];
        (node.station, node.offset_ns, node.unit.is_none())
    };
    let offset: [u8; 4] = bus.fprd_array(station, map::DC_SYSTEM_TIME_OFFSET).await?;
    if u32::from_le_bytes(offset) == expected as u32 && !is_new {
        return Ok(());
    }
    {
        let mut clocks = segment.clocks.access();
        let node = &mut clocks.nodes[index];
        (node.is_unset, node.latches_backwards, node.filter_depths) = (true, false, None);
        if clocks.reference == Some(index) {
            clocks.reference = None;
        }
        clocks.is_doubtful.get_or_insert(bus.now());
    }
    segment.notify();
    // Its place is known when the segment has been measured with it.
    let until = bus.now() + MEASURING_LIMIT;
    while segment.clocks.access().is_doubtful.is_some() && bus.now() < until {
        bus.sleep(PAUSE).await;
    }
    set_up_one(bus, &segment.clocks, index).await?;
    bus.spawn(drift_phase(bus.clone(), segment.clone()));
    Ok(())
}

/// The clock of a member. One that was not there at the scan is added. `None` where those that are known could not be
/// set up yet: whoever is among them is when they are.
fn index_of(segment: &SharedSegment, member: usize) -> Option<usize> {
    let access = segment.view();
    let declared = access.members.get(member)?;
    let info = declared.info.as_ref()?;
    let mut clocks = segment.clocks.access();
    if !info.controller.features.dc {
        return None;
    }
    if let Some(index) = clocks.position_of(member) {
        return clocks.is_set_up.then_some(index);
    }
    clocks.nodes.push(Node::new(info, Some((member, &*declared.config))));
    Some(clocks.nodes.len() - 1)
}

/// Programs the SYNC unit and starts it. The clock must be about right by then.
pub(in crate::procedures) async fn start_signals(
    bus: &Bus,
    segment: &SharedSegment,
    member: usize,
    station: StationAddress,
    signals: &SyncSignals,
    limit: Duration,
) -> Result<(), SignalsError> {
    let [control, activation] = signals.assign_activate.to_le_bytes();
    bus.fpwr(station, map::DC_ACTIVATION, &[0]).await?;
    wait_until_about_right(bus, segment, member, limit).await.map_err(SignalsError::NotLocked)?;
    bus.fpwr(station, map::DC_CYCLIC_UNIT_CONTROL, &[control]).await?;
    let sync1 = if activation & 0x04 != 0 { signals.sync1_register_ns() } else { 0 };
    let mut cycles = [0; 8];
    cycles[..4].copy_from_slice(&signals.sync0_cycle_ns.to_le_bytes());
    cycles[4..].copy_from_slice(&sync1.to_le_bytes());
    bus.fpwr(station, map::DC_SYNC0_CYCLE, &cycles).await?;
    let low = u32::from_le_bytes(bus.fprd_array(station, map::DC_SYSTEM_TIME).await?);
    let near = bus.now().0.wrapping_add(segment.clocks.access().epoch);
    let earliest = extend(low, near).wrapping_add(AHEAD_NS);
    let cycle = whole_cycle(signals.sync0_cycle_ns, sync1);
    let start = first_pulse(earliest, cycle, signals.sync0_shift_ns.into());
    bus.fpwr(station, map::DC_START_TIME, &start.to_le_bytes()).await?;
    Ok(bus.fpwr(station, map::DC_ACTIVATION, &[activation]).await?)
}

async fn wait_until_about_right(
    bus: &Bus,
    segment: &SharedSegment,
    member: usize,
    limit: Duration,
) -> Result<(), NotLocked> {
    let is_right = |clocks: &Clocks| {
        let position = clocks.position_of(member);
        let node = position.and_then(|position| clocks.nodes.get(position));
        let difference = node.and_then(|node| node.difference_ns);
        let near = difference.is_some_and(|ns| ns.unsigned_abs() <= GOOD_ENOUGH_NS);
        (clocks.is_set_up && (near || position == clocks.reference), difference, None, None)
    };
    wait(bus, segment, limit, GOOD_ENOUGH_NS, is_right).await
}

/// Waits until all clocks are locked.
pub(in crate::procedures) async fn wait_for_lock(
    bus: &Bus,
    segment: &SharedSegment,
    member: usize,
) -> Result<(), NotLocked> {
    let (limit, window, samples) = {
        let clocks = segment.clocks.access();
        let Some(config) = &clocks.config else { return Ok(()) };
        (config.lock_limit, config.lock_window_ns, config.lock_samples)
    };
    let is_locked = |clocks: &Clocks| {
        let own = clocks.position_of(member);
        let open = |position: &usize| {
            let node = &clocks.nodes[*position];
            node.has_clock && node.link.is_some() && node.good < samples && Some(*position) != clocks.reference
        };
        // Its own clock first: if that is right, another one keeps all waiting.
        let to_blame = own.filter(open).or_else(|| (0..clocks.nodes.len()).find(open));
        let difference = to_blame.or(own).and_then(|position| clocks.nodes[position].difference_ns);
        let other = to_blame.filter(|index| Some(*index) != own).map(|index| clocks.nodes[index].position);
        // It may become known: a branch is unplugged, or known cables are back.
        let hidden = own.and_then(|index| clocks.hidden(index)).filter(|hidden| !hidden.is_estimated);
        (clocks.is_set_up && to_blame.is_none() && hidden.is_none(), difference, other, hidden)
    };
    wait(bus, segment, limit, window, is_locked).await
}

async fn wait(
    bus: &Bus,
    segment: &SharedSegment,
    limit: Duration,
    window_ns: u32,
    is_good: impl Fn(&Clocks) -> (bool, Option<i32>, Option<u16>, Option<HiddenDelay>),
) -> Result<(), NotLocked> {
    let begin = bus.now();
    loop {
        let (good, difference_ns, other, hidden) = is_good(&segment.clocks.access());
        if good {
            return Ok(());
        }
        if bus.now() >= begin + limit {
            return Err(NotLocked { waited: limit, difference_ns, window_ns, other, hidden });
        }
        bus.sleep(PAUSE).await;
    }
}
