//! One of two MainDevices: its engine, its application, and its way to forward.

use ringcat::standby::{
    Active, Class, EngineOptions, Forwarder, NotForwarded, Partner, PartnerEndpoint, RoleControl, RoleRequest,
    StandbyOptions, class_of,
};
use ringcat::{
    Declaration, Direction, Directory, DomainId, Engine, Exchange, Instant, Link, MainDeviceRole, Scan, SubDeviceId,
    TimedEvent,
};
use ringcat_sim::cable::{Host, HostLink};
use ringcat_sim::network::Network;
use ringcat_wire::command::Command;
use ringcat_wire::frame::{Frame, MacAddress};
use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use crate::counting_allocator::counts;

/// Period of the cycles.
pub const CYCLE: Duration = Duration::from_millis(1);

/// The declaration of the application, from what is known of the segment.
pub type Declare = fn(&Scan) -> Declaration;

/// How a controller is set up.
#[derive(Clone, Copy)]
pub struct Settings {
    /// Options of MainDevice redundancy.
    pub standby: StandbyOptions,
    /// Its declaration.
    pub declare: Declare,
}

/// Bytes of outputs in the image of a domain.
type Outputs = Vec<(DomainId, std::ops::Range<usize>)>;

/// The application of a controller.
struct Running {
    exchange: Exchange,
    domains: usize,
    outputs: Outputs,
}

/// A MainDevice.
pub struct Controller {
    host: Host,
    settings: Settings,
    /// Its acyclic half.
    pub engine: Engine,
    /// The endpoint of its Ethernet to the other one, with `max_acyclic`.
    pub endpoint: Option<PartnerEndpoint>,
    control: RoleControl,
    running: Option<Running>,
    forwarder: Forwarder,
    next_cycle: Instant,
    /// It does nothing.
    pub is_dead: bool,
    /// Its application runs no cycles; its acyclic half goes on.
    pub holds_cycles: bool,
    /// Its application writes new outputs: the first byte of each area counts.
    pub writes: bool,
    /// It activates an application after its scan.
    pub activates: bool,
    /// It has scanned, and activates none.
    pub has_scanned: bool,
    /// Cycles that it has run as ACTIVE.
    pub cycles: u64,
    /// When it became ACTIVE last.
    pub changed_at: Option<Instant>,
    /// When it then sent the first frame.
    pub first_frame_at: Option<Instant>,
    /// When it then had complete process data.
    pub first_data_at: Option<Instant>,
    /// Commands and registers that it has written since its role changed, without those in cyclic frames.
    pub written: BTreeSet<(u8, u16)>,
    /// Frames that it has sent as INACTIVE: there must be none.
    pub sent_inactive: u64,
    /// Allocations and deallocations in its cyclic half, in programs that count them.
    pub allocations: u64,
    /// Events since the last mark.
    pub events: Vec<TimedEvent>,
}

impl fmt::Debug for Controller {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Controller").field("host", &self.host).finish_non_exhaustive()
    }
}

/// Addresses of the interfaces of a host.
fn addresses(host: Host) -> [MacAddress; 2] {
    let last = if host == Host::First { 0x11 } else { 0x21 };
    [MacAddress([0, 0, 0x5E, 0, 0x53, last]), MacAddress([0, 0, 0x5E, 0, 0x53, last + 1])]
}

impl Controller {
    pub(super) fn new(host: Host, settings: Settings, now: Instant) -> Controller {
        let [main, redundant] = addresses(host);
        let mut options = EngineOptions::new(main, Some(redundant));
        options.standby = Some(settings.standby);
        let mut engine = Engine::new(options, now);
        Controller {
            endpoint: engine.partner_endpoint(),
            control: engine.role_control(),
            host,
            settings,
            engine,
            running: None,
            forwarder: Forwarder::new(main, redundant),
            next_cycle: Instant::NEVER,
            is_dead: false,
            holds_cycles: false,
            writes: true,
            activates: true,
            has_scanned: false,
            cycles: 0,
            changed_at: None,
            first_frame_at: None,
            first_data_at: None,
            written: BTreeSet::new(),
            sent_inactive: 0,
            allocations: 0,
            events: Vec::new(),
        }
    }

    pub(super) fn begin_anew(&mut self, now: Instant) {
        *self = Controller::new(self.host, self.settings, now);
    }

    /// Becomes ACTIVE without an application, and scans.
    pub fn begin_active(&mut self) {
        self.control.request(RoleRequest::Active);
    }

    /// Requests a role.
    pub fn request(&self, request: RoleRequest) {
        self.control.request(request);
    }

    /// The handle of its role.
    pub fn control(&self) -> &RoleControl {
        &self.control
    }

