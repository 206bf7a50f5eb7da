//! The path of frames through a segment without other events, computed once for the fast path.
//!
//! Hop by hop ([`super::traffic`]) a frame costs the same at every device, even if it only passes by on its way back.
//! If cables and ports do not change, all frames of an interface take the same path, and the devices whose processing
//! units they pass are known in advance.

use ringcat_wire::command::Command;
use ringcat_wire::register::map;

use crate::cable::LegId;
use crate::frame::{Fcs, FrameKind, SimFrame};
use crate::time::SimTime;

/// The arrival of a frame at the end of a leg.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hop {
    pub(super) leg: LegId,
    /// Time since the frame entered the first device.
    pub(super) after_ns: u64,
}

/// A hop that needs processing: the first one into a device, or one through its processing unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// Index among the hops.
    pub(super) hop: u32,
    pub(super) device: u32,
    /// The ports of the device are unchanged while this counter is equal.
    pub(super) port_changes: u32,
    pub(super) processed: bool,
}

/// The path of frames from an interface of the MainDevice.
#[derive(Debug, Default)]
pub(super) struct Route {
    /// State of the wiring for which it was computed; `None` if there is no path, or it must be computed again.
    pub(super) wiring: Option<u32>,
    /// Frames with a first bit after this time are not affected by earlier events.
    pub(super) since: SimTime,
    /// All hops, including the hop into the interface at the end.
    pub(super) hops: Vec<Hop>,
    pub(super) stops: Vec<Stop>,
}

impl Route {
    /// Marks the route for a new computation, if the ports of a device have changed.
    pub(super) fn refuse(&mut self, changed: bool) {
        if changed {
            self.wiring = None;
        }
    }

    pub(super) fn length_ns(&self) -> u64 {
        self.hops.last().map_or(0, |hop| hop.after_ns)
    }
}

/// Whether a frame changes no ports and latches no receive times: it writes no register by physical address. (If it can
/// do so through FMMUs, there is no [`InternalPath`](crate::controller::InternalPath).)
pub(super) fn leaves_paths_unchanged(frame: &SimFrame) -> bool {
    let harmless = |header: &[u8]| {
        let address = u16::from_le_bytes([header[4], header[5]]);
        match Command::from_code(header[0]) {
            Command::Nop | Command::Aprd | Command::Fprd | Command::Brd => true,
            Command::Lrd | Command::Lwr | Command::Lrw => true,
            Command::Apwr | Command::Fpwr | Command::Bwr => address >= map::USER_RAM.0,
            Command::Armw | Command::Frmw => address == map::DC_SYSTEM_TIME.0,
            Command::Aprw | Command::Fprw | Command::Brw | Command::Reserved(_) => false,
        }
    };
    let datagrams = || {
        frame.datagrams.iter().map(|place| {
            let header = usize::from(place.header);
            frame.bytes.get(header..header + 6)
        })
    };
    frame.kind == FrameKind::Datagrams
        && frame.fcs == Fcs::Good
        && !frame.malformed
        && datagrams().all(|header| header.is_some_and(harmless))
}
