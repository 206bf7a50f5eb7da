//! Registers of distributed clocks: effects of writes and reads (protocol 3.12, 7.2.1, 7.3).

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::{DcActivation, DcLatchControl, map};

use super::Controller;
use super::clock::LoopSettings;
use super::memory::Side;
use super::sync_unit::SyncSettings;
use crate::frame::Port;
use crate::time::SimTime;

/// A pin of the LATCH units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LatchPin {
    /// LATCH0.
    Latch0 = 0,
    /// LATCH1.
    Latch1 = 1,
}

impl Controller {
    /// A write to clock registers takes effect; `first_bit` is the time at which its frame began.
    pub(super) fn clock_written(&mut self, at: u32, bytes: &[(u8, u8)], first_bit: SimTime, now: SimTime) {
        let end = at + bytes.len() as u32;
        let is = |register: RegisterAddress, len: u32| at < u32::from(register.0) + len && u32::from(register.0) < end;
        if at == u32::from(map::DC_SYSTEM_TIME.0)
            && let Some([(a, _), (b, _), (c, _), (d, _)]) = bytes.first_chunk::<4>()
        {
            self.system_time_written(u32::from_le_bytes([*a, *b, *c, *d]), first_bit);
        }
        if is(map::DC_SYSTEM_TIME_OFFSET, 8) {
            self.sync_unit.offset_written(self.memory.u64(map::DC_SYSTEM_TIME_OFFSET), self.clock.local(now));
        }
        if is(map::DC_SPEED_COUNTER_START, 2) {
            self.clock.restart_loop(now);
            self.memory.set_u32(map::DC_SYSTEM_TIME_DIFFERENCE, 0);
            self.memory.set_u16(map::DC_SPEED_COUNTER_DIFFERENCE, 0);
        }
        let start_len = if self.starts_by_half() { 4 } else { 8 };
        if is(map::DC_START_TIME.offset(start_len - 1), 1) && self.sync_unit.awaits_start_time() {
            let activation = DcActivation::from_bits(self.memory.u8(map::DC_ACTIVATION));
            self.memory.set_u8(map::DC_ACTIVATION, DcActivation { cyclic_unit: true, ..activation }.bits());
            self.activate_sync_unit(now);
        } else if is(map::DC_ACTIVATION, 1) {
            self.activate_sync_unit(now);
        }
    }

    /// Whether the lower half of the start time is the complete start time.
    fn starts_by_half(&self) -> bool {
        let activation = DcActivation::from_bits(self.memory.u8(map::DC_ACTIVATION));
        activation.extend_start_time || !self.config.features.dc_64bit
    }

    /// Applies the registers of the SYNC unit.
    fn activate_sync_unit(&mut self, now: SimTime) {
        let settings = SyncSettings {
            start: self.memory.u64(map::DC_START_TIME),
            sync0_cycle_ns: self.memory.u32(map::DC_SYNC0_CYCLE),
            sync1_cycle_ns: self.memory.u32(map::DC_SYNC1_CYCLE),
            wide: self.config.features.dc_64bit,
            acknowledged: self.memory.u16(map::DC_PULSE_LENGTH) == 0,
        };
        let activation = DcActivation::from_bits(self.memory.u8(map::DC_ACTIVATION));
        self.sync_unit.activate(activation, settings, self.unbounded_time(now));
        self.memory.set_u8(map::DC_ACTIVATION_STATUS, self.sync_unit.status().bits());
    }

    /// Passes a sample to the control loop.
    fn system_time_written(&mut self, received: u32, first_bit: SimTime) {
        let settings = LoopSettings {
            start: self.memory.u16(map::DC_SPEED_COUNTER_START),
            difference_depth: self.memory.u8(map::DC_FILTER_DIFFERENCE),
            speed_depth: self.memory.u8(map::DC_FILTER_SPEED),
        };
        let offset = self.memory.u64(map::DC_SYSTEM_TIME_OFFSET);
        let delay = self.memory.u32(map::DC_SYSTEM_TIME_DELAY);
        self.clock.compare(received, offset.wrapping_sub(delay.into()), first_bit, settings);
        let (difference, speed) = self.clock.loop_registers();
        self.memory.set_u32(map::DC_SYSTEM_TIME_DIFFERENCE, difference);
        self.memory.set_u16(map::DC_SPEED_COUNTER_DIFFERENCE, speed as u16);
    }

