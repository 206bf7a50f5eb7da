//! One round of reads: whether the segment is as another process knew it. Nothing is written.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress, Wkc};
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DlStatus, Information, SyncManager, map};

use crate::config::SubDeviceConfig;
use crate::info::{AliasSource, ControllerInfo, SubDeviceInfo};
use crate::mail::InUse;
use crate::plan::{SmPlan, plan};
use crate::ring_status::LinkCounts;
use crate::supervisor::{Bus, BusError, Reply};

/// Registers from TYPE to STATION_ALIAS.
const HEAD: usize = 20;
/// Offset of STATION_ADDRESS, and of STATION_ALIAS, in these.
const STATION_AT: usize = 16;
const ALIAS_AT: usize = 18;
/// AL status, a reserved word, AL status code.
const AL_STATUS: usize = 6;

/// Result of a round.
pub(super) enum Check {
    /// All is as known; by position.
    Same(Vec<Place>),
    /// Something differs.
    Different {
        /// Station addresses that other SubDevices have than were known.
        replaced: Vec<StationAddress>,
        /// SubDevices on each link.
        counts: LinkCounts,
    },
}

/// What was read of the SubDevice at a position.
pub(super) struct Place {
    station: StationAddress,
    alias: u16,
    controller: ControllerInfo,
    dl_status: DlStatus,
    pub status: AlStatus,
    pub code: AlStatusCode,
    /// The first SyncManagers.
    managers: Vec<SyncManager>,
}

impl Place {
    /// The mailbox of a state, if its SyncManagers are set up for it.
    pub(super) fn in_use(&self, info: &SubDeviceInfo, state: AlState) -> Option<InUse> {
        let plan = plan(&SubDeviceConfig::from_info(info), info).ok()?;
        let (pair, layout) = match state {
            AlState::Boot => (&plan.bootstrap, info.bootstrap?),
            AlState::Init | AlState::PreOp | AlState::SafeOp | AlState::Op => (&plan.mailbox, info.mailbox?),
        };
        let [_, send] = &pair[..] else { return None };
        let is_set_up = |planned: &SmPlan| self.manager(planned).is_some_and(|it| is_same(it, &planned.register));
        let is_full = self.manager(send)?.status.mailbox_full;
        let in_use = InUse { station: info.station, layout, send_manager: send.index, is_full };
        pair.iter().all(is_set_up).then_some(in_use)
    }

    fn manager(&self, planned: &SmPlan) -> Option<&SyncManager> {
        self.managers.get(usize::from(planned.index))
    }
}

/// Whether a SyncManager has these addresses and this mode.
fn is_same(read: &SyncManager, planned: &SyncManager) -> bool {
    let facts = |it: &SyncManager| (it.start, it.length, it.control, it.activate.enable);
    facts(read) == facts(planned)
}

/// Compares the segment with the SubDevices that are known, by position.
pub(super) async fn check(
    bus: &Bus,
    known: &[Rc<SubDeviceInfo>],
    alias_source: AliasSource,
) -> Result<Check, BusError> {
    let items: Vec<(u16, u8)> = (0..).zip(known.iter().map(|info| managers_of(info))).collect();
    let reading = bus.gather(items, |bus, (position, managers)| async move { read(&bus, position, managers).await });
    let (places, counted) = bus.both(reading, bus.brd(map::TYPE, 1)).await;
    let counted = counted?;
    let places = places.into_iter().collect::<Result<Vec<Option<Place>>, BusError>>()?;
    let counts = LinkCounts { main: counted.main.0, redundant: counted.redundant.0 };
    let is_as_known = |(place, info): (&Option<Place>, &Rc<SubDeviceInfo>)| {
        let is_it = |place: &Place| is_one(place, info, alias_source) && is_cabled(place, info);
        place.as_ref().is_some_and(is_it)
    };
    if usize::from(counted.wkc().0) == known.len() && places.iter().zip(known).all(is_as_known) {
        return Ok(Check::Same(places.into_iter().flatten().collect()));
    }
    let of = |place: &Place| known.iter().find(|info| info.station == place.station);
    let replaced =
        places.iter().flatten().filter(|place| of(place).is_some_and(|info| !is_one(place, info, alias_source)));
    Ok(Check::Different { replaced: replaced.map(|place| place.station).collect(), counts })
}

/// Whether it is the same SubDevice, by its registers. An alias of the SII is not in them.
fn is_one(place: &Place, info: &SubDeviceInfo, alias_source: AliasSource) -> bool {
    let alias_fits = alias_source == AliasSource::Sii || place.alias == info.alias;
    alias_fits && (place.station, place.controller) == (info.station, info.controller)
}

/// Whether its ports are connected as before.
fn is_cabled(place: &Place, info: &SubDeviceInfo) -> bool {
    place.dl_status.ports == info.dl_status.ports
}

/// Number of SyncManagers that contain those of its mailboxes.
fn managers_of(info: &SubDeviceInfo) -> u8 {
    let of = |has: bool, pair: crate::info::MailboxSyncManagers| {
        if has { pair.written.max(pair.read).saturating_add(1) } else { 0 }
    };
    let preop = of(info.mailbox.is_some(), info.mailbox_sync_managers());
    let boot = of(info.bootstrap.is_some(), info.boot_sync_managers());
    preop.max(boot).min(info.controller.sync_manager_count)
}

/// Reads the SubDevice at a position; `None` if there is none.
async fn read(bus: &Bus, position: u16, managers: u8) -> Result<Option<Place>, BusError> {
    let position = ringcat_wire::address::Position(position);
    let length = SyncManager::LEN * usize::from(managers);
    let registers: [(RegisterAddress, usize); 4] = [
        (map::TYPE, HEAD),
        (map::DL_STATUS, DlStatus::LEN),
        (map::AL_STATUS, AL_STATUS),
        (map::SYNC_MANAGER_BASE, length.max(1)),
    ];
    let wanted = if managers > 0 { 4 } else { 3 };
    let reads = registers.into_iter().take(wanted);
    let reads = reads.map(|(register, length)| (Command::Aprd, Target::Position(position, register), vec![0; length]));
    let replies = bus.transfer_all(reads, Some(Wkc(1))).await?;
    Ok(decode(&replies))
}

fn decode(replies: &[Reply]) -> Option<Place> {
    if replies.iter().any(|reply| reply.wkc() != Wkc(1)) {
        return None;
    }
    let data = |at: usize| replies.get(at).map(|reply| reply.data.as_slice());
    let head = data(0)?;
    let word = |at: usize| Some(u16::from_le_bytes(*head.get(at..)?.first_chunk()?));
    let status = data(2)?;
    let managers = data(3).unwrap_or_default().chunks_exact(SyncManager::LEN);
    Some(Place {
        station: StationAddress(word(STATION_AT)?),
        alias: word(ALIAS_AT)?,
        controller: Information::decode(head.first_chunk()?).into(),
        dl_status: DlStatus::decode(data(1)?.first_chunk()?),
        status: AlStatus::decode(status.first_chunk()?),
        code: AlStatusCode::decode(status.get(4..)?.first_chunk()?),
        managers: managers.filter_map(|bytes| Some(SyncManager::decode(bytes.first_chunk()?))).collect(),
    })
}
