//! The last step of a configuration: lays out process data, creates both halves, starts procedures.

pub(super) mod activate_error;
pub(super) mod lay_out;
pub(super) mod lrw;
pub(super) mod obstacles;
pub(super) mod prepare;
pub(super) mod repeats;
pub(super) mod sent_once;

use alloc::boxed::Box;
use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec::Vec;

use ringcat_wire::address::Position;

use super::MainDevice;
use super::active::Active;
use super::declaration::Declaration;
use super::declaration::areas::{Areas, Directory};
use super::declaration::loaded::Loaded;
use super::live_status::LiveStatus;
use crate::board::Board;
use crate::config::ClockConfig;
use crate::declared::SubDeviceId;
use crate::exchange::{ClockSetup, Exchange};
use crate::info::SubDeviceInfo;
use crate::layout::{Layout, Rules};
use crate::procedures::error_statistics::ErrorStatistics;
use crate::procedures::reconcile::reconcile;
use crate::procedures::shared_segment::{SegmentData, SharedSegment};
use crate::queue::{Producer, queue};
use crate::ring_status::{CableErrors, cables};
use crate::segment::clocks::Clocks;
use crate::segment::findings::{DeclarationFinding, SettingFinding};
use crate::segment::{Cabling, Declared, Found, Observation, SubDevices, stations_by_position, type_of};
use crate::time::Instant;
use crate::topology::Topology;
use activate_error::ActivateError;
use lay_out::{LaidOut, lay_out};
use obstacles::replaced;
use prepare::{check_clocks, check_domains, match_declaration, members, plan_all, report_oddities, with_domain};

/// Events of the exchange that may wait to be fetched.
const CYCLIC_EVENTS: usize = 1024;

impl MainDevice {
    /// Lays out process data of a loaded declaration in a session, and creates both halves. No procedure begins.
    pub(super) fn prepare_loaded(
        &mut self,
        loaded: Loaded,
        session: u32,
    ) -> Result<(Active, SharedSegment), ActivateError> {
        let scan = self.found_to_begin().ok_or(ActivateError::NoScan)?;
        let bus = self.supervisor.bus();
        let declaration = with_domain(loaded.declaration.clone());
        let (found, unassigned) = match_declaration(&self.segment, &declaration, &scan)?;
        let topology = loaded.topology((&bus, &self.segment), self.options.junctions, &scan, &found)?;
        check_clocks(&declaration, &found)?;
        let replaced = replaced(&declaration, &found, scan.subdevices.iter().map(|info| &**info));
        let clock_config = declaration.clocks.clone();
        let plans = plan_all(&declaration, &found)?;
        check_domains(&loaded.declaration, &plans)?;
        let LaidOut { specs, layout, .. } = self.lay_out(&declaration, &plans, &found, session)?;
        let repeats = repeats::of_all(&declaration.subdevices, &plans, &found);
        let sends_again: Vec<bool> = declaration.domains.iter().map(|domain| domain.sends_again).collect();
        let members = members(declaration, found, &plans, &layout)?;
        let subdevices = SubDevices::new(members, unassigned);
        let clocks = clocks_of(clock_config.clone(), &scan, &topology, &subdevices);
        let directory = Directory::new(&plans, &layout).with_sent_once(&repeats);
        report_oddities(&self.segment, &subdevices, &layout);
        self.report_reference(replaced);
        let count = subdevices.member_count();
        let board = Arc::new(board_of(&subdevices, &layout));
        let (producer, consumer) = queue(CYCLIC_EVENTS);
        let mut exchange = self.exchange(&layout, board.clone(), producer);
        let repeats = repeats::rules(&repeats);
        exchange.send_lost_frames_again(&layout, &repeats, |domain| sends_again.get(domain.0) == Some(&true));
        #[cfg(feature = "standby")]
        self.set_up_standby(&mut exchange, (&loaded.declaration, &layout, session), &subdevices)
            .map_err(ActivateError::Layout)?;
        set_up_clocks(&mut exchange, clock_config.as_ref());
        let stations = stations_by_position(&subdevices, scan.subdevices.iter().map(|info| info.station));
        let closings = loaded.closings(&topology, &subdevices, &stations);
        let cables = cables(&topology, self.options.links());
        let cables = cables.into_iter().map(|cable| (cable, CableErrors::default())).collect();
        let mailboxes = (0..count).map(|index| self.new_mailbox(SubDeviceId(index))).collect();
        let statistics = ErrorStatistics::new(&bus, count, self.statistics_period);
        let data = SegmentData { mailboxes, cache: self.cache.clone(), statistics };
        let declared = Box::new(Declared {
            subdevices,
            layout,
            cabling: Cabling { topology, stations, types: types_of(&scan), cables, closings, version: 0 },
            clocks,
            ring: self.first_ring_status(),
            carriers: bus.carriers(),
            board: board.clone(),
        });
        let segment = self.segment.with_application(&bus, board.clone(), data);
        segment.observe(Observation::Activated(declared));
        self.supervisor.attach(board);
        self.supervisor.attach_request_counter(self.requests.request_counter().clone());
        self.cyclic_events = Some(consumer);
        let periods = specs.iter().map(|spec| spec.period).collect();
        let under_way = specs.iter().map(|spec| spec.under_way).max().unwrap_or(1);
        let live_status = LiveStatus::of(&segment.board);
        Ok((Active { exchange, directory, periods, under_way, live_status }, segment))
    }

