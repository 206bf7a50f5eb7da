//! The processing unit (EPU): effects on a passing frame (protocol 1.4, 1.5, 2.4, 2.6).
//!
//! Input: a frame and the times at which its first and last bit arrived. Output: the frame with data, working counters,
//! ADP, event bits and marks according to its commands, or its destruction. The FCS at the end of the frame determines
//! whether writes to registers and buffers take effect.

use core::mem;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::CIRCULATING;
use ringcat_wire::register::map;

use super::Controller;
use super::event_bits::{EVENT_AL_STATUS, EVENT_DL_STATUS};
use super::fmmu::{Direction, Piece};
use super::logical_log::{LogicalAccess, marks};
use super::memory::Side;
use super::pass::Pass;
use crate::frame::{DatagramPlace, Fcs, FrameKind, SimFrame, UDP_CHECKSUM, is_udp};
use crate::time::SimTime;

/// Bit in the first byte of the source address that a processing unit sets (protocol 2.6).
const PROCESSED: u8 = 0x02;
/// Offset of the source address.
const SOURCE: usize = 6;
/// Offset of the high byte of the length field in a datagram header, with the C bit.
const LENGTH_HIGH: usize = 7;
const CIRCULATING_HIGH: u8 = (CIRCULATING >> 8) as u8;

impl Controller {
    /// Processes a frame. Returns whether it is forwarded.
    pub(super) fn process(&mut self, frame: &mut SimFrame, first_bit: SimTime, now: SimTime) -> bool {
        let rule = self.forwarding_rule;
        if frame.malformed {
            self.memory.count(map::EPU_ERROR_COUNTER);
        }
        match frame.kind {
            FrameKind::Datagrams => {}
            FrameKind::OtherEthercat => {
                mark_processed(frame, rule);
                return true;
            }
            FrameKind::Foreign if rule => {
                if !frame.malformed {
                    self.memory.count(map::EPU_ERROR_COUNTER);
                }
                return false;
            }
            FrameKind::Foreign => return true,
        }
        if self.ports.breaks_circulation() && !self.mark_circulating(frame) {
            return false;
        }
        self.pass.begin(frame.id, first_bit);
        self.clear_sii_write_enable();
        let SimFrame { bytes, datagrams, .. } = &mut *frame;
        for place in datagrams.iter() {
            self.datagram(bytes, *place);
        }
        mark_processed(frame, rule);
        let is_good = frame.fcs == Fcs::Good && !frame.malformed;
        self.logical_log.end_frame(is_good);
        if !self.pass.is_idle() {
            self.finish_frame(is_good, now);
        }
        true
    }

    /// Sets the C bit in every datagram; `false` if a datagram had it already or there is no datagram (protocol 2.4).
    fn mark_circulating(&mut self, frame: &mut SimFrame) -> bool {
        let SimFrame { bytes, datagrams, .. } = frame;
        let field = |place: &DatagramPlace| usize::from(place.header) + LENGTH_HIGH;
        let circulates = |place| bytes.get(field(place)).is_some_and(|high| high & CIRCULATING_HIGH != 0);
        if datagrams.is_empty() {
            // The remnant of a truncated frame; it is counted already.
            return false;
        }
        if datagrams.iter().any(circulates) {
            self.memory.count(map::EPU_ERROR_COUNTER);
            return false;
        }
        for place in datagrams.iter() {
            if let Some(high) = bytes.get_mut(field(place)) {
                *high |= CIRCULATING_HIGH;
            }
        }
        true
    }

