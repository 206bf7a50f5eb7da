//! SyncManagers: three buffers or a mailbox for an area of RAM (protocol 3.11).
//!
//! Input: the register bytes of each SyncManager and accesses to its area. Output: whether an access is granted and its
//! address, and after complete accesses the status byte and events. An access by EtherCAT is complete only after a good
//! FCS of its frame: [`SyncManagers::finish_frame`] handles it. Accesses of the PDI are complete at once.
//!
//! Areas without a SyncManager are freely accessible. The area of a SyncManager that is disabled, by either side, is
//! locked. The second and third buffer are not addressable. Areas of one byte, and areas in register space, have a
//! single buffer.

use ringcat_wire::register::{SyncManager, SyncManagerDirection, SyncManagerMode};

use super::memory::{PROCESS_RAM, Side};

/// Number of the last buffer before the first write.
const NO_BUFFER: u8 = 3;
const BUFFERS: u32 = 3;

/// Buffering of the area.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Buffering {
    #[default]
    Three,
    Mailbox,
    Single,
    /// A reserved mode or direction: all accesses are refused.
    Invalid,
}

/// The side whose access is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Writer,
    Reader,
}

/// Decision of the SyncManagers about an access that starts at an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Claim {
    /// Up to this address no SyncManager applies.
    Free(u32),
    /// Up to this address nothing is accessible.
    Locked(u32),
    /// Up to this address, the area of this SyncManager.
    Area(usize, u32),
}

/// An access that is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grant {
    /// Address of the bytes, in one of the buffers.
    pub address: u32,
    /// Whether the access begins at the first byte of the area.
    pub opened: bool,
    /// Whether the access ends at the last byte of an area that was opened at its first.
    pub completed: bool,
}

/// Result of a completed access.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Completion {
    /// Whether a complete write triggers the process data watchdog.
    pub triggers_watchdog: bool,
    /// Whether a buffer was handed over.
    pub is_complete: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Unit {
    start: u32,
    length: u32,
    buffering: Buffering,
    ecat_writes: bool,
    enabled: bool,
    ecat_event: bool,
    pdi_event: bool,
    watchdog: bool,
    activate: u8,
    write_buffer: u8,
    read_buffer: u8,
    last_buffer: u8,
    full: bool,
    write_event: bool,
    read_event: bool,
    writer_open: bool,
    reader_open: bool,
    /// Whether EtherCAT began reading or writing in this frame.
    frame_opened: bool,
    /// Whether EtherCAT accessed the last byte in this frame.
    frame_completed: bool,
    /// Current register values: the status byte, the ECAT event, the AL event.
    shown: Option<(u8, bool, bool)>,
}

/// All SyncManagers of a controller.
#[derive(Clone, Debug)]
pub(super) struct SyncManagers {
    units: Vec<Unit>,
    /// SyncManagers with a length, one bit each: only these affect an access.
    configured: u16,
}

impl SyncManagers {
    pub fn new(count: u8) -> SyncManagers {
        SyncManagers { units: vec![Unit::after_reset(); usize::from(count)], configured: 0 }
    }

    pub fn reset(&mut self) {
        self.units.fill(Unit::after_reset());
        self.configured = 0;
    }

    pub fn count(&self) -> usize {
        self.units.len()
    }

    /// Applies the registers of SyncManager `n`. A change of its area or of its activation resets its buffers. Returns
    /// whether the activate byte has changed.
    pub fn configure(&mut self, n: usize, registers: &SyncManager) -> bool {
        let Some(unit) = self.units.get_mut(n) else { return false };
        let old = *unit;
        let new = Unit::from_registers(registers);
        *unit = new;
        if old.layout() == new.layout() {
            let Unit { ecat_event, pdi_event, watchdog, activate, .. } = new;
            *unit = Unit { ecat_event, pdi_event, watchdog, activate, shown: None, ..old };
        }
        self.configured = self.configured & !(1 << n) | u16::from(new.length != 0) << n;
        old.activate != new.activate
    }

    /// Whether the start and length registers are writable.
    pub fn enabled(&self, n: usize) -> bool {
        self.units.get(n).is_some_and(|unit| unit.enabled)
    }

    /// The SyncManager of `address`.
    pub fn claim(&self, address: u32, end: u32) -> Claim {
        let mut free_until = end;
        let mut hidden_until = None;
        let mut left = self.configured;
        while left != 0 {
            let n = left.trailing_zeros() as usize;
            left &= left - 1;
            let unit = &self.units[n];
            let area_end = unit.start + unit.length;
            if address < unit.start {
                free_until = free_until.min(unit.start);
            } else if address < area_end {
                let until = area_end.min(end);
                return if unit.enabled { Claim::Area(n, until) } else { Claim::Locked(until) };
            } else if unit.hides(address) {
                hidden_until = Some(unit.start + BUFFERS * unit.length);
            }
        }
        match hidden_until {
            Some(hidden) => Claim::Locked(hidden.min(free_until)),
            None => Claim::Free(free_until),
        }
    }

