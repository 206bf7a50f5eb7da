//! Content of the three datagrams of the clocks in a copy of a frame, and what comes back in them.

use ringcat_wire::address::{RegisterAddress, StationAddress, Wkc};
use ringcat_wire::datagram::HEADER_LEN;
use ringcat_wire::register::map;

use crate::link::Link;
use crate::time::Instant;

/// Data of each datagram: the low half of a time.
pub(crate) const CLOCK_DATA: usize = 4;
/// Event requests in the header of a datagram.
const IRQ_AT: usize = HEADER_LEN - 2;

/// Offsets of the datagrams' headers in the frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    pub sync_at: usize,
    pub steer_at: usize,
    pub spread_at: usize,
}

/// Content of the datagrams in a copy.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Payload {
    pub(super) sync: Option<(StationAddress, u32)>,
    pub(super) steer: Option<(StationAddress, u32)>,
    /// The differences are read.
    pub monitors: bool,
}

/// Result of the datagrams in the copies of a flight.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    pub sent_at: Instant,
    /// References that it distributed, by number of posts.
    pub references: u32,
    /// It reads the differences.
    pub monitors: bool,
    /// Low half of the distributed time and working counter, by the link on which the copy was sent.
    pub(super) sync: [(u32, Wkc); 2],
    pub(super) spread: u32,
    pub(super) spread_wkc: u16,
    /// Events that SubDevices request, under their mask (protocol 3.5).
    pub(super) events: u16,
}

impl Places {
    /// Writes the content of a copy.
    pub(crate) fn write(&self, bytes: &mut [u8], payload: &Payload) {
        write(bytes, self.sync_at, payload.sync);
        write(bytes, self.steer_at, payload.steer);
        // A read of another register by all has no meaning, and no effect.
        let register = if payload.monitors { map::DC_SYSTEM_TIME_DIFFERENCE } else { RegisterAddress(0) };
        if let Some(bytes) = bytes.get_mut(self.spread_at + 4..self.spread_at + 6) {
            bytes.copy_from_slice(&register.0.to_le_bytes());
        }
    }

    /// Takes the result of a copy.
    pub(crate) fn read(&self, seen: &mut Seen, sent_on: Link, bytes: &[u8]) {
        let (time, wkc) = data_at(bytes, self.sync_at);
        seen.sync[sent_on.index()] = (time, Wkc(wkc));
        let (spread, wkc) = data_at(bytes, self.spread_at);
        seen.spread |= spread & 0x7FFF_FFFF;
        seen.spread_wkc = seen.spread_wkc.saturating_add(wkc);
        if let Some([low, high]) = bytes.get(self.spread_at + IRQ_AT..).and_then(<[u8]>::first_chunk) {
            seen.events |= u16::from_le_bytes([*low, *high]);
        }
    }
}

/// Address and data of a datagram. An unused one addresses no SubDevice, at a register without effect: the command of
/// both copies stays the same.
fn write(bytes: &mut [u8], at: usize, content: Option<(StationAddress, u32)>) {
    let (station, register, data) = match content {
        Some((station, data)) => (station, map::DC_SYSTEM_TIME, data),
        None => (StationAddress(0), RegisterAddress(0), 0),
    };
    if let Some(bytes) = bytes.get_mut(at + 2..at + HEADER_LEN + CLOCK_DATA) {
        bytes[..2].copy_from_slice(&station.0.to_le_bytes());
        bytes[2..4].copy_from_slice(&register.0.to_le_bytes());
        bytes[HEADER_LEN - 2..].copy_from_slice(&data.to_le_bytes());
    }
}

fn data_at(bytes: &[u8], at: usize) -> (u32, u16) {
    match bytes.get(at + HEADER_LEN..).and_then(<[u8]>::first_chunk::<{ CLOCK_DATA + 2 }>) {
        Some([a, b, c, d, low, high]) => (u32::from_le_bytes([*a, *b, *c, *d]), u16::from_le_bytes([*low, *high])),
        None => (0, 0),
    }
}
