//! End of each phase of a start-up, its time with an idle wire, and its number of sequential exchanges.
//!
//! In: a segment. Out: [`Phase`]s from power-on to all in OP, taken from the devices' own registers. In real time the
//! number of sequential exchanges counts as well: each costs a round trip through two hosts.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Application, Error, Instant, Link, Links, MainDevice, Options, Scan, automatic};
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_wire::al::AlState;
use ringcat_wire::frame::MacAddress;
use ringcat_wire::register::map;

/// Limit of the virtual time of a start.
const LIMIT: Duration = Duration::from_secs(20);

/// End of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// All SubDevices have a station address.
    Addressed,
    /// The scan has ended: every SII has been read.
    Scanned,
    /// All SubDevices are in this state or a higher one.
    State(AlState),
}

/// In the order in which they come.
pub const ENDS: [End; 5] =
    [End::Addressed, End::Scanned, End::State(AlState::PreOp), End::State(AlState::SafeOp), End::State(AlState::Op)];

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            End::Addressed => f.pad("addressed"),
            End::Scanned => f.pad("scanned"),
            End::State(state) => f.pad(&state.to_string()),
        }
    }
}

/// A part of a start-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// Its end.
    pub end: End,
    /// Time of the end since power-on.
    pub at: Duration,
    /// Time with an idle wire.
    pub silent: Duration,
    /// Number of frames sent on an idle wire: sequential exchanges.
    pub exchanges: u64,
    /// Sent frames.
    pub frames: u64,
}

/// Brings all SubDevices of a segment to OP in one step ([`MainDevice::bring_up`]).
///
/// # Errors
/// As [`MainDevice::bring_up`].
///
/// # Panics
/// When it takes more than 20 s.
pub fn bring_up(network: Network, options: &Options, period: Duration) -> Result<Vec<Phase>, Error> {
    let links = Watched::new(network);
    let scanned = links.scanned.clone();
    let declare = |scan: &Scan| {
        scanned.set(true);
        automatic(&scan.subdevices, period)
    };
    let application = MainDevice::request(links, options).bring_up(declare)?;
    Ok(until_op(application))
}

/// Scans a segment, declares all of it and cycles until all are in OP.
///
/// # Errors
/// As [`MainDevice::scan`] and [`MainDevice::activate`].
///
/// # Panics
/// When it takes more than 20 s.
pub fn start_up(network: Network, options: &Options, period: Duration) -> Result<Vec<Phase>, Error> {
    let mut main_device = MainDevice::request(Watched::new(network), options);
    let found = main_device.scan()?;
    main_device.links_mut().reach(End::Scanned);
    Ok(until_op(main_device.activate(automatic(&found.subdevices, period))?))
}

fn until_op(mut application: Application<Watched>) -> Vec<Phase> {
    while application.links().phases.len() < ENDS.len() {
        application.cycle(|_| ());
        assert!(application.now() < Instant(0) + LIMIT, "{:?}", application.states());
    }
    application.links().phases.clone()
}

/// Links into a segment that observe wire and devices.
struct Watched {
    segment: SimulatedSegment,
    /// Copies that have not come back.
    under_way: u64,
    silent_since: Instant,
    current: Phase,
    phases: Vec<Phase>,
    /// The application has got the result of the scan.
    scanned: Rc<Cell<bool>>,
}

impl Watched {
    fn new(network: Network) -> Watched {
        let current = Phase { end: ENDS[0], at: Duration::ZERO, silent: Duration::ZERO, exchanges: 0, frames: 0 };
        let segment = SimulatedSegment::new(network);
        Watched {
            silent_since: segment.now(),
            segment,
            under_way: 0,
            current,
            phases: Vec::new(),
            scanned: Rc::default(),
        }
    }

    fn note_silence(&mut self) {
        let now = self.segment.now();
        if self.under_way == 0 {
            self.current.silent += now.since(self.silent_since);
        }
        self.silent_since = now;
    }

    /// Ends the phases up to this one.
    fn reach(&mut self, end: End) {
        if ENDS.get(self.phases.len()) != Some(&end) {
            return;
        }
        self.note_silence();
        let at = Duration::from_nanos(self.segment.now().0);
        self.phases.push(Phase { end, at, ..self.current });
        self.current = Phase { silent: Duration::ZERO, exchanges: 0, frames: 0, ..self.current };
    }

    fn look(&mut self) {
        let Some(&end) = ENDS.get(self.phases.len()) else { return };
        let all = |holds: fn(&Device, u8) -> bool, code| self.segment.network().devices().all(|it| holds(it, code));
        let reached = match end {
            End::Addressed => all(|device, _| device.controller.register(map::STATION_ADDRESS, 2) != [0, 0], 0),
            End::Scanned => self.scanned.get(),
            End::State(state) => all(|device, code| device.al_status().state >= code, state.code()),
        };
        if reached {
            self.reach(end);
        }
    }
}

impl Links for Watched {
    fn now(&self) -> Instant {
        self.segment.now()
    }

    fn addresses(&self) -> ringcat::PerLink<MacAddress> {
        self.segment.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.note_silence();
        self.current.frames += 1;
        self.current.exchanges += u64::from(self.under_way == 0);
        self.under_way += 1;
        self.segment.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        let any = self.segment.receive(take);
        if any {
            self.note_silence();
            self.under_way = self.under_way.saturating_sub(1);
        }
        any
    }

    fn wait(&mut self, until: Instant) {
        self.segment.wait(until);
        self.look();
    }
}