    /// Requests an access to `start..end` inside the area of SyncManager `n`; `None` if it is not allowed.
    pub fn access(&mut self, n: usize, side: Side, write: bool, start: u32, end: u32) -> Option<Grant> {
        self.units[n].access(side, write, start, end)
    }

    /// Whether the expired process data watchdog blocks reads of the PDI.
    pub fn guarded(&self, n: usize) -> bool {
        let unit = &self.units[n];
        unit.watchdog && unit.ecat_writes && unit.buffering != Buffering::Mailbox
    }

    /// Ends the accesses of EtherCAT to SyncManager `n` in this frame; with a bad FCS they have no effect.
    pub fn finish_frame(&mut self, n: usize, good: bool) -> Completion {
        let unit = &mut self.units[n];
        let role = if unit.ecat_writes { Role::Writer } else { Role::Reader };
        let (opened, completed) = (unit.frame_opened, unit.frame_completed);
        (unit.frame_opened, unit.frame_completed) = (false, false);
        if !good {
            unit.close(role);
            return Completion::default();
        }
        unit.finish(role, opened, completed)
    }

    /// Ends a read or write of the PDI to SyncManager `n`.
    pub fn finish_pdi(&mut self, n: usize, write: bool, grant: Grant) -> Completion {
        let role = if write { Role::Writer } else { Role::Reader };
        self.units[n].finish(role, grant.opened, grant.completed)
    }

    /// The status byte (+5) and the bits of the ECAT event and the AL event, if they differ from the last call.
    #[inline]
    pub fn show(&mut self, n: usize) -> Option<(u8, bool, bool)> {
        let unit = &mut self.units[n];
        let now = Some((unit.status(), unit.events().0, unit.events().1));
        if unit.shown == now {
            return None;
        }
        unit.shown = now;
        now
    }
}

impl Unit {
    fn after_reset() -> Unit {
        Unit { last_buffer: NO_BUFFER, ..Unit::default() }
    }

    fn from_registers(registers: &SyncManager) -> Unit {
        let (start, length) = (u32::from(registers.start), u32::from(registers.length));
        let mut unit = Unit {
            start,
            length,
            enabled: registers.activate.enable && !registers.pdi_control.deactivate && length != 0,
            ecat_event: registers.control.ecat_event,
            pdi_event: registers.control.pdi_event,
            watchdog: registers.control.watchdog,
            activate: registers.activate.bits(),
            ..Unit::after_reset()
        };
        unit.ecat_writes = registers.control.direction == SyncManagerDirection::Write;
        unit.buffering = match (registers.control.mode, registers.control.direction) {
            (SyncManagerMode::Reserved(_), _) | (_, SyncManagerDirection::Reserved(_)) => Buffering::Invalid,
            (SyncManagerMode::Mailbox, _) => Buffering::Mailbox,
            (SyncManagerMode::Buffered, _) if length == 1 || start < PROCESS_RAM => Buffering::Single,
            (SyncManagerMode::Buffered, _) => Buffering::Three,
        };
        unit
    }

    /// Properties that determine the buffers.
    fn layout(&self) -> (u32, u32, bool, bool, Buffering) {
        (self.start, self.length, self.enabled, self.ecat_writes, self.buffering)
    }

    /// Whether `address`, after the area, is in the second or third buffer.
    fn hides(&self, address: u32) -> bool {
        self.enabled && self.buffering == Buffering::Three && address < self.start + BUFFERS * self.length
    }

    fn role(&self, side: Side, write: bool) -> Option<Role> {
        let writer = self.ecat_writes == (side == Side::Ecat);
        match (write, writer) {
            (true, true) => Some(Role::Writer),
            (false, false) => Some(Role::Reader),
            // A single buffer can be read back.
            (false, true) if self.buffering == Buffering::Single => Some(Role::Reader),
            _ => None,
        }
    }

    fn access(&mut self, side: Side, write: bool, start: u32, end: u32) -> Option<Grant> {
        let role = self.role(side, write)?;
        let reads_back = role == Role::Reader && self.ecat_writes == (side == Side::Ecat);
        if self.buffering == Buffering::Invalid {
            return None;
        }
        let direct = Grant { address: start, opened: false, completed: false };
        if reads_back {
            return Some(direct);
        }
        let opened = start == self.start;
        if opened {
            self.open(role)?;
        }
        let open = match role {
            Role::Writer => self.writer_open,
            Role::Reader => self.reader_open,
        };
        if !open {
            return (self.buffering == Buffering::Single).then_some(direct);
        }
        let completed = end == self.start + self.length;
        if side == Side::Ecat {
            self.frame_opened |= opened;
            self.frame_completed |= completed;
        }
        let buffer = match (self.buffering, role) {
            (Buffering::Three, Role::Writer) => self.write_buffer,
            (Buffering::Three, Role::Reader) => self.read_buffer,
            _ => 0,
        };
        Some(Grant { address: start + u32::from(buffer) * self.length, opened, completed })
    }

