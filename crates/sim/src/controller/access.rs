//! Reads and writes of address ranges by either side (protocol 1.4, 2.5, 3.2, 3.8, 3.11).
//!
//! Input: a side, an address, bytes. Output: the number of accessible bytes; missing or blocked bytes change nothing
//! (protocol 1.4). EtherCAT's register writes and SyncManager accesses go into the [`super::pass::Pass`] and take
//! effect at the end of the frame; RAM is written at once.

use core::mem;

use ringcat_wire::register::map;

use super::Controller;
use super::event_bits::{EVENT_AL_CONTROL, EVENT_PROCESS_DATA_WATCHDOG, EVENT_SYNC_MANAGER_ACTIVATION};
use super::fmmu::Piece;
use super::memory::{Side, USER_RAM};
use super::pass::Pass;
use super::sync_manager::Claim;

/// End of the 64 KiB address space.
const ADDRESS_END: u32 = 0x1_0000;
/// First address that a SyncManager can cover: digital outputs.
const SYNC_MANAGER_AREA: u32 = map::DIGITAL_OUTPUTS.0 as u32;
/// The register in which FMMUs can write single bits (protocol 3.10).
const BITWISE: core::ops::Range<u32> = SYNC_MANAGER_AREA..SYNC_MANAGER_AREA + 4;
/// Registers blocked while the SII interface is busy (protocol 3.8).
const SII_BLOCK: core::ops::Range<u32> = map::SII_CONTROL.0 as u32..map::SII_CONTROL.0 as u32 + 14;

/// A part of an access: it ends at `until`; its bytes are at `address` if the access is allowed.
struct Part {
    until: u32,
    address: Option<u32>,
}

impl Controller {
    /// Reads into `out`, or combines by OR. Returns the number of accessible bytes.
    pub(super) fn read(&mut self, side: Side, address: u32, out: &mut [u8], or: bool) -> usize {
        let end = (address + out.len() as u32).min(ADDRESS_END);
        let (mut at, mut count) = (address, 0);
        while at < end {
            let part = self.part(side, false, at, end);
            if let Some(from) = part.address {
                let len = (part.until - at) as usize;
                let target = &mut out[(at - address) as usize..(part.until - address) as usize];
                let bytes = self.memory.span(from, len);
                if or {
                    target.iter_mut().zip(bytes).for_each(|(target, byte)| *target |= byte);
                } else {
                    target.copy_from_slice(bytes);
                }
                count += len;
            }
            at = part.until;
        }
        count
    }

    /// [`Controller::read`] by EtherCAT for bytes inside one register that always exists and is no time: the case of
    /// nearly all reads. False in all other cases.
    #[inline]
    pub(super) fn read_register(&mut self, address: u32, out: &mut [u8], or: bool) -> bool {
        const END: u32 = map::FMMU_BASE.0 as u32;
        let end = address + out.len() as u32;
        if end > END || out.is_empty() {
            return false;
        }
        let run = self.memory.run(address, Side::Ecat);
        if !run.exists || end > run.end {
            return false;
        }
        let reads = |register: ringcat_wire::address::RegisterAddress| {
            address < u32::from(register.0) + 2 && u32::from(register.0) < end
        };
        self.pass.read_dl_status |= reads(map::DL_STATUS);
        self.pass.read_al_status |= reads(map::AL_STATUS);
        let bytes = self.memory.span(address, out.len());
        if or {
            out.iter_mut().zip(bytes).for_each(|(out, byte)| *out |= byte);
        } else {
            out.copy_from_slice(bytes);
        }
        true
    }

    /// Writes `data`. If `mask` is not 0xFF, only its bits are written (in [`BITWISE`]; elsewhere the other bits become
    /// 0). Returns the number of accessible bytes.
    pub(super) fn write(&mut self, side: Side, address: u32, data: &[u8], mask: u8) -> usize {
        let end = (address + data.len() as u32).min(ADDRESS_END);
        let (mut at, mut count) = (address, 0);
        while at < end {
            let part = self.part(side, true, at, end);
            if let Some(to) = part.address {
                let bytes = &data[(at - address) as usize..(part.until - address) as usize];
                self.put(side, to, bytes, mask);
                count += bytes.len();
            }
            at = part.until;
        }
        count
    }

