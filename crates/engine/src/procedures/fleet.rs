//! What the procedures know about the declared SubDevices, shared by all of them.

use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell, RefMut};

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::Fmmu;

use super::clocks::SharedClocks;
use super::junction::{End, Told};
use super::mail_watch;
use super::presence;
use super::services::ports::BlockedPort;
use super::services::statistics::Book;
use super::sii::SiiCache;
use super::strangers::Stranger;
use crate::board::Board;
use crate::config::{DeclaredSyncManager, SubDeviceConfig};
use crate::info::{Direction, SubDeviceInfo};
use crate::layout::Layout;
use crate::mail::Mailbox;
use crate::plan::{self, AreaPlan, PlanError, SubDevicePlan};
use crate::ring_status::{Cable, CableErrors, Occupant, RingStatus};
use crate::time::Instant;
use crate::topology::{NodeStatus, Topology};

/// How far a SubDevice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// It does not answer.
    Absent,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It is in its target state.
    Settled(AlState),
}

/// A SubDevice that the application declared.
#[derive(Debug)]
pub struct Member {
    /// The declaration.
    pub config: Rc<SubDeviceConfig>,
    /// The state to which it is brought: that of the declaration, or another one that was requested since.
    pub target: AlState,
    /// Who it is; `None` while it has never been seen.
    pub info: Option<SubDeviceInfo>,
    /// Its station address.
    pub station: StationAddress,
    /// How far it is.
    pub phase: Phase,
    /// Number of the attempt to configure it that is under way; one that is out of date ends.
    pub attempt: u32,
    /// Its registers hold its configuration, FMMUs included, until it loses power or is sent back to INIT.
    pub configured: bool,
    /// Its place in the topology.
    pub node: Option<usize>,
    /// Its configuration, shared with the procedure that applies it.
    pub setup: Option<Rc<Setup>>,
    /// Why it has none though it is there.
    pub unfit: Option<SetupError>,
    /// Its mailbox, in use from PREOP on.
    pub mailbox: Mailbox,
    /// What has happened to it since activation.
    pub incidents: Incidents,
}

/// What has happened to a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Incidents {
    /// How often it was no longer there.
    pub absences: u32,
    /// How often it left its state by itself.
    pub state_changes: u32,
}

impl Member {
    /// Whether it was there at the activation, or has come since.
    pub fn is_there(&self) -> bool {
        self.setup.is_some() || self.unfit.is_some()
    }

    /// A member of which nothing is known but what the scan found.
    pub fn new(
        config: SubDeviceConfig,
        info: Option<SubDeviceInfo>,
        station: StationAddress,
        setup: Option<Rc<Setup>>,
        mailbox: Mailbox,
    ) -> Member {
        let node = info.as_ref().map(|info| usize::from(info.position.0));
        Member {
            target: config.target,
            config: Rc::new(config),
            info,
            station,
            phase: Phase::Absent,
            attempt: 0,
            configured: false,
            node,
            setup,
            unfit: None,
            mailbox,
            incidents: Incidents::default(),
        }
    }
}

/// What has to be written to one SubDevice, complete with logical addresses.
#[derive(Debug)]
pub struct Setup {
    /// Registers and SDOs.
    pub plan: SubDevicePlan,
    /// FMMU number and registers.
    pub fmmus: Vec<(u8, Fmmu)>,
    /// Of these, the number of the one that shows whether there is mail.
    pub mail_fmmu: Option<u8>,
    /// Of these, the number of the one that shows its AL status in the frames of its process data.
    pub presence_fmmu: Option<u8>,
    /// FMMUs that the controller has.
    pub fmmu_count: u8,
    /// SyncManagers that the controller has.
    pub sync_manager_count: u8,
    /// AL control is copied into AL status by hardware.
    pub emulated: bool,
}

/// An area whose size on the SubDevice differs from that in the layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SetupError {
    /// The declaration does not fit the SubDevice.
    Plan(PlanError),
    /// The process image has no place, or another one, for what the SubDevice has.
    Area {
        /// The SyncManager.
        sync_manager: u8,
        /// Bytes in the process image.
        expected: u16,
        /// Bytes of the SubDevice.
        got: u16,
    },
    /// The process image wants its AL status through an FMMU, and of these it has none to spare.
    NoSpareFmmu(u8),
}

