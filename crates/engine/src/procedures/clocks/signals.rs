//! SYNC signals of one SubDevice, and the wait until its clock is accurate enough for them (protocol 7.3).

use alloc::string::ToString;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::map;

use super::not_locked::{NotLocked, SignalsError};
use super::set_up::set_up_one;
use crate::clocks::{extend, first_pulse, start::whole_cycle};
use crate::config::{PulseGrid, SyncSignals};
use crate::info::SubDeviceInfo;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::clocks::{ClockFinding, ClockObservation, Clocks, Node};
use crate::supervisor::{Bus, BusError};

/// Minimum time from the read of the clock to the first pulse (protocol 7.3).
const AHEAD_NS: u64 = 100_000_000;
/// Largest difference of the clock at which signals are started (protocol 7.2: as IgH does).
const GOOD_ENOUGH_NS: u32 = 10_000;
/// Maximum wait for the first application time, if the grid of the pulses begins with it.
const GIVEN_LIMIT: Duration = Duration::from_secs(1);
/// Maximum wait for the measurement of a segment that changes repeatedly.
const MEASURING_LIMIT: Duration = Duration::from_secs(1);

/// Sets up a clock that has lost its registers with its power, or was added later.
pub(in crate::procedures) async fn restore(bus: &Bus, segment: &SharedSegment, member: usize) -> Result<(), BusError> {
    let Some(station) = clock_of(segment, member) else { return Ok(()) };
    // The first clock of a segment starts the set-up of all, which includes each SubDevice that answers by then.
    let are_set_up = segment.until(|segment| segment.clocks().are_set_up().then_some(()));
    if bus.within(MEASURING_LIMIT, are_set_up).await.is_err() {
        return Ok(());
    }
    let known = |node: &Node| (node.key(), node.offset_ns);
    let Some((key, written_ns)) = segment.view().clocks().node_at(station).map(known) else { return Ok(()) };
    let versions = segment.view().clock_versions();
    let read = u32::from_le_bytes(bus.fprd_array(station, map::DC_SYSTEM_TIME_OFFSET).await?);
    segment.find_of_clocks(versions, ClockFinding::OffsetRead { key, written_ns, read });
    if !segment.view().clocks().node_at(station).is_some_and(|node| node.is_unset) {
        return Ok(());
    }
    // Its delay is known when the segment has been measured with it. The wait is limited for a segment that changes
    // repeatedly.
    let measured = segment.until(|segment| segment.clocks().doubtful_since().is_none().then_some(()));
    let _ = bus.within(MEASURING_LIMIT, measured).await;
    set_up_one(bus, segment, station).await?;
    segment.observe_clocks(ClockObservation::TimeWanted);
    Ok(())
}

/// The clock of a member; a clock that was not found by the scan is added. `None` if the known clocks are not set up
/// yet: their set-up includes it.
fn clock_of(segment: &SharedSegment, member: usize) -> Option<StationAddress> {
    let has_clock = |info: &SubDeviceInfo| info.controller.features.dc;
    {
        let view = segment.view();
        view.member(member)?.info.filter(|info| has_clock(info))?;
        if let Some(node) = view.clocks().of_member(member) {
            return view.clocks().are_set_up().then_some(node.station);
        }
    }
    segment.observe_clocks(ClockObservation::Came { member });
    segment.view().clocks().of_member(member).map(|node| node.station)
}

/// Programs the SYNC unit and starts it. Before, it waits until the clock is approximately right. True if the SubDevice
/// continues with a clock that is not; then the wait ends at the time limit of the lock at the latest.
pub(in crate::procedures) async fn start_signals(
    bus: &Bus,
    segment: &SharedSegment,
    (member, attempt): (usize, u32),
    station: StationAddress,
    signals: &SyncSignals,
    limit: Duration,
) -> Result<bool, SignalsError> {
    let limit = match segment.view().clocks() {
        clocks if clocks.goes_on_unlocked(false) => limit.min(clocks.config.lock_limit),
        _ => limit,
    };
    let key = segment.view().clocks().node_at(station).map(Node::key);
    let are_starting = |are_starting: bool| {
        key.into_iter().for_each(|key| segment.observe_clocks(ClockObservation::Signals { key, are_starting }));
    };
    let [control, activation] = signals.assign_activate.to_le_bytes();
    bus.fpwr(station, map::DC_ACTIVATION, &[0]).await?;
    are_starting(false);
    let result = wait_until_about_right(bus, segment, member, limit).await;
    let goes_on = or_go_on(segment, (member, attempt), result).map_err(SignalsError::NotLocked)?;
    until_time_is_given(bus, segment).await;
    bus.fpwr(station, map::DC_CYCLIC_UNIT_CONTROL, &[control]).await?;
    let sync1 = signals.active_sync1_ns();
    let mut cycles = [0; 8];
    cycles[..4].copy_from_slice(&signals.sync0_cycle_ns.to_le_bytes());
    cycles[4..].copy_from_slice(&sync1.to_le_bytes());
    bus.fpwr(station, map::DC_SYNC0_CYCLE, &cycles).await?;
    // From now on the system time does not jump.
    segment.until(|segment| (!segment.clocks().are_offsets_due()).then_some(())).await;
    are_starting(true);
    let low = u32::from_le_bytes(bus.fprd_array(station, map::DC_SYSTEM_TIME).await?);
    let near = bus.now().0.wrapping_add(segment.view().clocks().epoch);
    let earliest = extend(low, near).wrapping_add(AHEAD_NS);
    let cycle = whole_cycle(signals.sync0_cycle_ns, sync1);
    let start = first_pulse(earliest, cycle, i64::from(signals.sync0_shift_ns) + grid_ns(segment, cycle));
    bus.fpwr(station, map::DC_START_TIME, &start.to_le_bytes()).await?;
    bus.fpwr(station, map::DC_ACTIVATION, &[activation]).await?;
    Ok(goes_on)
}