    fn put(&mut self, side: Side, address: u32, bytes: &[u8], mask: u8) {
        let mask = if BITWISE.contains(&address) { mask } else { 0xFF };
        if address >= USER_RAM {
            self.memory.store(address, bytes);
            return;
        }
        match side {
            Side::Ecat => {
                self.note_ecat_write(address);
                self.pass.write(address, bytes, mask);
            }
            Side::Pdi => {
                let mut pass = mem::replace(&mut self.pass, Pass::new());
                pass.clear();
                pass.write(address, bytes, mask);
                self.pass.start = pass.start;
                self.apply(Side::Pdi, address, &pass.bytes, pass.start, None);
                pass.clear();
                self.pass = pass;
            }
        }
    }

    /// Effects of a write before the end of its frame.
    fn note_ecat_write(&mut self, address: u32) {
        if address == map::REGISTER_WRITE_ENABLE.0.into() {
            self.pass.register_write_enable = true;
        } else if address == map::ESC_WRITE_ENABLE.0.into() {
            self.pass.esc_write_enable = true;
        }
    }

    /// The longest part from `at` with equal access rights.
    fn part(&mut self, side: Side, write: bool, at: u32, end: u32) -> Part {
        let run = self.memory.run(at, side);
        let mut until = run.end.min(end);
        let allowed = if write { run.writable && !self.write_blocked(side, at) } else { run.exists };
        if !allowed {
            return Part { until, address: None };
        }
        if at < SYNC_MANAGER_AREA {
            if !write {
                self.note_read(side, at, until);
            }
            return Part { until, address: Some(at) };
        }
        match self.sync_managers.claim(at, until) {
            Claim::Free(free) => Part { until: free, address: Some(at) },
            Claim::Locked(locked) => Part { until: locked.min(until), address: None },
            Claim::Area(n, area_end) => {
                until = area_end.min(until);
                Part { until, address: self.sync_manager_access(n, side, write, at, until) }
            }
        }
    }

    fn sync_manager_access(&mut self, n: usize, side: Side, write: bool, at: u32, until: u32) -> Option<u32> {
        let kept_back =
            side == Side::Pdi && !write && self.sync_managers.guarded(n) && !self.process_data_watchdog.ok();
        if kept_back {
            return None;
        }
        let grant = self.sync_managers.access(n, side, write, at, until)?;
        // Buffers beyond the RAM do not exist.
        let fits = grant.address + (until - at) <= self.memory.len();
        match side {
            Side::Ecat => self.pass.sync_managers |= 1 << n,
            Side::Pdi => {
                let completion = self.sync_managers.finish_pdi(n, write, grant);
                if completion.triggers_watchdog {
                    self.trigger_process_data_watchdog(self.pass.start);
                }
                if grant.opened {
                    self.note_buffer_event(map::DC_PDI_BUFFER_START, self.pass.start);
                }
                if completion.is_complete {
                    self.note_buffer_event(map::DC_PDI_BUFFER_CHANGE, self.pass.start);
                }
                self.refresh_sync_manager(n);
            }
        }
        fits.then_some(grant.address)
    }

    /// Write protection (protocol 3.2) and the state of the SII interface (protocol 3.8).
    fn write_blocked(&self, side: Side, at: u32) -> bool {
        if SII_BLOCK.contains(&at) && !self.sii_writable(side) {
            return true;
        }
        if side == Side::Pdi || at == map::ESC_WRITE_ENABLE.0.into() {
            return false;
        }
        let protection = |address| self.memory.u8(address) & 1 != 0;
        if protection(map::ESC_WRITE_PROTECTION) && !self.pass.esc_write_enable {
            return true;
        }
        at < USER_RAM
            && at != map::REGISTER_WRITE_ENABLE.0.into()
            && protection(map::REGISTER_WRITE_PROTECTION)
            && !self.pass.register_write_enable
    }