impl core::fmt::Display for SetupError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            SetupError::Plan(error) => error.fmt(f),
            SetupError::Area { sync_manager, expected, got } => write!(
                f,
                "SyncManager {sync_manager}: the process image has {expected} bytes for it, the SubDevice {got}"
            ),
            SetupError::NoSpareFmmu(count) => {
                write!(f, "expected an FMMU to spare for the AL status, all {count} are in use")
            }
        }
    }
}

impl core::error::Error for SetupError {}

impl Setup {
    /// Plans a SubDevice and gives its areas the logical addresses of the layout. Areas that no domain holds are
    /// configured without an FMMU.
    pub fn new(
        index: usize,
        config: &SubDeviceConfig,
        info: &SubDeviceInfo,
        layout: &Layout,
    ) -> Result<Setup, SetupError> {
        let plan = plan::plan(config, info).map_err(SetupError::Plan)?;
        let mut fmmus = Vec::new();
        for (number, area) in plan.mapped_areas() {
            let Some((_, placed)) = layout.area(index, area.sync_manager) else { continue };
            if placed.area.length != area.length {
                let (expected, got) = (placed.area.length, area.length);
                return Err(SetupError::Area { sync_manager: area.sync_manager, expected, got });
            }
            fmmus.push((number, plan::fmmu(area, placed.logical)));
        }
        let mail = mail_watch::fmmu(index, &plan, info);
        let mail_fmmu = mail.map(|(number, _)| number);
        fmmus.extend(mail);
        let mut presence_fmmu = None;
        if let Some(logical) = layout.presence(index) {
            let number =
                presence::number(index, &plan, info).ok_or(SetupError::NoSpareFmmu(info.controller.fmmu_count))?;
            fmmus.push((number, presence::fmmu(logical)));
            presence_fmmu = Some(number);
        }
        Ok(Setup {
            plan,
            fmmus,
            mail_fmmu,
            presence_fmmu,
            fmmu_count: info.controller.fmmu_count,
            sync_manager_count: info.controller.sync_manager_count,
            emulated: info.device_emulation,
        })
    }

    /// How many areas have an FMMU.
    pub fn process_data_fmmus(&self) -> usize {
        let others = [self.mail_fmmu, self.presence_fmmu];
        self.fmmus.iter().filter(|(number, _)| !others.contains(&Some(*number))).count()
    }

    /// The FMMU registers from the first to the last one that is used, to be written at once.
    pub fn fmmu_registers(&self) -> Vec<u8> {
        let count = self.fmmus.iter().map(|(number, _)| usize::from(*number) + 1).max().unwrap_or(0);
        let mut registers = alloc::vec![0; Fmmu::LEN * count];
        for (number, fmmu) in &self.fmmus {
            let at = Fmmu::LEN * usize::from(*number);
            registers[at..at + Fmmu::LEN].copy_from_slice(&fmmu.encode());
        }
        registers
    }
}

/// Bytes of the process data areas that a declaration fixes by itself, for a SubDevice that is not there yet.
pub fn declared_areas(config: &SubDeviceConfig) -> Option<Vec<(u8, Direction, u16)>> {
    if let Some(declared) = &config.declared {
        return Some(declared.iter().filter_map(DeclaredSyncManager::area).collect());
    }
    let mut areas = Vec::new();
    for assignment in config.pdos.as_ref()? {
        let mut bits = 0;
        for pdo in &assignment.pdos {
            bits += pdo.entries.as_ref()?.iter().map(|entry| u32::from(entry.bit_length)).sum::<u32>();
        }
        areas.push((assignment.sync_manager, assignment.direction, u16::try_from(bits.div_ceil(8)).ok()?));
    }
    Some(areas)
}

/// Bytes of the process data areas of a plan.
pub fn planned_areas(plan: &SubDevicePlan) -> Vec<(u8, Direction, u16)> {
    plan.process_data.iter().map(|area: &AreaPlan| (area.sync_manager, area.direction, area.length)).collect()
}

/// Station addresses by position: those of members, and at other places what was found there.
pub fn stations_by_position(members: &[Member], found: impl Iterator<Item = StationAddress>) -> Vec<StationAddress> {
    let mut stations: Vec<StationAddress> = found.collect();
    for member in members {
        if let Some(station) = member.node.and_then(|node| stations.get_mut(node)) {
            *station = member.station;
        }
    }
    stations
}