    /// Computes registers on reads; a part of a read contains at most one of them.
    pub(super) fn clock_read(&mut self, side: Side, at: u32, until: u32) {
        let is =
            |register: RegisterAddress, len: u32| at < u32::from(register.0) + len && u32::from(register.0) < until;
        let start = self.pass.start;
        if is(map::DC_SYSTEM_TIME, 8) {
            let time = match side {
                Side::Ecat => self.in_width(self.widened(self.clock.stamp(Port::A, start))),
                Side::Pdi => self.system_time(start),
            };
            self.memory.set_u64(map::DC_SYSTEM_TIME, time);
        }
        if is(map::DC_START_TIME, 8)
            && let Some(next) = self.sync_unit.next_sync0(self.unbounded_time(start))
        {
            self.memory.set_u64(map::DC_START_TIME, self.in_width(next));
        }
        if is(map::DC_NEXT_SYNC1, 8)
            && let Some(next) = self.sync_unit.next_sync1(self.unbounded_time(start))
        {
            self.memory.set_u64(map::DC_NEXT_SYNC1, self.in_width(next));
        }
        for signal in 0..2u16 {
            let status = map::DC_SYNC0_STATUS.offset(signal);
            if is(status, 1) {
                let time = self.unbounded_time(start);
                self.memory.set_u8(status, u8::from(self.sync_unit.is_active(signal.into(), time)));
                if side == Side::Pdi {
                    self.sync_unit.acknowledge(signal.into(), time);
                }
            }
        }
        for (pin, base) in [(0, map::DC_LATCH0_POSITIVE_EDGE), (1, map::DC_LATCH1_POSITIVE_EDGE)] {
            for (edge, positive) in [(0, true), (8, false)] {
                if is(base.offset(edge), 8) {
                    self.latch_units[pin].read(positive);
                    let status = map::DC_LATCH0_STATUS.offset(pin as u16);
                    let pin_state = self.memory.u8(status) & 4;
                    self.memory.set_u8(status, pin_state | self.latch_units[pin].status());
                }
            }
        }
    }

    /// Local time plus DC_SYSTEM_TIME_OFFSET.
    fn widened(&self, local: u64) -> u64 {
        local.wrapping_add(self.memory.u64(map::DC_SYSTEM_TIME_OFFSET))
    }

    /// System time in 64 bits, also if the registers have 32 bits; the SYNC unit uses it.
    fn unbounded_time(&self, now: SimTime) -> u64 {
        self.widened(self.clock.local(now))
    }

    fn in_width(&self, time: u64) -> u64 {
        if self.config.features.dc_64bit { time } else { u64::from(time as u32) }
    }

    /// Local clock plus DC_SYSTEM_TIME_OFFSET; 32 bits if the clock has only 32.
    pub fn system_time(&self, now: SimTime) -> u64 {
        self.in_width(self.widened(self.clock.local(now)))
    }

    /// Time of the next SYNC0 pulse at `now` or later; `None` if there is none.
    pub fn next_sync0(&self, now: SimTime) -> Option<SimTime> {
        let system = self.unbounded_time(now);
        let ahead = self.sync_unit.next_sync0(system)?.wrapping_sub(system);
        Some(self.clock.when(self.clock.local(now).wrapping_add(ahead), now))
    }

    /// Pulses of SYNC0 since it was activated.
    pub fn sync0_pulses(&self, now: SimTime) -> u64 {
        self.sync_unit.pulses(self.unbounded_time(now))
    }

    /// Whether SYNC0 is activated and has not occurred yet.
    pub fn awaits_sync0(&self, now: SimTime) -> bool {
        self.sync_unit.has_sync0() && self.sync0_pulses(now) == 0
    }

    /// A buffer of a SyncManager was opened or handed over: the register stores the local time (protocol 3.12).
    pub(super) fn note_buffer_event(&mut self, register: RegisterAddress, at: SimTime) {
        if self.config.features.dc {
            self.memory.set_u32(register, self.clock.local(at) as u32);
        }
    }

    /// An edge at a pin of the LATCH units.
    pub fn latch_edge(&mut self, pin: LatchPin, positive: bool, now: SimTime) {
        let n = pin as u16;
        let control = DcLatchControl::from_bits(self.memory.u8(map::DC_LATCH0_CONTROL.offset(n)));
        let single = if positive { control.positive_single } else { control.negative_single };
        if self.latch_units[usize::from(n)].edge(positive, single) {
            let register = map::DC_LATCH0_POSITIVE_EDGE.offset(16 * n + if positive { 0 } else { 8 });
            self.memory.set_u64(register, self.system_time(now));
        }
        let status = self.latch_units[usize::from(n)].status() | u8::from(positive) << 2;
        self.memory.set_u8(map::DC_LATCH0_STATUS.offset(n), status);
    }
}