    /// Side effects of register reads, and registers computed on reads. A part contains at most one of them.
    fn note_read(&mut self, side: Side, at: u32, until: u32) {
        let reads = |address: ringcat_wire::address::RegisterAddress, len: u32| {
            at < u32::from(address.0) + len && u32::from(address.0) < until
        };
        if at >= u32::from(map::DC_RECEIVE_TIME.0) && at < u32::from(map::PRODUCT_ID.0) {
            self.clock_read(side, at, until);
        }
        match side {
            Side::Ecat => {
                self.pass.read_dl_status |= reads(map::DL_STATUS, 2);
                self.pass.read_al_status |= reads(map::AL_STATUS, 2);
            }
            Side::Pdi => {
                if reads(map::AL_CONTROL, 1) {
                    self.clear_al_event(EVENT_AL_CONTROL);
                }
                if reads(map::WATCHDOG_STATUS, 1) {
                    self.clear_al_event(EVENT_PROCESS_DATA_WATCHDOG);
                }
                let first_activate = u32::from(map::SYNC_MANAGER_BASE.0) + 6;
                if at >= first_activate && at & 7 == 6 && at < u32::from(map::DC_RECEIVE_TIME.0) {
                    self.clear_al_event(EVENT_SYNC_MANAGER_ACTIVATION);
                }
            }
        }
    }

    /// Reads the bits of a piece into a datagram's data; `base` is the first logical bit of the data. Returns whether
    /// any bit was accessible.
    pub(super) fn read_bits(&mut self, piece: Piece, base: u64, data: &mut [u8]) -> bool {
        let at = piece.logical - base;
        if is_whole_bytes(piece, at) {
            let range = (at / 8) as usize..((at + piece.len) / 8) as usize;
            return physical(piece.physical)
                .is_some_and(|address| self.read(Side::Ecat, address, &mut data[range], false) > 0);
        }
        let (mut done, mut any) = (0, false);
        while done < piece.len {
            let (shift, bits) = bits_in_byte(piece, done);
            let mut byte = [0];
            let read = physical(piece.physical + done)
                .is_some_and(|address| self.read(Side::Ecat, address, &mut byte, false) > 0);
            if read {
                any = true;
                for bit in 0..bits {
                    set_bit(data, at + done + bit, byte[0] >> (shift + bit) & 1 != 0);
                }
            }
            done += bits;
        }
        any
    }

    /// Writes the bits of a piece from a datagram's data. Returns whether any bit was accessible.
    pub(super) fn write_bits(&mut self, piece: Piece, base: u64, data: &[u8]) -> bool {
        let at = piece.logical - base;
        if is_whole_bytes(piece, at) {
            let range = (at / 8) as usize..((at + piece.len) / 8) as usize;
            return physical(piece.physical)
                .is_some_and(|address| self.write(Side::Ecat, address, &data[range], 0xFF) > 0);
        }
        let (mut done, mut any) = (0, false);
        while done < piece.len {
            let (shift, bits) = bits_in_byte(piece, done);
            let (mut value, mut mask) = (0, 0);
            for bit in 0..bits {
                mask |= 1 << (shift + bit);
                value |= u8::from(bit_at(data, at + done + bit)) << (shift + bit);
            }
            any |= physical(piece.physical + done)
                .is_some_and(|address| self.write(Side::Ecat, address, &[value], mask) > 0);
            done += bits;
        }
        any
    }
}

/// Whether a piece starting at bit `at` of the data consists of whole bytes on both sides.
fn is_whole_bytes(piece: Piece, at: u64) -> bool {
    (at | piece.physical | piece.len) & 7 == 0
}

/// The byte address of a physical bit, inside the address space.
fn physical(bit: u64) -> Option<u32> {
    u32::try_from(bit / 8).ok().filter(|&address| address < ADDRESS_END)
}

/// Position of bit `done` of a piece in its physical byte, and number of remaining bits in that byte.
fn bits_in_byte(piece: Piece, done: u64) -> (u64, u64) {
    let shift = (piece.physical + done) % 8;
    (shift, (8 - shift).min(piece.len - done))
}

fn bit_at(data: &[u8], bit: u64) -> bool {
    data[(bit / 8) as usize] >> (bit % 8) & 1 != 0
}

fn set_bit(data: &mut [u8], bit: u64, set: bool) {
    let byte = &mut data[(bit / 8) as usize];
    *byte = *byte & !(1 << (bit % 8)) | u8::from(set) << (bit % 8);
}