/// Everything that procedures share after activation.
#[derive(Debug)]
pub struct Fleet {
    /// The declared SubDevices.
    pub members: Vec<Member>,
    /// SubDevices that nobody declared, or that are not known to be declared yet.
    pub strangers: Vec<Stranger>,
    /// Number of the next temporary station address.
    pub next_temporary: u16,
    /// Where process data lies.
    pub layout: Layout,
    /// Both ends of the closing cables of all rings behind junctions that were learned or declared, the junction's first:
    /// also those of whom somebody is not there.
    pub closings: Vec<[End; 2]>,
    /// Connections as the scan found them, or a rescan after it.
    pub topology: Topology,
    /// Station addresses by position, as found together with these.
    pub stations: Vec<StationAddress>,
    /// What was told of the ring, counts as they were then; those of now and carriers are added where it is asked for.
    pub ring: RingStatus,
    /// All cables with what their ends have counted.
    pub cables: Vec<(Cable, CableErrors)>,
    /// How often other cables, or others at their ends, were found since.
    pub recablings: u32,
    /// SII contents read before.
    pub cache: SiiCache,
    /// Ports that were closed to cut SubDevices off.
    pub blocked: Vec<BlockedPort>,
    /// What junctions of local rings were told to do about their ports.
    pub(crate) junction_controls: Vec<Told>,
    /// Error counters.
    pub(crate) statistics: Book,
}

impl Fleet {
    /// Who is at each position of the cabling.
    pub fn occupants(&self) -> Vec<Occupant> {
        let declared = |node: usize| self.members.iter().position(|member| member.node == Some(node));
        let at = |(node, station): (usize, &StationAddress)| Occupant { station: *station, declared: declared(node) };
        self.stations.iter().enumerate().map(at).collect()
    }

    /// The one with a station address.
    pub fn occupant(&self, station: StationAddress) -> Occupant {
        Occupant { station, declared: self.members.iter().position(|member| member.station == station) }
    }
}

/// What SubDevices said about their ports, by position in the cabling of that number ([`Fleet::recablings`]).
type Found = (u32, Vec<Option<NodeStatus>>);

/// Shared by all procedures of one MainDevice.
#[derive(Clone, Debug)]
pub struct SharedFleet {
    fleet: Rc<RefCell<Fleet>>,
    /// How often something became known that whoever supervises has to act on.
    news: Rc<Cell<u32>>,
    /// The redundant link is down on our own order.
    controlled_break: Rc<Cell<bool>>,
    /// Before then it is not tried how many datagrams a frame may hold.
    next_frame_trial: Rc<Cell<Instant>>,
    /// Looks into rings behind junctions.
    inside: Rc<Inside>,
    /// Who takes part in process data.
    pub board: Arc<Board>,
    /// Distributed clocks.
    pub clocks: SharedClocks,
}

/// Looks into rings behind junctions that are broken.
#[derive(Debug, Default)]
struct Inside {
    /// One is under way.
    is_looking: Cell<bool>,
    /// How many there were.
    looks: Cell<u32>,
    /// What the last one found, by position, until somebody takes it.
    found: RefCell<Option<Found>>,
}

impl SharedFleet {
    /// Shares a fleet.
    pub fn new(fleet: Fleet, board: Arc<Board>, clocks: SharedClocks) -> SharedFleet {
        SharedFleet {
            fleet: Rc::new(RefCell::new(fleet)),
            news: Rc::default(),
            controlled_break: Rc::default(),
            next_frame_trial: Rc::default(),
            inside: Rc::default(),
            board,
            clocks,
        }
    }

