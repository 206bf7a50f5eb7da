//! Bringing SubDevices back: from an error, from power-off, or for the first time. The others go on meanwhile.

use alloc::rc::Rc;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::AlState;
use ringcat_wire::register::map;

use super::al_state;
use super::configure::{BringUp, ConfigureError, Start};
use super::fleet::{Phase, Setup, SharedFleet};
use super::scan::{ScanError, read_one};
use super::sii::claim_all;
use crate::config::ConfigAddress;
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::supervisor::{Bus, BusError};

/// Pause before the first new attempt to configure a SubDevice; it doubles with every failure.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause between attempts.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// Station addresses for SubDevices that nobody declared, counted down from here.
const STRANGER_STATIONS: u16 = 0xFFFE;

/// Brings a SubDevice to its target state, again and again until it works or it no longer answers.
pub(super) async fn keep_up(bus: Bus, fleet: SharedFleet, index: usize, start: Start) {
    let mut start = start;
    let mut pause = FIRST_PAUSE;
    loop {
        match attempt(&bus, &fleet, index, start).await {
            Ok(state) => {
                fleet.set_phase(index, Phase::Settled(state));
                bus.report(Event::StateReached { subdevice: index, state });
                return;
            }
            Err(ConfigureError::Bus(BusError::Wkc { .. })) => {
                // It does not answer: whoever supervises finds out more.
                lose(&bus, &fleet, index);
                return;
            }
            Err(error) => bus.report(failure(index, &error)),
        }
        start = Start::Unknown;
        bus.sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

/// A SubDevice no longer answers.
pub(super) fn lose(bus: &Bus, fleet: &SharedFleet, index: usize) {
    if fleet.phase(index) != Phase::Absent {
        fleet.set_phase(index, Phase::Absent);
        bus.report(Event::Lost { subdevice: index });
    }
    fleet.board.set_taking_part(index, false);
}

fn failure(index: usize, error: &ConfigureError) -> Event {
    match error {
        ConfigureError::State(al_state::StateError::Refused { requested, status, code }) => {
            Event::StateError { subdevice: index, requested: Some(*requested), status: *status, code: *code }
        }
        error => Event::ConfigurationFailed { subdevice: index, reason: error.to_string() },
    }
}

async fn attempt(bus: &Bus, fleet: &SharedFleet, index: usize, start: Start) -> Result<AlState, ConfigureError> {
    let bring_up = {
        let access = fleet.access();
        let member = access.members.get(index).ok_or(ConfigureError::NoSetup)?;
        let setup = member.setup.clone().ok_or(ConfigureError::NoSetup)?;
        BringUp {
            bus,
            fleet,
            index,
            station: member.station,
            setup,
            timeouts: member.config.timeouts,
            target: member.config.target,
        }
    };
    if start == Start::Unknown && quick(&bring_up).await? {
        return Ok(bring_up.target);
    }
    bring_up.run(start).await?;
    Ok(bring_up.target)
}

/// A SubDevice that only fell from OP to SAFEOP still has its configuration: acknowledged, it may go back to OP.
async fn quick(bring_up: &BringUp<'_>) -> Result<bool, ConfigureError> {
    let BringUp { bus, fleet, index, station, setup, target, timeouts } = bring_up;
    let (status, code) = al_state::read_status(bus, *station).await?;
    if !status.error && status.al_state() == Some(*target) {
        fleet.board.set_taking_part(*index, *target == AlState::SafeOp || *target == AlState::Op);
        return Ok(true);
    }
    if status.al_state() != Some(AlState::SafeOp) || *target != AlState::Op || !fleet.board.takes_part(*index) {
        return Ok(false);
    }
    if status.error {
        bus.report(Event::StateError { subdevice: *index, requested: None, status, code });
        al_state::acknowledge(bus, *station, setup.emulated).await?;
    }
    let limit = timeouts.transition(AlState::SafeOp, AlState::Op);
    Ok(al_state::request(bus, *station, AlState::Op, setup.emulated, limit).await.is_ok())
}

/// A SubDevice that answers but is nobody's: found at a position with an address that is not of a member.
struct Stranger {
    position: Position,
    /// Index of the nearest member before it, and behind it, in the order of positions.
    between: (Option<usize>, Option<usize>),
    info: SubDeviceInfo,
}

/// Finds SubDevices without a known station address among `count` positions, tells which members they are, and starts
/// their configuration.
pub(super) async fn identify(bus: &Bus, fleet: &SharedFleet, main_count: u16, count: u16) -> Result<(), ScanError> {
    let read = bus.gather((0..count).map(Position), |bus, position| async move {
        let bytes = bus.aprd(position, map::STATION_ADDRESS, 2).await?;
        Ok::<_, BusError>(StationAddress(u16::from_le_bytes([bytes[0], bytes[1]])))
    });
    let owners = read.await.into_iter().collect::<Result<Vec<_>, _>>()?;
    let known: Vec<Option<usize>> = {
        let access = fleet.access();
        let member = |station: &StationAddress| access.members.iter().position(|m| m.station == *station);
        owners.iter().map(member).collect()
    };
    for (at, station) in owners.iter().enumerate() {
        if known[at].is_some() || fleet.access().strangers.contains(station) {
            continue;
        }
        let position = Position(at as u16);
        let temporary = next_stranger_station(fleet);
        bus.apwr(position, map::STATION_ADDRESS, &temporary.0.to_le_bytes()).await?;
        claim_all(bus).await?;
        let cache = fleet.access().cache.clone();
        let info = read_one(bus, position, temporary, &cache).await?;
        let between =
            (known[..at].iter().rev().copied().flatten().next(), known[at + 1..].iter().copied().flatten().next());
        let from_main = position.0 < main_count;
        admit(bus, fleet, Stranger { position, between, info }, temporary, from_main).await?;
    }
    Ok(())
}

fn next_stranger_station(fleet: &SharedFleet) -> StationAddress {
    let access = fleet.access();
    let taken = |station: &u16| access.strangers.contains(&StationAddress(*station));
    StationAddress((1..=STRANGER_STATIONS).rev().find(|station| !taken(station)).unwrap_or(STRANGER_STATIONS))
}

/// Gives a stranger the address of the absent member that it is, or notes it as unexpected.
async fn admit(
    bus: &Bus,
    fleet: &SharedFleet,
    stranger: Stranger,
    temporary: StationAddress,
    from_main: bool,
) -> Result<(), BusError> {
    let Some(index) = member_for(fleet, &stranger, from_main) else {
        fleet.access().strangers.push(temporary);
        bus.report(Event::Unexpected { position: stranger.position, identity: stranger.info.identity });
        return Ok(());
    };
    let station = fleet.access().members[index].station;
    bus.fpwr(temporary, map::STATION_ADDRESS, &station.0.to_le_bytes()).await?;
    match adopt(fleet, index, SubDeviceInfo { station, ..stranger.info }) {
        Ok(()) => {
            bus.report(Event::Returned { subdevice: index });
            start(bus, fleet, index, Start::Unknown);
        }
        Err(reason) => bus.report(Event::ConfigurationFailed { subdevice: index, reason }),
    }
    Ok(())
}

fn adopt(fleet: &SharedFleet, index: usize, info: SubDeviceInfo) -> Result<(), String> {
    let mut access = fleet.access();
    let setup = Setup::new(index, &access.members[index].config, &info, &access.layout);
    let setup = setup.map_err(|error| error.to_string())?;
    let member = &mut access.members[index];
    member.setup = Some(Rc::new(setup));
    member.info = Some(info);
    Ok(())
}

/// Starts the configuration of a SubDevice that answers.
pub(super) fn start(bus: &Bus, fleet: &SharedFleet, index: usize, from: Start) {
    fleet.set_phase(index, Phase::Configuring);
    bus.spawn(keep_up(bus.clone(), fleet.clone(), index, from));
}

/// Starts the configuration of all SubDevices that were found.
pub(crate) fn start_all(bus: &Bus, fleet: &SharedFleet, from: Start) {
    let found: Vec<usize> = {
        let access = fleet.access();
        let members = access.members.iter().enumerate();
        members.filter(|(_, member)| member.setup.is_some()).map(|(index, _)| index).collect()
    };
    for index in found {
        start(bus, fleet, index, from);
    }
}

/// The absent member that a stranger is. One with the same serial number wins; else, coming from the main link, the
/// first that fits between its neighbours, and coming from the redundant link the last: a SubDevice can only answer
/// through its neighbours.
fn member_for(fleet: &SharedFleet, stranger: &Stranger, from_main: bool) -> Option<usize> {
    let access = fleet.access();
    let identity = &stranger.info.identity;
    let fits = |index: &usize| {
        let member = &access.members[*index];
        let same_product = member.info.as_ref().is_none_or(|info| {
            (info.identity.vendor_id, info.identity.product_code) == (identity.vendor_id, identity.product_code)
        });
        let same_alias = match member.config.address {
            ConfigAddress::Alias { alias, offset: 0 } if alias != 0 => alias == stranger.info.alias,
            _ => true,
        };
        member.phase == Phase::Absent
            && same_product
            && same_alias
            && member.config.expected.mismatch(identity).is_none()
    };
    let before = stranger.between.0.map_or(0, |index| index + 1);
    let behind = stranger.between.1.unwrap_or(access.members.len()).max(before);
    let candidates: Vec<usize> = (before..behind).filter(fits).collect();
    let same_serial = |index: &&usize| {
        let info = access.members[**index].info.as_ref();
        identity.serial != 0 && info.is_some_and(|info| info.identity.serial == identity.serial)
    };
    let by_serial = candidates.iter().find(same_serial);
    let by_place = if from_main { candidates.first() } else { candidates.last() };
    by_serial.or(by_place).copied()
}