/// Waits for the first application time if the grid of the pulses begins with it: signals that start before this time
/// is set would have another grid than later ones.
async fn until_time_is_given(bus: &Bus, segment: &SharedSegment) {
    let until = bus.now() + GIVEN_LIMIT;
    let begins_with_it = segment.view().clocks().config.pulse_grid == PulseGrid::FirstApplicationTime;
    while begins_with_it && bus.now() < until {
        let posted = bus.posted();
        if segment.board.clocks.times.first().is_some() {
            return;
        }
        segment.until_posted(posted, until, || false).await;
    }
}

/// Nanoseconds between the multiples of a cycle in system time and the grid of the pulses.
fn grid_ns(segment: &SharedSegment, cycle: u64) -> i64 {
    let begin = match segment.view().clocks().config.pulse_grid {
        PulseGrid::SystemTime => None,
        PulseGrid::FirstApplicationTime => segment.board.clocks.times.first(),
    };
    // The system time may have been far behind the application's, or before it.
    let shift = segment.view().clocks().shift() as i64;
    let phase = |begin: u64| (i128::from(begin) - i128::from(shift)).checked_rem_euclid(i128::from(cycle));
    begin.and_then(phase).map_or(0, |ns| ns as i64)
}

/// What follows from clocks that are not locked in time: the model decides whether the member goes on, and reports it.
/// True if it continues without a locked clock.
fn or_go_on(
    segment: &SharedSegment,
    (member, attempt): (usize, u32),
    result: Result<(), NotLocked>,
) -> Result<bool, NotLocked> {
    let Err(not_locked) = result else { return Ok(false) };
    let (reason, is_hidden) = (not_locked.to_string(), not_locked.hidden.is_some());
    let versions = segment.view().clock_versions();
    segment.find_of_clocks(versions, ClockFinding::NotLocked { member, attempt, reason, is_hidden });
    if segment.view().clocks().goes_on_unlocked(is_hidden) { Ok(true) } else { Err(not_locked) }
}

async fn wait_until_about_right(
    bus: &Bus,
    segment: &SharedSegment,
    member: usize,
    limit: Duration,
) -> Result<(), NotLocked> {
    let check = |clocks: &Clocks| {
        let node = clocks.of_member(member);
        let difference_ns = node.and_then(|node| node.difference_ns);
        let is_near = difference_ns.is_some_and(|ns| ns.unsigned_abs() <= GOOD_ENOUGH_NS);
        let is_right = clocks.are_set_up() && (is_near || node.map(|node| node.station) == clocks.reference);
        let hidden = node.and_then(|node| clocks.hidden(node)).filter(|hidden| !hidden.is_estimated);
        let lack = NotLocked { waited: limit, difference_ns, window_ns: GOOD_ENOUGH_NS, other: None, hidden };
        if is_right { Ok(()) } else { Err(lack) }
    };
    wait(bus, segment, limit, check).await
}

/// Waits until all required clocks are locked, or until the SubDevice continues without them.
pub(in crate::procedures) async fn wait_for_lock(
    bus: &Bus,
    segment: &SharedSegment,
    (member, attempt): (usize, u32),
) -> Result<(), NotLocked> {
    let (limit, window_ns, samples) = {
        let view = segment.view();
        if !view.clocks().are_declared() {
            return Ok(());
        }
        let config = &view.clocks().config;
        (config.lock_limit, config.lock_window_ns, config.lock_samples)
    };
    let check = |clocks: &Clocks| {
        let own = clocks.of_member(member);
        let is_open = |node: &&Node| clocks.is_waited_for(node) && node.good < samples && !clocks.is_reference(node);
        // Its own clock first: if that is right, another clock is the cause of the wait.
        let at_fault = own.filter(is_open).or_else(|| clocks.nodes.iter().find(is_open));
        let difference_ns = at_fault.or(own).and_then(|node| node.difference_ns);
        let is_other = |node: &&Node| node.member != Some(member);
        let other = at_fault.filter(is_other).map(|node| node.position);
        // The delay may become known: a branch is unplugged, or known cables are back.
        let hidden = own.and_then(|node| clocks.hidden(node)).filter(|hidden| !hidden.is_estimated);
        let is_locked = clocks.are_set_up() && at_fault.is_none() && hidden.is_none();
        if is_locked { Ok(()) } else { Err(NotLocked { waited: limit, difference_ns, window_ns, other, hidden }) }
    };
    let result = wait(bus, segment, limit, check).await;
    or_go_on(segment, (member, attempt), result).map(drop)
}

/// Waits until clocks pass a check; the error is the result of the check at the time limit.
async fn wait(
    bus: &Bus,
    segment: &SharedSegment,
    limit: Duration,
    check: impl Fn(&Clocks) -> Result<(), NotLocked>,
) -> Result<(), NotLocked> {
    let passed = segment.until(|segment| check(segment.clocks()).ok());
    if bus.within(limit, passed).await.is_ok() {
        return Ok(());
    }
    check(segment.view().clocks())
}