    /// Access between two points at which a procedure waits.
    pub fn access(&self) -> RefMut<'_, Fleet> {
        self.fleet.borrow_mut()
    }

    /// Says whether a ring that opens does so on our own order: that is no break to be told.
    pub(super) fn set_controlled_break(&self, controlled: bool) {
        self.controlled_break.set(controlled);
    }

    /// Whether a ring that opens does so on our own order.
    pub(super) fn is_controlled_break(&self) -> bool {
        self.controlled_break.get()
    }

    /// Before when it is not tried how many datagrams a frame may hold.
    pub(super) fn next_frame_trial(&self) -> Instant {
        self.next_frame_trial.get()
    }

    /// It is not tried again before then.
    pub(super) fn set_next_frame_trial(&self, at: Instant) {
        self.next_frame_trial.set(at);
    }

    /// From now on SubDevices are put out of reach on purpose.
    pub(super) fn begin_to_look_inside(&self) {
        self.inside.is_looking.set(true);
        self.inside.looks.set(self.inside.looks.get().wrapping_add(1));
    }

    /// That is over; what SubDevices said about their ports.
    pub(super) fn end_to_look_inside(&self, found: Found) {
        self.inside.is_looking.set(false);
        *self.inside.found.borrow_mut() = Some(found);
    }

    /// Whether SubDevices are out of reach on purpose, so that silence tells nothing.
    pub(super) fn is_looking_inside(&self) -> bool {
        self.inside.is_looking.get()
    }

    /// How often that was so.
    pub(super) fn looks_inside(&self) -> u32 {
        self.inside.looks.get()
    }

    /// What was found, once, unless the cabling is another one since.
    pub(super) fn take_found_inside(&self) -> Option<Vec<Option<NodeStatus>>> {
        let (recablings, found) = self.inside.found.borrow_mut().take()?;
        (recablings == self.access().recablings).then_some(found)
    }

    /// Tells whoever supervises that there is something to act on.
    pub(crate) fn note_news(&self) {
        self.news.set(self.news.get().wrapping_add(1));
    }

    /// How often there was something to act on.
    pub(super) fn news(&self) -> u32 {
        self.news.get()
    }

    /// Notes how far a SubDevice is.
    pub fn set_phase(&self, index: usize, phase: Phase) {
        if let Some(member) = self.access().members.get_mut(index) {
            member.phase = phase;
        }
    }

    /// Counts what has happened to a SubDevice.
    pub(super) fn count(&self, index: usize, incident: impl FnOnce(&mut Incidents) -> &mut u32) {
        if let Some(member) = self.access().members.get_mut(index) {
            let counter = incident(&mut member.incidents);
            *counter = counter.saturating_add(1);
        }
    }

    /// Notes whether a SubDevice's registers hold its configuration.
    pub fn set_configured(&self, index: usize, configured: bool) {
        if let Some(member) = self.access().members.get_mut(index) {
            member.configured = configured;
        }
    }

    /// Whether a SubDevice's registers hold its configuration.
    pub fn is_configured(&self, index: usize) -> bool {
        self.access().members.get(index).is_some_and(|member| member.configured)
    }

    /// Notes the state to which a SubDevice is to be brought. Returns the one before.
    pub fn set_target(&self, index: usize, target: AlState) -> Option<AlState> {
        self.access().members.get_mut(index).map(|member| core::mem::replace(&mut member.target, target))
    }

    /// Whether a SubDevice's process data flows in a state.
    pub fn exchanges(&self, index: usize, state: AlState) -> bool {
        let access = self.access();
        let setup = access.members.get(index).and_then(|member| member.setup.as_ref());
        let early = || setup.is_none_or(|setup| !setup.plan.is_op_only());
        state == AlState::Op || (state == AlState::SafeOp && early())
    }

    /// The state to which a SubDevice is to be brought.
    pub fn target(&self, index: usize) -> AlState {
        self.access().members.get(index).map_or(AlState::Init, |member| member.target)
    }

    /// Number of the attempt under way.
    pub fn attempt(&self, index: usize) -> u32 {
        self.access().members.get(index).map_or(0, |member| member.attempt)
    }

    /// Begins another attempt, or ends the one that is under way; returns the new number.
    pub fn next_attempt(&self, index: usize) -> u32 {
        self.access().members.get_mut(index).map_or(0, |member| {
            member.attempt = member.attempt.wrapping_add(1);
            member.attempt
        })
    }

    /// A SubDevice's mailbox.
    pub fn mailbox(&self, index: usize) -> Option<Mailbox> {
        self.access().members.get(index).map(|member| member.mailbox.clone())
    }

    /// How far a SubDevice is.
    pub fn phase(&self, index: usize) -> Phase {
        self.access().members.get(index).map_or(Phase::Absent, |member| member.phase)
    }
}
