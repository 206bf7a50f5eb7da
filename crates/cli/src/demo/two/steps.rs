//! The incidents of the demonstration in their order, and the longest time between outputs that each may cause.

use std::time::Duration;

use ringcat::sim::cable::{CableId, Endpoint, Host, HostLink};
use ringcat::sim::network::Network;

/// An incident.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing happens.
    Calm,
    /// The ACTIVE is killed; its guard takes its links down.
    Kill,
    /// The one that was killed is started again.
    Restart,
    /// The ACTIVE hands its role over.
    HandOver,
    /// The same, and a cable is cut meanwhile.
    HandOverAndCut,
    /// The cable is repaired.
    Repair,
    /// The computer of the ACTIVE loses its power.
    PowerOff,
    /// The computer gets its power back, and its program is started.
    PowerOn,
}

/// All of them in their order.
pub const STEPS: [Step; 8] = [
    Step::Calm,
    Step::Kill,
    Step::Restart,
    Step::HandOver,
    Step::HandOverAndCut,
    Step::Repair,
    Step::PowerOff,
    Step::PowerOn,
];

/// Times on which limits depend.
#[derive(Clone, Copy, Debug)]
pub struct Times {
    /// Cycle time.
    pub cycle: Duration,
    /// Cycles without the ACTIVE after which the other one takes over.
    pub time_out_cycles: u32,
    /// The process data of a cycle takes several frames.
    pub several_frames: bool,
}

/// The name of a controller.
pub const fn name(host: Host) -> &'static str {
    match host {
        Host::First => "A",
        Host::Second => "B",
    }
}

impl Step {
    /// One word, for the head of a table.
    pub const fn word(self) -> &'static str {
        match self {
            Step::Calm => "calm",
            Step::Kill => "kill",
            Step::Restart => "start",
            Step::HandOver => "switch",
            Step::HandOverAndCut => "sw+cut",
            Step::Repair => "repair",
            Step::PowerOff => "power-",
            Step::PowerOn => "power+",
        }
    }

    /// Text for people; `active` is ACTIVE when the incident begins.
    pub fn describe(self, active: Host, cable: &str) -> String {
        let (active, other) = (name(active), name(active.other()));
        match self {
            Step::Calm => format!("{active} is ACTIVE, {other} follows and is ready to take over"),
            Step::Kill => format!("killing {active}; its guard takes its links down"),
            Step::Restart => format!("starting {other} again"),
            Step::HandOver => format!("{active} hands its role over to {other}"),
            Step::HandOverAndCut => format!("{active} hands its role over; {cable} is cut meanwhile"),
            Step::Repair => format!("repairing {cable}"),
            Step::PowerOff => format!("the computer of {active} loses its power"),
            Step::PowerOn => format!("the computer of {other} gets its power back and starts its program"),
        }
    }

    /// Whether the role goes to the other controller.
    pub const fn changes_role(self) -> bool {
        matches!(self, Step::Kill | Step::HandOver | Step::HandOverAndCut | Step::PowerOff)
    }

    /// Whether there are two controllers after it.
    pub const fn leaves_two(self) -> bool {
        !matches!(self, Step::Kill | Step::PowerOff)
    }

    /// Whether the ring is closed after it.
    pub const fn leaves_ring(self) -> bool {
        !matches!(self, Step::Kill | Step::HandOverAndCut | Step::PowerOff)
    }

    /// Longest permitted time between outputs (docs/standby.md).
    pub fn limit(self, times: &Times) -> Duration {
        let Times { cycle, time_out_cycles, several_frames } = *times;
        match self {
            // None is missing; the grid of cycles moves when the role does.
            Step::Calm | Step::HandOver => cycle + cycle * 3 / 5,
            // The time-out counts from the last process data, and a cycle of the other one begins after it. If a cycle
            // has several frames, the first one restarts the time-out.
            Step::Kill | Step::PowerOff => cycle * (time_out_cycles + 1 + u32::from(several_frames)),
            // Two are missing at most where a cable is cut or a link comes up.
            Step::Restart | Step::HandOverAndCut | Step::Repair | Step::PowerOn => cycle * 3,
        }
    }
}

/// The cable in the middle of the ring, on its way from the main link of the first host to the redundant link of the
/// second one.
pub fn cable_to_cut(network: &Network) -> Option<CableId> {
    let devices = network.devices().len();
    let node = |end: Endpoint| match end {
        Endpoint::Device(device, _) => device.0,
        Endpoint::Host(link) => devices + link as usize,
    };
    let mut cables_of = vec![Vec::new(); devices + 4];
    for (number, cable) in network.cables().enumerate() {
        let ends = [node(cable.a), node(cable.b)];
        cables_of[ends[0]].push((number, ends[1]));
        cables_of[ends[1]].push((number, ends[0]));
    }
    let (begin, end) = (node(Endpoint::Host(HostLink::Main)), node(Endpoint::Host(HostLink::SecondRedundant)));
    let mut came_by: Vec<Option<(usize, usize)>> = vec![None; devices + 4];
    let mut open = vec![begin];
    while let Some(from) = open.pop() {
        for (cable, to) in &cables_of[from] {
            if came_by[*to].is_none() && *to != begin {
                came_by[*to] = Some((*cable, from));
                open.push(*to);
            }
        }
    }
    let path: Vec<usize> =
        std::iter::successors(came_by[end], |(_, from)| came_by[*from]).map(|(cable, _)| cable).collect();
    path.get(path.len() / 2).copied().map(CableId)
}
