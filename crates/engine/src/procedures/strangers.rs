//! SubDevices that answer but have no station address of ours: found, looked at, and told which declared SubDevice they
//! are. One that is nobody's keeps a temporary address and is looked at again when a declared one is lost.
//!
//! Each is read by a procedure of its own, so that one whose EEPROM is slow or broken keeps nobody waiting.

mod address;
mod cables;
mod doubles;
mod groups;
mod matching;
mod owners;
mod quiet;
mod recabling;
pub mod rescan;

use alloc::format;
use alloc::rc::Rc;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::map;

pub(super) use self::address::take_away;
pub(super) use self::address::view;
use self::address::{View, give};
use self::doubles::restore;
pub(super) use self::doubles::{Mark, has_identity, mark};
use self::matching::{Fit, assign};
pub(crate) use self::owners::Owners;
use self::owners::{owners_of, ranks};
use super::configure::Start;
use super::fleet::{Fleet, Phase, Setup, SharedFleet};
use super::frame_limit;
use super::recover::start;
use super::scan::{ScanError, read_one};
use crate::config::ConfigAddress;
use crate::event::Event;
use crate::info::SubDeviceInfo;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Pause before an SII that could not be read is read again; it doubles with every failure.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// So long the others of a gap wait for one that is being read.
const HOLD: Duration = Duration::from_secs(1);
/// Searches without success in a row before that is reported.
const PATIENCE: u32 = 100;
/// Searches without success in a row before it is tried whether frames hold too many datagrams.
const DOUBT: u32 = 3;
/// Failures of the bus in a row before they are reported.
const BUS_PATIENCE: u32 = 3;

/// What is known about a stranger.
#[derive(Clone, Debug)]
enum Knowledge {
    /// It is being read since then.
    Reading(Instant),
    /// Its SII cannot be read; this was reported last.
    Unreadable(String),
    /// Who it is, with its temporary address.
    Known(Rc<SubDeviceInfo>),
}

/// A SubDevice that answers but is nobody's yet.
#[derive(Clone, Debug)]
pub struct Stranger {
    /// Its temporary address.
    pub station: StationAddress,
    /// Index of the nearest member before it, and behind it, in the order of positions. Those of groups are left out.
    between: (Option<usize>, Option<usize>),
    /// Index of the member right before it.
    behind: Option<usize>,
    position: Position,
    /// It was met by the copy on the main link.
    from_main: bool,
    /// It was reported as unexpected.
    reported: bool,
    /// It is not known since then which of several members it is.
    held_since: Option<Instant>,
    knowledge: Knowledge,
}

impl Stranger {
    /// A stranger among the owners of all positions, of which the main copy meets the first `main_count`.
    pub(crate) fn new(info: SubDeviceInfo, owners: &Owners, main_count: usize, reported: bool) -> Stranger {
        let (station, at) = (info.station, usize::from(info.position.0));
        Stranger::at(station, at, owners, main_count, reported, Knowledge::Known(Rc::new(info)))
    }

    fn at(
        station: StationAddress,
        at: usize,
        owners: &Owners,
        main_count: usize,
        reported: bool,
        knowledge: Knowledge,
    ) -> Stranger {
        let (between, behind) = (owners.neighbours(at), owners.before(at));
        let position = Position(at as u16);
        let from_main = at < main_count;
        Stranger { station, between, behind, position, from_main, reported, held_since: None, knowledge }
    }

    /// It is known, as well as it will be for now, that it is nobody's.
    pub(super) fn is_settled(&self) -> bool {
        self.reported || matches!(self.knowledge, Knowledge::Unreadable(_))
    }

    /// It is being read, and those around it should wait.
    fn is_awaited(&self, now: Instant) -> bool {
        matches!(self.knowledge, Knowledge::Reading(since) if now.since(since) < HOLD)
    }

    /// The same one at another look.
    fn moved(&self, at: usize, owners: &Owners, main_count: usize) -> Stranger {
        let moved = Stranger::at(self.station, at, owners, main_count, self.reported, self.knowledge.clone());
        Stranger { held_since: self.held_since, ..moved }
    }
}

/// The search for strangers.
#[derive(Debug, Default)]
pub(super) struct Search {
    /// Without success, in a row.
    failures: u32,
}

impl Search {
    /// Finds SubDevices without a known station address, gives them one and begins to read them. True where nobody is
    /// left that is not known.
    pub(super) async fn run(&mut self, bus: &Bus, fleet: &SharedFleet) -> bool {
        let (complete, reason) = match find(bus, fleet).await {
            Ok(complete) => (complete, "SubDevices answer that cannot be told apart".into()),
            Err(error) => (false, error.to_string()),
        };
        if complete {
            self.failures = 0;
            return true;
        }
        self.failures = self.failures.saturating_add(1);
        if self.failures == DOUBT {
            frame_limit::explain(bus, fleet).await;
        }
        if self.failures == PATIENCE {
            bus.report(Event::ScanFailed { reason });
        }
        false
    }
}

