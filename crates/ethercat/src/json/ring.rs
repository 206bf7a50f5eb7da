//! What `ring --json`, `clocks --json`, `events --json` and `record --json` print.

use ringcat_control::message::{CableSnapshot, ClockSnapshot, EventLine, Snapshot};
use serde::Serialize;

use super::values::{Link, List};

/// The ring of a master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Ring<'a> {
    /// Number of the master
    pub master: u32,
    /// Whether the ring is closed; null with one link, and while it is not known
    pub closed: Option<bool>,
    /// Whether a further break leaves all SubDevices reachable; null with one link, and while it is not known
    pub redundant: Option<bool>,
    /// The links: one, or both ends of the ring
    pub links: Vec<RingLink>,
    /// The cable that is broken; null without a break, and while its place is not known
    pub line_break: Option<Cable>,
    /// Every cable with the errors at both its ends, while an application is active; empty without one
    pub cables: List<'a, CableSnapshot, (), CableErrors>,
}

/// A link.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RingLink {
    /// `main` or `redundant`
    pub link: Link,
    /// SubDevices that answer on it
    pub subdevices: u16,
    /// Whether it has a carrier; null where that is not known
    pub carrier: Option<bool>,
}

/// A cable.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Cable {
    /// Its end towards the main interface; null: that interface
    pub near: Option<CableEnd>,
    /// Its other end; null: the redundant interface
    pub far: Option<CableEnd>,
}

/// A cable and its errors.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CableErrors {
    /// Its end towards the main interface; null: that interface
    pub near: Option<CableEnd>,
    /// Its other end; null: the redundant interface
    pub far: Option<CableEnd>,
    /// Damaged frames since the application was activated
    pub damaged_frames: u64,
    /// Lost links since the application was activated
    pub lost_links: u64,
}

/// An end of a cable.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CableEnd {
    /// Position of the SubDevice on the bus, from 0
    pub position: usize,
    /// Number of its port, 0 to 3
    pub port: u8,
}

impl<'a> Ring<'a> {
    /// The ring of a master with this number of links, and SubDevices on each.
    pub fn new(master: u32, state: &'a Snapshot, counts: [u16; 2], links: usize) -> Ring<'a> {
        let ring = &state.ring;
        let is_ring = links >= ring.links.len();
        let mut answering = Vec::new();
        for (place, seen) in ring.links.iter().enumerate().take(links) {
            let link = RingLink { link: Link::of(place > 0), subdevices: counts[place], carrier: seen.carrier };
            answering.push(link);
        }
        Ring {
            master,
            closed: ring.closed.filter(|_| is_ring),
            redundant: ring.redundant.filter(|_| is_ring),
            links: answering,
            line_break: ring.break_at.as_ref().map(|cable| Cable { near: end(cable.near), far: end(cable.far) }),
            cables: List { all: &state.cables, context: (), make: errors },
        }
    }
}

fn end(port: Option<(usize, u8)>) -> Option<CableEnd> {
    port.map(|(position, port)| CableEnd { position, port })
}

fn errors(_: usize, cable: &CableSnapshot, _: ()) -> CableErrors {
    let [damaged_frames, lost_links] = cable.errors;
    CableErrors { near: end(cable.near), far: end(cable.far), damaged_frames, lost_links }
}

/// The clocks of a master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Clocks<'a> {
    /// Number of the master
    pub master: u32,
    /// The distributed clocks; empty where no application uses them
    pub clocks: List<'a, ClockSnapshot, (), Clock>,
}

/// A clock.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Clock {
    /// Position of the SubDevice on the bus, from 0
    pub position: u16,
    /// Propagation delay from the reference clock, in nanoseconds
    pub delay_ns: i64,
    /// Drift towards the reference clock, in parts per billion
    pub drift_ppb: i64,
    /// Difference from the reference clock, in nanoseconds; null before the first measurement
    pub difference_ns: Option<i32>,
    /// The largest difference since the clock was locked, in nanoseconds
    pub largest_ns: u32,
    /// Whether it is the reference clock
    pub reference: bool,
    /// Whether it is locked to the reference clock
    pub locked: bool,
}

impl<'a> Clocks<'a> {
    /// The clocks of a master.
    pub fn new(master: u32, all: &'a [ClockSnapshot]) -> Clocks<'a> {
        Clocks { master, clocks: List { all, context: (), make: Clock::new } }
    }
}

impl Clock {
    fn new(_: usize, clock: &ClockSnapshot, _: ()) -> Clock {
        Clock {
            position: clock.position,
            delay_ns: clock.delay_ns,
            drift_ppb: clock.drift_ppb,
            difference_ns: clock.difference_ns,
            largest_ns: clock.worst_ns,
            reference: clock.is_reference,
            locked: clock.is_locked,
        }
    }
}

/// A file with the last frames.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Record<'a> {
    /// Number of the master
    pub master: u32,
    /// Path of the file, on the host of the daemon
    pub path: &'a str,
    /// Frames in it
    pub frames: u64,
    /// Frames that were not recorded since the recording began, because a queue was full
    pub lost: u64,
}

/// An event.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Event<'a> {
    /// Number of the master
    pub master: u32,
    /// Number of the event; each process that drives the bus begins anew
    pub number: u64,
    /// Time since the host was started, in nanoseconds
    pub time_ns: u64,
    /// The event in words, for people: they may change without a new version
    pub text: &'a str,
}

impl<'a> Event<'a> {
    /// An event of a master.
    pub fn new(master: u32, line: &'a EventLine) -> Event<'a> {
        Event { master, number: line.number, time_ns: line.at_ns, text: &line.text }
    }
}
