//! What `master --json` prints. The text is made of it too.

use ringcat_control::tool::{LinkReport, MasterReport, Traffic, TrafficRate};
use serde::Serialize;

use super::values::Link;
use crate::hex;

/// Seconds over which rates are measured.
pub const SECONDS: [u32; 3] = [1, 10, 60];

/// A master.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Master<'a> {
    /// Number of the master
    pub master: u32,
    /// `waiting` for its interfaces, `idle`, or `operation` while an application is active
    pub phase: Phase,
    /// Whether an application is active
    pub active: bool,
    /// SubDevices that the last scan has found
    pub subdevices: u32,
    /// Its links with their frames; empty while it waits for its interfaces
    pub devices: Vec<Device>,
    /// Interfaces that it waits for; empty while it is driven
    pub awaited_interfaces: Vec<&'a str>,
    /// Frames of all links together; null while it waits for its interfaces
    pub common: Option<Frames>,
    /// Position of the reference clock; null where there is none
    pub reference_clock: Option<u16>,
    /// Time of the reference clock that was read last, in nanoseconds since 2000-01-01; 0 if none was
    pub reference_time_ns: u64,
    /// Time of the application, in nanoseconds since 2000-01-01; 0 if none is active
    pub application_time_ns: u64,
}

/// What a master does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// It has no interface.
    Waiting,
    /// The daemon drives it.
    Idle,
    /// An application is active.
    Operation,
}

/// A link.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Device {
    /// `main` or `redundant`
    pub link: Link,
    /// MAC address of the interface
    pub mac_address: String,
    /// Whether it has a carrier; null where that is not known
    pub carrier: Option<bool>,
    /// Frames that the kernel could not send; 0 on a simulated segment
    pub send_errors: u64,
    /// Its frames
    pub frames: Frames,
}

/// Frames.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Frames {
    /// Frames that were sent
    pub sent_frames: u64,
    /// Their length, in bytes
    pub sent_bytes: u64,
    /// Of these, frames that came back
    pub received_frames: u64,
    /// Their length, in bytes
    pub received_bytes: u64,
    /// Of these, frames that did not come back
    pub lost_frames: u64,
    /// Rates over the last 1 s, 10 s and 60 s
    pub rates: [Rate; 3],
}

/// Rates over a time.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Rate {
    /// The time in seconds: 1, 10 or 60
    pub over_s: u32,
    /// Frames sent per second
    pub sent_frames_per_s: f64,
    /// Bytes sent per second
    pub sent_bytes_per_s: f64,
    /// Frames received per second
    pub received_frames_per_s: f64,
    /// Bytes received per second
    pub received_bytes_per_s: f64,
    /// Frames lost per second
    pub lost_frames_per_s: f64,
}

impl<'a> Master<'a> {
    /// A master at these interfaces; without a report it waits for them. `errors`: frames that an interface could not
    /// send.
    pub fn new(
        master: u32,
        interfaces: Vec<&'a str>,
        report: Option<&MasterReport>,
        errors: impl Fn(&str) -> u64,
    ) -> Master<'a> {
        let waiting = MasterReport { is_orphaned: true, ..MasterReport::default() };
        let known = report.unwrap_or(&waiting);
        let phase = match (known.is_active, known.is_orphaned) {
            (true, _) => Phase::Operation,
            (false, true) => Phase::Waiting,
            (false, false) => Phase::Idle,
        };
        let device = |(at, report): (usize, &LinkReport)| Device {
            link: Link::of(at > 0),
            mac_address: hex::mac(&report.mac),
            carrier: report.carrier,
            send_errors: interfaces.get(at).map_or(0, |name| errors(name)),
            frames: frames(&report.traffic),
        };
        Master {
            master,
            phase,
            active: known.is_active,
            subdevices: known.subdevices,
            devices: known.links.iter().enumerate().map(device).collect(),
            common: report.map(|report| frames(&sum(&report.links))),
            reference_clock: known.reference,
            reference_time_ns: known.reference_time_ns,
            application_time_ns: known.application_time_ns,
            awaited_interfaces: if report.is_none() { interfaces } else { Vec::new() },
        }
    }
}

fn frames(traffic: &Traffic) -> Frames {
    let rate = |at: usize| {
        let TrafficRate { frames_per_s, bytes_per_s, lost_per_s, lost_bytes_per_s } = traffic.rates[at];
        Rate {
            over_s: SECONDS[at],
            sent_frames_per_s: frames_per_s,
            sent_bytes_per_s: bytes_per_s,
            received_frames_per_s: (frames_per_s - lost_per_s).max(0.0),
            received_bytes_per_s: (bytes_per_s - lost_bytes_per_s).max(0.0),
            lost_frames_per_s: lost_per_s,
        }
    };
    Frames {
        sent_frames: traffic.frames,
        sent_bytes: traffic.bytes,
        received_frames: traffic.frames.saturating_sub(traffic.lost),
        received_bytes: traffic.bytes.saturating_sub(traffic.lost_bytes),
        lost_frames: traffic.lost,
        rates: [0, 1, 2].map(rate),
    }
}

/// The traffic of all links together.
fn sum(all: &[LinkReport]) -> Traffic {
    let mut sum = Traffic::default();
    for one in all.iter().map(|link| &link.traffic) {
        sum.frames += one.frames;
        sum.bytes += one.bytes;
        sum.lost += one.lost;
        sum.lost_bytes += one.lost_bytes;
        for (sum, one) in sum.rates.iter_mut().zip(&one.rates) {
            sum.frames_per_s += one.frames_per_s;
            sum.bytes_per_s += one.bytes_per_s;
            sum.lost_per_s += one.lost_per_s;
            sum.lost_bytes_per_s += one.lost_bytes_per_s;
        }
    }
    sum
}