    /// The cyclic half of its application.
    ///
    /// # Panics
    /// Without an application.
    pub fn exchange(&mut self) -> &mut Exchange {
        &mut self.running.as_mut().expect("it has an application").exchange
    }

    /// Whether it has an application.
    pub fn has_application(&self) -> bool {
        self.running.is_some()
    }

    /// State of the other one.
    pub fn partner(&self) -> Partner {
        self.running.as_ref().map_or(Partner::Absent, |running| running.exchange.partner())
    }

    /// The image of the first domain.
    pub fn image(&self) -> Vec<u8> {
        self.running.as_ref().map(|running| running.exchange.image(DomainId(0)).to_vec()).unwrap_or_default()
    }

    fn links(&self) -> [HostLink; 2] {
        if self.host == Host::First { [HostLink::Main, HostLink::Redundant] } else { HostLink::SECOND }
    }

    /// When it has work, received frames aside.
    pub(super) fn wakes_at(&self) -> Instant {
        if self.is_dead {
            return Instant::NEVER;
        }
        let engine = self.engine.next_deadline().unwrap_or(Instant::NEVER);
        let cycle = if self.running.is_some() && !self.holds_cycles { self.begins_at() } else { Instant::NEVER };
        engine.min(cycle)
    }

    /// When its next cycle begins.
    fn begins_at(&self) -> Instant {
        let inactive = self.running.as_ref().and_then(|running| running.exchange.inactive_begins_at());
        inactive.unwrap_or(self.next_cycle)
    }

    /// Receives, works, sends, and runs a cycle if it is due.
    pub(super) fn work(&mut self, network: &mut Network) {
        if self.is_dead {
            return self.drop_frames(network);
        }
        let now = Instant(network.now().0);
        let carriers = self.links().map(|link| network.carrier(link));
        self.engine.set_carriers(carriers.map(Some));
        self.receive(network, now, carriers);
        self.work_acyclic(network, now);
        self.advance_start();
        if self.running.is_some() && !self.holds_cycles && self.begins_at() <= now {
            self.cycle(network, now);
            self.work_acyclic(network, now);
        }
    }

    fn drop_frames(&mut self, network: &mut Network) {
        for link in self.links() {
            while let Some(received) = network.receive(link) {
                network.give_back(received.bytes);
            }
        }
    }

    fn receive(&mut self, network: &mut Network, now: Instant, carriers: [bool; 2]) {
        for (link, host_link) in Link::ALL.into_iter().zip(self.links()) {
            while let Some(received) = network.receive(host_link) {
                let mut bytes = received.bytes;
                match self.engine.role() {
                    MainDeviceRole::Active => self.take(link, &bytes, now),
                    _ => self.pass_on(network, link, &mut bytes, now, carriers),
                }
                network.give_back(bytes);
            }
        }
    }

    fn take(&mut self, link: Link, bytes: &[u8], now: Instant) {
        match &mut self.running {
            Some(running) if class_of(bytes) != Some(Class::Acyclic) => {
                let before = calls();
                running.exchange.receive(link, bytes, now);
                self.allocations += calls() - before;
            }
            _ => {
                self.engine.receive(link, bytes, now);
            }
        }
    }

    fn pass_on(&mut self, network: &mut Network, link: Link, bytes: &mut [u8], now: Instant, carriers: [bool; 2]) {
        let before = calls();
        if self.forwarder.is_of_another(bytes, now) {
            match &mut self.running {
                Some(running) if class_of(bytes) == Some(Class::Cyclic) => running.exchange.fill(link, bytes, now),
                _ => self.engine.fill(link, bytes, now),
            }
        }
        self.allocations += calls() - before;
        match self.forwarder.forward(bytes, link, carriers, now) {
            Ok(onward) => {
                network.send(self.links()[onward.link.index()], bytes);
                if let Some(running) = &mut self.running {
                    let before = calls();
                    running.exchange.take_forwarded(bytes);
                    self.allocations += calls() - before;
                }
            }
            Err(NotForwarded::Own) => self.engine.take_returned(bytes, now),
            Err(_) => {}
        }
    }

    fn work_acyclic(&mut self, network: &mut Network, now: Instant) {
        self.engine.poll(now);
        let links = self.links();
        let is_inactive = self.engine.role() == MainDeviceRole::Inactive;
        let (mut sent, written) = (0, &mut self.written);
        self.engine.transmit(now, usize::MAX, &mut |link, bytes| {
            sent += 1;
            note_written(bytes, written);
            network.send(links[link.index()], bytes);
        });
        self.sent_inactive += if is_inactive { sent } else { 0 };
        while let Some(event) = self.engine.pop_event(now) {
            self.events.push(event);
        }
    }