/// True where nobody is left that is not known.
async fn find(bus: &Bus, fleet: &SharedFleet) -> Result<bool, BusError> {
    let Some(before) = view(bus).await? else { return Ok(false) };
    let owners = owners_of(fleet, &before.stations);
    let old = unknown(fleet, &before, &owners);
    if old.is_empty() {
        refresh(fleet, &before, &owners);
        return Ok(true);
    }
    // Whoever is given another address is read anew.
    fleet.access().strangers.retain(|stranger| !old.contains(&stranger.station));
    let (given, complete) = give(bus, fleet, &before, &old).await?;
    let Some(mut after) = view(bus).await? else { return Ok(false) };
    restore(bus, fleet, &owners, &before, &mut after).await?;
    let owners = owners_of(fleet, &after.stations);
    refresh(fleet, &after, &owners);
    for station in given {
        let Some(at) = after.position(station) else { continue };
        let knowledge = Knowledge::Reading(bus.now());
        let main_count = usize::from(after.counts.0.0);
        fleet.access().strangers.push(Stranger::at(station, at, &owners, main_count, false, knowledge));
        bus.spawn(read(bus.clone(), fleet.clone(), station));
    }
    Ok(complete && unknown(fleet, &after, &owners).is_empty())
}

/// The station addresses of those that are neither members nor strangers, or that several have.
fn unknown(fleet: &SharedFleet, view: &View, owners: &Owners) -> Vec<StationAddress> {
    let access = fleet.access();
    let mut old = Vec::new();
    for (at, station) in view.stations.iter().enumerate() {
        let is_listed = access.strangers.iter().any(|stranger| stranger.station == *station);
        let is_known = owners.at(at).is_some() || (is_listed && view.position(*station).is_some());
        if !is_known && !old.contains(station) {
            old.push(*station);
        }
    }
    old
}

/// Notes where the strangers are now.
fn refresh(fleet: &SharedFleet, view: &View, owners: &Owners) {
    for stranger in &mut fleet.access().strangers {
        if let Some(at) = view.position(stranger.station) {
            *stranger = stranger.moved(at, owners, usize::from(view.counts.0.0));
        }
    }
}