    /// The domains, and the places of their process data.
    fn lay_out(
        &mut self,
        declaration: &Declaration,
        plans: &[Areas],
        found: &[Option<Rc<SubDeviceInfo>>],
        session: u32,
    ) -> Result<LaidOut, ActivateError> {
        let (links, supervision) = (self.options.links(), self.options.supervision);
        let max_datagrams = self.options.most_datagrams();
        let rules = Rules { links, supervision, lrw: declaration.lrw, witnesses: &[], session, max_datagrams };
        let laid_out = lay_out(declaration, plans, found, rules)?;
        #[cfg(feature = "standby")]
        if self.is_lrw_refused(laid_out.lrw) {
            return Err(ActivateError::LrwWithStandby);
        }
        self.memories.check(&laid_out.layout)?;
        #[cfg(feature = "standby")]
        self.check_partner_memory()?;
        Ok(laid_out)
    }

    /// Reports that the SubDevice declared as the reference clock has no clock.
    fn report_reference(&self, replaced: Option<(SubDeviceId, Option<Position>)>) {
        let Some((subdevice, instead)) = replaced else { return };
        let warning = SettingFinding::Reference { instead };
        self.segment.observe(Observation::Compared(DeclarationFinding::SettingFinding(subdevice, warning)));
    }

    /// The cyclic half, with images in memory of the application where it is declared.
    fn exchange(&mut self, layout: &Layout, board: Arc<Board>, events: Producer) -> Exchange {
        let mut exchange = Exchange::new(self.identity, self.options.links(), layout, board, events);
        for (domain, memory) in self.memories.take() {
            exchange.use_memory(domain, memory);
        }
        exchange
    }

    /// Starts the procedures that the model requests.
    pub(super) fn start_reconcile(&mut self, segment: SharedSegment) {
        self.supervisor.spawn(reconcile(self.supervisor.bus(), segment, self.companions()));
    }

    /// Starts configuration, supervision and all other procedures of an active MainDevice.
    pub(super) fn start_procedures(&mut self, segment: SharedSegment) {
        self.start_reconcile(segment.clone());
        segment.observe(Observation::Attached);
        self.statistics = Some(segment.statistics.clone());
        self.segment = segment;
    }

    /// Number of a new session: differs from the previous one, and most probably from that of a program that ran here
    /// recently.
    pub(super) fn next_session(&mut self, now: Instant) -> u32 {
        /// About four seconds.
        const STEP_BITS: u32 = 32;
        self.activations = self.activations.wrapping_add(1);
        (self.activations - 1).wrapping_add((now.0 >> STEP_BITS) as u32)
    }
}

/// Vendor and product code by position.
fn types_of(scan: &Found) -> Vec<Option<(u32, u32)>> {
    scan.subdevices.iter().map(|info| Some(type_of(info))).collect()
}

/// Clocks of all SubDevices of the scan.
fn clocks_of(config: Option<ClockConfig>, scan: &Found, topology: &Topology, subdevices: &SubDevices) -> Clocks {
    let member = |info: &SubDeviceInfo| {
        let index = subdevices.member_of(info.station)?;
        Some((index, &*subdevices.member(index)?.member.config))
    };
    Clocks::new(config, &scan.subdevices, topology, member)
}

/// The board of an application.
fn board_of(subdevices: &SubDevices, layout: &Layout) -> Board {
    let optional = subdevices.members().map(|member| member.config.optional).collect();
    let addresses = subdevices.members().map(|member| member.station).collect();
    let board = Board::new(subdevices.member_count()).with_optional(optional).with_stations(addresses);
    board.with_commands(layout.datagrams())
}

/// Sets up the clocks in the cyclic frames, if there are any.
fn set_up_clocks(exchange: &mut Exchange, config: Option<&ClockConfig>) {
    if let Some(config) = config {
        let ClockConfig { epoch, bus_shift, sync_window_ns, .. } = *config;
        exchange.set_up_clocks(ClockSetup { epoch, bus_shift, sync_window_ns });
    }
}