    fn datagram(&mut self, bytes: &mut [u8], place: DatagramPlace) {
        let marks = self.logical_log.is_on().then(|| marks(bytes));
        let Some(datagram) = bytes.get_mut(usize::from(place.header)..place.end()) else { return };
        let (header, rest) = datagram.split_at_mut(place.data() - usize::from(place.header));
        let (data, wkc) = rest.split_at_mut(usize::from(place.length));
        if self.irq != 0 {
            let irq = u16::from_le_bytes([header[8], header[9]]) | self.irq;
            header[8..10].copy_from_slice(&irq.to_le_bytes());
        }
        let command = Command::from_code(header[0]);
        let added = match command {
            Command::Nop | Command::Reserved(_) => return,
            Command::Fprd | Command::Fpwr | Command::Fprw | Command::Frmw => {
                let matches = self.is_addressed(u16::from_le_bytes([header[2], header[3]]));
                self.physical(command, matches, ado(header), data)
            }
            Command::Lrd | Command::Lwr | Command::Lrw => {
                let address = u32::from_le_bytes([header[2], header[3], header[4], header[5]]);
                let added = self.logical(command, address, data);
                if let Some((identity, frame_id)) = marks {
                    let frame = (frame_id, header[1]);
                    self.log_access(identity, frame, command, (address, added), data);
                }
                added
            }
            Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw => {
                let adp = u16::from_le_bytes([header[2], header[3]]);
                header[2..4].copy_from_slice(&adp.wrapping_add(1).to_le_bytes());
                self.physical(command, adp == 0, ado(header), data)
            }
            Command::Brd | Command::Bwr | Command::Brw => {
                let adp = u16::from_le_bytes([header[2], header[3]]);
                header[2..4].copy_from_slice(&adp.wrapping_add(1).to_le_bytes());
                self.physical(command, true, ado(header), data)
            }
        };
        if added != 0 {
            let sum = u16::from_le_bytes([wkc[0], wkc[1]]).wrapping_add(added);
            wkc.copy_from_slice(&sum.to_le_bytes());
        }
    }

    fn is_addressed(&self, adp: u16) -> bool {
        adp == self.station || (self.alias_enabled && adp == self.memory.u16(map::STATION_ALIAS))
    }

    /// A command with a physical address. Returns the increment of the working counter.
    fn physical(&mut self, command: Command, matches: bool, ado: RegisterAddress, data: &mut [u8]) -> u16 {
        let at = u32::from(ado.0);
        let multiple = matches!(command, Command::Armw | Command::Frmw);
        if !matches && !multiple {
            return 0;
        }
        match command {
            Command::Aprw | Command::Fprw | Command::Brw => self.read_write(command, ado, data),
            Command::Apwr | Command::Fpwr | Command::Bwr => {
                let written = self.write(Side::Ecat, at, data, 0xFF) > 0;
                self.pass.latches |= written && command != Command::Apwr && self.latches(at, data);
                u16::from(written)
            }
            _ if multiple && !matches => u16::from(self.write(Side::Ecat, at, data, 0xFF) > 0),
            _ => {
                let combine = command == Command::Brd;
                u16::from(self.read_register(at, data, combine) || self.read(Side::Ecat, at, data, combine) > 0)
            }
        }
    }

    /// Whether a BWR or FPWR to this address latches the receive times: it writes their first byte (protocol 3.12).
    fn latches(&self, at: u32, data: &[u8]) -> bool {
        let target = u32::from(map::DC_RECEIVE_TIME.0);
        at <= target && target < at + data.len() as u32 && self.config.features.dc
    }

    /// Writes the old value to the datagram and the received data to the memory, at a separate offset.
    fn read_write(&mut self, command: Command, ado: RegisterAddress, data: &mut [u8]) -> u16 {
        if self.config.features.brw_unsupported {
            return 0;
        }
        self.pass.keep_incoming(data);
        let read = self.read(Side::Ecat, ado.0.into(), data, command == Command::Brw) > 0;
        let target = ado.offset(self.memory.u16(map::PHYSICAL_OFFSET));
        let incoming = mem::take(&mut self.pass.incoming);
        let written = self.write(Side::Ecat, target.0.into(), &incoming, 0xFF) > 0;
        self.pass.incoming = incoming;
        u16::from(read) + 2 * u16::from(written)
    }

    /// A command with a logical address. Returns the increment of the working counter.
    fn logical(&mut self, command: Command, address: u32, data: &mut [u8]) -> u16 {
        let first = u64::from(address) * 8;
        let end = first + data.len() as u64 * 8;
        if !self.fmmus.concern(first, end) || (command == Command::Lrw && self.config.features.lrw_unsupported) {
            return 0;
        }
        if let Some((read, written)) = self.logical_compiled(command, address, data) {
            return match command {
                Command::Lwr => u16::from(written),
                _ => u16::from(read) + 2 * u16::from(written),
            };
        }
        if command == Command::Lrw && self.fmmus.both_ways() {
            self.pass.keep_incoming(data);
            let read = self.logical_read(first, end, data);
            let incoming = mem::take(&mut self.pass.incoming);
            let written = self.logical_write(first, end, &incoming);
            self.pass.incoming = incoming;
            return u16::from(read) + 2 * u16::from(written);
        }
        let read = command.reads() && self.logical_read(first, end, data);
        let written = command.writes() && self.logical_write(first, end, data);
        match command {
            Command::Lwr => u16::from(written),
            _ => u16::from(read) + 2 * u16::from(written),
        }
    }