/// Reads a stranger, again and again until it works or it is a stranger no longer.
async fn read(bus: Bus, fleet: SharedFleet, station: StationAddress) {
    let mut pause = FIRST_PAUSE;
    let mut bus_failures = 0;
    loop {
        let result = read_once(&bus, &fleet, station).await;
        let failed_on_bus = match &result {
            Err(ScanError::Bus(_)) => true,
            Err(ScanError::Sii { error, .. }) => error.is_passing(),
            Ok(_) | Err(_) => false,
        };
        bus_failures = if failed_on_bus { bus_failures + 1 } else { 0 };
        let patient = failed_on_bus && bus_failures < BUS_PATIENCE;
        if !note(&bus, &fleet, station, result, patient) {
            return;
        }
        bus.sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

async fn read_once(bus: &Bus, fleet: &SharedFleet, station: StationAddress) -> Result<SubDeviceInfo, ScanError> {
    quiet::level(bus, station).await?;
    let position = fleet.access().strangers.iter().find(|it| it.station == station).map(|it| it.position);
    let cache = fleet.access().cache.clone();
    read_one(bus, position.unwrap_or_default(), station, &cache).await
}

/// Notes what reading a stranger brought; false where it need not be read again.
fn note(
    bus: &Bus,
    fleet: &SharedFleet,
    station: StationAddress,
    result: Result<SubDeviceInfo, ScanError>,
    patient: bool,
) -> bool {
    let mut access = fleet.access();
    let Some(stranger) = access.strangers.iter_mut().find(|stranger| stranger.station == station) else {
        return false;
    };
    fleet.note_news();
    match result {
        Ok(info) => stranger.knowledge = Knowledge::Known(Rc::new(info)),
        Err(_) if patient => return true,
        Err(error) => {
            let reason = error.to_string();
            if !matches!(&stranger.knowledge, Knowledge::Unreadable(before) if *before == reason) {
                bus.report(Event::ScanFailed { reason: reason.clone() });
                stranger.knowledge = Knowledge::Unreadable(reason);
            }
            return true;
        }
    }
    false
}

/// Tells strangers which absent members they are and starts their configuration. To be called when it is known of all
/// members whether they are there: one that is absent, but not known to be, may be the one that a stranger is.
///
/// False where it could not be found out where they are.
pub(super) async fn admit_all(bus: &Bus, fleet: &SharedFleet) -> bool {
    let Some(told) = find_places(bus, fleet).await else { return false };
    for (stranger, member) in match_all(bus, fleet, &told) {
        let Knowledge::Known(info) = &stranger.knowledge else { continue };
        if let Some(index) = member {
            if admit(bus, fleet, &stranger, info, index).await {
                fleet.access().strangers.retain(|other| other.station != stranger.station);
            }
        } else if note_reported(fleet, stranger.station) {
            bus.report(Event::Unexpected { position: stranger.position, identity: info.identity });
            if let Some(mismatch) = mismatch(fleet, &stranger, info) {
                bus.report(mismatch);
            }
        }
    }
    true
}

/// Looks again where the strangers are, if somebody is missed: since they were found the ring may have opened somewhere
/// else, and of several alike it is the place that tells who is who. Gives back whom cables tell; `None` where the
/// segment changes.
async fn find_places(bus: &Bus, fleet: &SharedFleet) -> Option<Vec<(StationAddress, usize)>> {
    let somebody_is_missed = {
        let access = fleet.access();
        !access.strangers.is_empty() && access.members.iter().any(|member| member.phase == Phase::Absent)
    };
    if !somebody_is_missed {
        return Some(Vec::new());
    }
    let view = view(bus).await.ok()??;
    let owners = owners_of(fleet, &view.stations);
    // One that has come since may be the first of several alike.
    if !unknown(fleet, &view, &owners).is_empty() {
        return None;
    }
    refresh(fleet, &view, &owners);
    cables::members(bus, fleet, &view, &owners).await
}

/// Strangers of whom it is known which absent members they are, or that they are none. `told`: those of whom cables
/// tell it.
fn match_all(bus: &Bus, fleet: &SharedFleet, told: &[(StationAddress, usize)]) -> Vec<(Stranger, Option<usize>)> {
    let mut access = fleet.access();
    let mut strangers = access.strangers.clone();
    strangers.sort_by_key(|stranger| stranger.position);
    let now = bus.now();
    let mut matched = groups::members(&access, &mut strangers, now);
    let by_cable = |stranger: &Stranger| told.iter().find(|(station, _)| *station == stranger.station);
    for (stranger, index) in strangers.iter().filter_map(|it| Some((it, by_cable(it)?.1))) {
        matched.push((stranger.clone(), Some(index)));
    }
    strangers.retain(|stranger| by_cable(stranger).is_none());
    let mut held = Vec::new();
    for gap in strangers.chunk_by(|one, other| one.between == other.between) {
        if gap.iter().any(|stranger| stranger.is_awaited(now)) {
            continue;
        }
        let mut absent = absent_between(&access, gap[0].between);
        absent.retain(|index| told.iter().all(|(_, other)| other != index));
        let from_main: Vec<bool> = gap.iter().map(|stranger| stranger.from_main).collect();
        let fit = |stranger: usize, place: usize| fit(&access, &gap[stranger], absent[place]);
        let places = assign(&from_main, absent.len(), fit);
        for (stranger, place) in gap.iter().zip(places) {
            let member = place.map(|place| absent[place]);
            match member.filter(|index| is_doubtful(&access, stranger, *index, gap, &absent)) {
                Some(index) => held.push((stranger.station, index)),
                None => matched.push((stranger.clone(), member)),
            }
        }
    }
    for (station, index) in held {
        hold(bus, &mut access, station, index, now);
    }
    matched
}

/// It could be another absent member as well: of one kind with several, without a serial number, and not as many of
/// them are there as are missed. Outputs of one must not go to another one.
fn is_doubtful(fleet: &Fleet, stranger: &Stranger, index: usize, gap: &[Stranger], absent: &[usize]) -> bool {
    if fit(fleet, stranger, index) != Fit::Seen {
        return false;
    }
    let alike = |index: &usize| cables::may_be(fleet, stranger, *index);
    let missed = cables::absent(fleet).filter(alike).count();
    let (here, there) =
        (absent.iter().filter(|it| alike(it)).count(), gap.iter().filter(|it| cables::may_be(fleet, it, index)));
    // Where some are crossed in a closed ring, order is another one when it is open.
    missed > 1 && (fleet.topology.is_assumed() || here != missed || there.count() != missed)
}

/// Leaves a stranger alone until it is known which of several it is, and says so when that lasts.
fn hold(bus: &Bus, fleet: &mut Fleet, station: StationAddress, index: usize, now: Instant) {
    let Some(stranger) = fleet.strangers.iter_mut().find(|stranger| stranger.station == station) else { return };
    let since = *stranger.held_since.get_or_insert(now);
    if now.since(since) >= HOLD && !core::mem::replace(&mut stranger.reported, true) {
        let reason = format!(
            "the SubDevice at position {} may be this one or another one of its kind that is missed: no cable tells which, and \
             it has no serial number",
            stranger.position.0
        );
        bus.report(Event::ConfigurationFailed { subdevice: index, reason });
    }
}

/// Absent members between two others, in the order of the segment.
fn absent_between(fleet: &Fleet, between: (Option<usize>, Option<usize>)) -> Vec<usize> {
    let rank = ranks(fleet);
    let mut absent: Vec<usize> = (0..fleet.members.len())
        .filter(|index| fleet.members[*index].phase == Phase::Absent && fleet.members[*index].config.group.is_none())
        .filter(|index| between.0.is_none_or(|before| rank[before] < rank[*index]))
        .filter(|index| between.1.is_none_or(|behind| rank[*index] < rank[behind]))
        .collect();
    absent.sort_by_key(|index| rank[*index]);
    absent
}

/// How well a stranger fits an absent member.
fn fit(fleet: &Fleet, stranger: &Stranger, index: usize) -> Fit {
    let member = &fleet.members[index];
    let Knowledge::Known(info) = &stranger.knowledge else { return Fit::Unreadable };
    let identity = &info.identity;
    let mark_fits = match member.config.address {
        address @ (ConfigAddress::Alias { offset: 0, .. } | ConfigAddress::Identification { offset: 0, .. }) => {
            matches!(address, ConfigAddress::Alias { alias: 0, .. }) || address.is_borne_by(info)
        }
        ConfigAddress::Alias { .. } | ConfigAddress::Identification { .. } | ConfigAddress::Position(_) => true,
    };
    if !mark_fits || member.config.expected.mismatch(info).is_some() {
        return Fit::No;
    }
    let Some(known) = member.info.as_ref().map(|info| info.identity) else { return Fit::NeverSeen };
    if (known.vendor_id, known.product_code) != (identity.vendor_id, identity.product_code) {
        Fit::No
    } else if identity.serial != 0 && identity.serial == known.serial {
        Fit::Serial
    } else {
        Fit::Seen
    }
}

/// Where a stranger is in the place of the one absent member that belongs there: what differs.
fn mismatch(fleet: &SharedFleet, stranger: &Stranger, info: &SubDeviceInfo) -> Option<Event> {
    let access = fleet.access();
    let [subdevice] = absent_between(&access, stranger.between)[..] else { return None };
    let (field, expected, got) = access.members.get(subdevice)?.config.expected.mismatch(info)?;
    Some(Event::Mismatch { subdevice, position: stranger.position, field, expected, got })
}

/// Makes a stranger the member it is; true where it is a stranger no longer.
async fn admit(bus: &Bus, fleet: &SharedFleet, stranger: &Stranger, info: &SubDeviceInfo, index: usize) -> bool {
    let (info, setup) = {
        let access = fleet.access();
        let member = &access.members[index];
        let mut info = SubDeviceInfo { station: member.station, position: stranger.position, ..info.clone() };
        if let Some(known) = &member.info {
            info.keep_read_online(known);
        }
        let setup = Setup::new(index, &member.config, &info, &access.layout);
        (info, setup)
    };
    let setup = match setup {
        Ok(setup) => setup,
        Err(error) => {
            if note_reported(fleet, stranger.station) {
                bus.report(Event::ConfigurationFailed { subdevice: index, reason: error.to_string() });
            }
            return false;
        }
    };
    let written = bus.fpwr(stranger.station, map::STATION_ADDRESS, &info.station.0.to_le_bytes()).await;
    // The reply to the first try may have been lost, and then the old address answers no more.
    if written.is_err() && bus.fprd(info.station, map::STATION_ADDRESS, 2).await.is_err() {
        return false;
    }
    {
        let access = &mut *fleet.access();
        recabling::take_place(bus, access, stranger.station, index);
        let member = &mut access.members[index];
        member.setup = Some(Rc::new(setup));
        member.unfit = None;
        member.info = Some(info);
        member.configured = false;
    }
    bus.report(Event::Returned { subdevice: index });
    // Whatever state it is in, it is not one that we brought it to.
    start(bus, fleet, index, Start::Doubtful, None);
    true
}

/// Notes that a stranger was reported; false where it was before.
fn note_reported(fleet: &SharedFleet, station: StationAddress) -> bool {
    let mut access = fleet.access();
    let Some(stranger) = access.strangers.iter_mut().find(|stranger| stranger.station == station) else {
        return false;
    };
    !core::mem::replace(&mut stranger.reported, true)
}
