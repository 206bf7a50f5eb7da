//! The four ports: links, loops, order of processing, DL status (protocol 2.1, 2.2, 2.3).
//!
//! Input: link changes and loop settings. Output: the open ports and the content of DL_STATUS. [`super::Controller`]
//! raises events and counts.

use ringcat_wire::register::{LoopControl, PortKind, PortStatus};

use crate::frame::Port;

/// Next port in the order 0-3-1-2.
const NEXT: [Port; 4] = [Port::D, Port::C, Port::A, Port::B];

/// The next port after `port` in the order 0-3-1-2.
pub(super) const fn next(port: Port) -> Port {
    NEXT[port.index()]
}

/// Links and loops.
#[derive(Clone, Debug)]
pub(super) struct Ports {
    usable: [bool; 4],
    link: [bool; 4],
    open: [bool; 4],
    /// The ports that frames pass, one bit each: the open ports, and port 0 as return path if none is open (protocol
    /// 2.2). Cached for every frame.
    passing: u8,
    modes: [LoopControl; 4],
    /// The frame that closed loops by writing DL_CONTROL, and these loops: the frame may still return through them.
    closing: Option<(u64, [bool; 4])>,
    /// Counter of all changes that may change the path of a frame.
    changes: u32,
}

impl Ports {
    pub fn new(kinds: [PortKind; 4]) -> Ports {
        Ports {
            usable: kinds.map(|kind| kind != PortKind::NotImplemented),
            link: [false; 4],
            open: [false; 4],
            passing: 1,
            modes: [LoopControl::Auto; 4],
            closing: None,
            changes: 0,
        }
    }

    /// Removes all links.
    pub fn unplug(&mut self) {
        (self.link, self.open) = ([false; 4], [false; 4]);
        self.note_passing();
    }

    pub fn link(&self, port: Port) -> bool {
        self.link[port.index()]
    }

    /// Sets a link state. Returns whether a lost link is counted: the port was open in mode Auto (protocol 2.5).
    pub fn set_link(&mut self, port: Port, up: bool) -> bool {
        let p = port.index();
        let lost = self.link[p] && !up && self.open[p] && self.modes[p] == LoopControl::Auto;
        self.link[p] = up && self.usable[p];
        self.settle(p, false);
        lost
    }

    /// Sets loop settings written by frame `frame`.
    pub fn set_modes(&mut self, modes: [LoopControl; 4], frame: Option<u64>) {
        let before = self.open;
        self.modes = modes;
        (0..4).for_each(|p| self.settle(p, true));
        let closed = core::array::from_fn(|p| before[p] && !self.open[p]);
        self.closing = frame.map(|frame| (frame, closed));
    }

    /// Opens a port in mode auto-close on which a valid frame arrived (protocol 2.2). Returns whether it opened.
    pub fn reopen(&mut self, port: Port) -> bool {
        let p = port.index();
        let opens = !self.open[p] && self.link[p] && self.modes[p] == LoopControl::AutoClose;
        self.open[p] |= opens;
        self.refresh_passing();
        self.changes = self.changes.wrapping_add(u32::from(opens));
        opens
    }

    fn settle(&mut self, p: usize, rewritten: bool) {
        self.open[p] = self.usable[p]
            && match self.modes[p] {
                LoopControl::Auto => self.link[p],
                LoopControl::AutoClose => self.link[p] && (self.open[p] || rewritten),
                LoopControl::Open => true,
                LoopControl::Closed => false,
            };
        self.note_passing();
    }

    /// Marks paths as changed.
    pub fn note_change(&mut self) {
        self.changes = self.changes.wrapping_add(1);
    }

    fn note_passing(&mut self) {
        self.note_change();
        self.refresh_passing();
    }

    fn refresh_passing(&mut self) {
        let open = (0..4).fold(0, |mask, p| mask | u8::from(self.open[p]) << p);
        self.passing = if open == 0 { 1 } else { open };
    }

    /// Whether the loop is closed according to DL status.
    pub fn loop_closed(&self, port: Port) -> bool {
        !self.open[port.index()]
    }

    /// Whether frames pass the port. Port 0 is the return path if all loops are closed (protocol 2.2).
    pub fn passes(&self, port: Port) -> bool {
        self.passing & 1 << port.index() != 0
    }

    /// Counter of changes: equal counters mean equal paths, except for a frame that closed ports itself.
    pub const fn changes(&self) -> u32 {
        self.changes
    }

    /// The ports that frames pass, one bit each.
    pub const fn passing(&self) -> u8 {
        self.passing
    }

    /// Whether a frame passes the port although its loop is closed: it is the frame that closed the loop and returns.
    pub fn closed_by(&self, port: Port, frame: u64) -> bool {
        self.closing.is_some_and(|(id, closed)| id == frame && closed[port.index()])
    }

    /// Whether the rule for circulating frames applies: port 0 is closed, but not forced closed (protocol 2.4).
    pub fn breaks_circulation(&self) -> bool {
        matches!(self.modes[0], LoopControl::Auto | LoopControl::AutoClose) && !self.passes(Port::A)
    }

    /// The ports according to DL status.
    pub fn status(&self) -> [PortStatus; 4] {
        core::array::from_fn(|p| PortStatus {
            link: self.link[p],
            loop_closed: !self.open[p],
            communication: self.link[p],
        })
    }
}