    /// Access to the first byte.
    fn open(&mut self, role: Role) -> Option<()> {
        match (self.buffering, role) {
            (Buffering::Mailbox, Role::Writer) if self.full || self.frame_completed => return None,
            (Buffering::Mailbox, Role::Reader) if !self.full || self.frame_completed => return None,
            (Buffering::Three, Role::Reader) => {
                if self.last_buffer == NO_BUFFER {
                    return None;
                }
                self.read_buffer = self.last_buffer;
            }
            _ => {}
        }
        match role {
            Role::Writer => self.writer_open = true,
            Role::Reader => self.reader_open = true,
        }
        Some(())
    }

    fn close(&mut self, role: Role) {
        match role {
            Role::Writer => self.writer_open = false,
            Role::Reader => self.reader_open = false,
        }
    }

    /// Applies the start or end of an access.
    fn finish(&mut self, role: Role, opened: bool, completed: bool) -> Completion {
        if opened {
            match role {
                Role::Writer => self.read_event = false,
                Role::Reader => self.write_event = false,
            }
        }
        if !completed {
            return Completion::default();
        }
        self.close(role);
        match role {
            Role::Writer => {
                self.write_event = true;
                self.full = self.buffering == Buffering::Mailbox;
                self.last_buffer = self.write_buffer;
                if self.buffering == Buffering::Three {
                    self.write_buffer = self.spare_buffer();
                }
                Completion { triggers_watchdog: self.watchdog, is_complete: true }
            }
            Role::Reader => {
                self.read_event = true;
                self.full = false;
                Completion { is_complete: true, ..Completion::default() }
            }
        }
    }

    /// A buffer that contains neither the last complete value nor the value being read.
    fn spare_buffer(&self) -> u8 {
        let taken = |b: u8| b == self.last_buffer || (self.reader_open && b == self.read_buffer);
        (0..NO_BUFFER).find(|&b| !taken(b)).unwrap_or(0)
    }

    /// The bits for the ECAT event and the AL event.
    fn events(&self) -> (bool, bool) {
        let (ecat, pdi) = match self.ecat_writes {
            true => (self.read_event, self.write_event),
            false => (self.write_event, self.read_event),
        };
        (ecat && self.ecat_event, pdi && self.pdi_event)
    }

    /// The bits of [`ringcat_wire::register::SyncManagerStatus`], updated by every access.
    fn status(&self) -> u8 {
        let last_buffer = if self.buffering == Buffering::Mailbox { 0 } else { self.last_buffer };
        u8::from(self.write_event)
            | u8::from(self.read_event) << 1
            | u8::from(self.full) << 3
            | last_buffer << 4
            | u8::from(self.reader_open) << 6
            | u8::from(self.writer_open) << 7
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::register::SyncManagerStatus;

    fn managers(control: u8, length: u16) -> SyncManagers {
        let mut managers = SyncManagers::new(8);
        let l = length.to_le_bytes();
        managers.configure(0, &SyncManager::decode(&[0x00, 0x10, l[0], l[1], control, 0, 1, 0]));
        managers
    }

    #[test]
    fn the_writer_never_uses_the_buffer_that_is_being_read() {
        let mut managers = managers(0x24, 4);
        let mut last = None;
        for round in 0..10 {
            let at = managers.access(0, Side::Ecat, true, 0x1000, 0x1004).unwrap().address;
            assert_ne!(Some(at), last, "round {round}");
            managers.finish_frame(0, true);
            if round % 3 == 0 {
                // A reader opens the newest buffer and reads slowly.
                let grant = managers.access(0, Side::Pdi, false, 0x1000, 0x1001).unwrap();
                assert!(grant.opened && !grant.completed);
                assert_eq!(grant.address, at);
                managers.finish_pdi(0, false, grant);
                last = Some(at);
            }
        }
    }

    #[test]
    fn the_second_and_third_buffer_are_not_addressable() {
        let managers = managers(0x24, 4);
        assert_eq!(managers.claim(0x0F80, 0x2000), Claim::Free(0x1000));
        assert_eq!(managers.claim(0x1001, 0x2000), Claim::Area(0, 0x1004));
        assert_eq!(managers.claim(0x1004, 0x2000), Claim::Locked(0x100C));
        assert_eq!(managers.claim(0x100C, 0x2000), Claim::Free(0x2000));
    }

    #[test]
    fn after_a_reset_no_buffer_was_written() {
        let mut managers = SyncManagers::new(1);
        assert_eq!(managers.show(0), Some((0x30, false, false)));
        assert_eq!(managers.show(0), None, "no change");
    }

    #[test]
    fn the_status_byte_is_that_of_the_codec() {
        for bits in 0..0x80u8 {
            let flag = |bit: u8| bits >> bit & 1 != 0;
            let unit = Unit {
                write_event: flag(0),
                read_event: flag(1),
                full: flag(2),
                last_buffer: bits >> 3 & 3,
                reader_open: flag(5),
                writer_open: flag(6),
                ..Unit::default()
            };
            let status = SyncManagerStatus {
                write_event: unit.write_event,
                read_event: unit.read_event,
                mailbox_full: unit.full,
                last_buffer: unit.last_buffer,
                read_buffer_open: unit.reader_open,
                write_buffer_open: unit.writer_open,
                reserved: 0,
            };
            assert_eq!(unit.status(), status.bits());
        }
    }
}