    fn log_access(
        &mut self,
        identity: [u8; 3],
        frame: (u8, u8),
        command: Command,
        (address, added): (u32, u16),
        data: &[u8],
    ) {
        let moved = self.logical_log.take_moved();
        if added == 0 {
            return;
        }
        let (read, written) = match command {
            Command::Lwr => (false, true),
            _ => (added & 1 != 0, added & 2 != 0),
        };
        let (at, data) = (self.pass.start, data.to_vec());
        let is_valid = false;
        let access = LogicalAccess { at, identity, frame, command, address, read, written, is_valid, data, moved };
        self.logical_log.note(access);
    }

    fn log_moved(&mut self, piece: Piece, first: u64, write: bool) {
        let (begin, end) = (piece.logical - first, piece.logical - first + piece.len);
        self.logical_log.moved((begin / 8) as usize, (end.div_ceil(8) - begin / 8) as usize, write);
    }

    fn logical_read(&mut self, first: u64, end: u64, data: &mut [u8]) -> bool {
        let mut any = false;
        for n in 0..self.fmmus.count() {
            let mut from = first;
            while let Some(piece) = self.fmmus.piece(n, Direction::Read, from, end) {
                if self.read_bits(piece, first, data) {
                    any = true;
                    self.log_moved(piece, first, false);
                }
                from = piece.logical + piece.len;
            }
        }
        any
    }

    fn logical_write(&mut self, first: u64, end: u64, data: &[u8]) -> bool {
        let mut any = false;
        for n in 0..self.fmmus.count() {
            let mut from = first;
            while let Some(piece) = self.fmmus.piece(n, Direction::Write, from, end) {
                if self.write_bits(piece, first, data) {
                    any = true;
                    self.log_moved(piece, first, true);
                }
                from = piece.logical + piece.len;
            }
        }
        any
    }

    /// End of a frame: its effects are applied or discarded.
    fn finish_frame(&mut self, good: bool, now: SimTime) {
        let mut left = self.pass.sync_managers;
        while left != 0 {
            let n = left.trailing_zeros() as usize;
            left &= left - 1;
            let completion = self.sync_managers.finish_frame(n, good);
            if completion.triggers_watchdog {
                self.trigger_process_data_watchdog(now);
            }
            if completion.is_complete {
                self.note_buffer_event(map::DC_ECAT_BUFFER_CHANGE, self.pass.start);
            }
            self.refresh_sync_manager(n);
        }
        if good {
            if self.pass.read_dl_status {
                self.clear_ecat_event(EVENT_DL_STATUS);
            }
            if self.pass.read_al_status {
                self.clear_ecat_event(EVENT_AL_STATUS);
            }
            if self.pass.latches {
                self.latch_receive_times(self.pass.frame, self.pass.start);
            }
            if !self.pass.writes.is_empty() {
                self.apply_writes(now);
            }
        }
        self.pass.clear();
    }

    /// Applies the register writes of the frame in the order of its datagrams, then the SII command among them.
    fn apply_writes(&mut self, now: SimTime) {
        let mut pass = mem::replace(&mut self.pass, Pass::new());
        self.pass.start = pass.start;
        let mut at = 0;
        for &(address, len) in &pass.writes {
            let bytes = &pass.bytes[at..at + usize::from(len)];
            self.apply(Side::Ecat, address.into(), bytes, now, Some(pass.frame));
            at += usize::from(len);
        }
        pass.clear();
        self.pass = pass;
        self.run_sii_command(Side::Ecat, now);
        self.schedule();
    }
}

fn ado(header: &[u8]) -> RegisterAddress {
    RegisterAddress(u16::from_le_bytes([header[4], header[5]]))
}

/// Marks of the processing unit outside of datagrams: source address bit and cleared UDP checksum.
fn mark_processed(frame: &mut SimFrame, rule: bool) {
    if rule && let Some(byte) = frame.bytes.get_mut(SOURCE) {
        *byte |= PROCESSED;
    }
    if is_udp(&frame.bytes)
        && let Some(checksum) = frame.bytes.get_mut(UDP_CHECKSUM..UDP_CHECKSUM + 2)
    {
        checksum.fill(0);
    }
}