    /// The steps to an application: as ACTIVE a scan, as INACTIVE the knowledge of the other one.
    fn advance_start(&mut self) {
        if self.running.is_some() || self.has_scanned {
            return;
        }
        match self.engine.role() {
            MainDeviceRole::Active => match self.engine.scan_result() {
                Some(Ok(_)) if !self.activates => self.has_scanned = true,
                Some(Ok(scan)) => {
                    let active = self.engine.activate((self.settings.declare)(&scan)).expect("the declaration fits");
                    self.run(active);
                }
                Some(Err(error)) => panic!("{error}"),
                None => {
                    // Refused while it runs.
                    let _ = self.engine.start_scan();
                }
            },
            MainDeviceRole::Inactive if self.engine.partner_status().is_known => {
                let knowledge = self.engine.partner_knowledge().expect("it is known");
                let (session, _) = self.engine.partner_configuration().expect("it is known");
                let declaration = (self.settings.declare)(&self.engine.partner_scan().expect("it is known"));
                let active = self.engine.follow(declaration, knowledge, session).expect("the declaration fits");
                self.run(active);
            }
            _ => {}
        }
    }

    fn run(&mut self, active: Active) {
        let Active { exchange, directory, periods, .. } = active;
        let outputs = outputs_of(&directory, self.engine.declared_count());
        self.running = Some(Running { exchange, domains: periods.len(), outputs });
        self.next_cycle = Instant(0);
    }

    /// One cycle.
    fn cycle(&mut self, network: &mut Network, now: Instant) {
        let links = self.links();
        let Some(Running { exchange, domains, outputs }) = &mut self.running else { return };
        let before = calls();
        let changed = exchange.begin_role(now);
        self.allocations += calls() - before;
        if changed == Some(MainDeviceRole::Active) {
            self.next_cycle = exchange.grid_of_other(now).unwrap_or(now + CYCLE);
            (self.changed_at, self.first_frame_at, self.first_data_at) = (Some(now), None, None);
            self.written.clear();
        } else {
            if changed == Some(MainDeviceRole::Inactive) {
                self.forwarder = self.forwarder.after_sending(now);
            }
            self.next_cycle = Instant((self.next_cycle.0 + CYCLE.as_nanos() as u64).max(now.0 + 1));
        }
        let all = (0..*domains).map(DomainId);
        for domain in all.clone() {
            let status = exchange.process(domain, now);
            let is_complete = status.state == ringcat::DomainState::Complete && changed.is_none();
            if self.changed_at.is_some() && is_complete && exchange.role() == MainDeviceRole::Active {
                self.first_data_at.get_or_insert(now);
            }
        }
        if exchange.role() == MainDeviceRole::Active {
            if self.writes {
                for (domain, range) in outputs {
                    let bytes = &mut exchange.image_mut(*domain)[range.clone()];
                    bytes[0] = bytes[0].wrapping_add(1);
                }
            }
            self.cycles += 1;
        }
        let (before, mut of_network) = (calls(), 0);
        all.for_each(|domain| {
            exchange.queue(domain, now);
        });
        let (is_inactive, mut sent) = (exchange.role() == MainDeviceRole::Inactive, 0);
        exchange.send(now, &mut |link, bytes| {
            sent += 1;
            let before = calls();
            network.send(links[link.index()], bytes);
            of_network += calls() - before;
        });
        self.allocations += calls() - before - of_network;
        if sent > 0 && self.changed_at.is_some() {
            self.first_frame_at.get_or_insert(now);
        }
        self.sent_inactive += if is_inactive { sent } else { 0 };
    }
}

/// Allocations and deallocations of this thread so far.
fn calls() -> u64 {
    let counts = counts();
    counts.allocations + counts.deallocations
}

/// Notes the registers that a frame writes.
fn note_written(bytes: &[u8], written: &mut BTreeSet<(u8, u16)>) {
    let Ok(frame) = Frame::parse(bytes) else { return };
    let writes = frame.datagrams().filter(|it| it.header.command.writes());
    let physical = writes.filter(|it| !matches!(it.header.command, Command::Lwr | Command::Lrw));
    written.extend(physical.map(|it| (it.header.command.code(), it.header.ado().0)));
}

fn outputs_of(directory: &Directory, declared: usize) -> Outputs {
    let areas = (0..declared).flat_map(|subdevice| directory.areas(SubDeviceId(subdevice)));
    let outputs = areas.filter(|area| area.direction == Direction::Outputs && area.placed.area.length > 0);
    let range = |start: u32, length: u16| start as usize..start as usize + usize::from(length);
    outputs.map(|area| (area.domain, range(area.placed.image_offset, area.placed.area.length))).collect()
}
