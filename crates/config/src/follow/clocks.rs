//! Distributed clocks: SYNC signals from the registers as written by the commands (protocol 7.3), the reference clock
//! from the cyclic commands. RingCAT measures delays and computes offsets and start times.

use ringcat_engine::config::{ClockConfig, ReferenceClock, SubDeviceConfig, SyncSignals};
use ringcat_engine::declared::SubDeviceId;
use ringcat_wire::register::map;

use super::cyclic::Cyclic;
use super::notices::Notices;
use super::registers::Registers;
use crate::eni::{DistributedClock, Eni};

/// SYNC0 and SYNC1 in the word at 0x0980 and 0x0981.
const SYNC0: u16 = 0x0300;
const SYNC1_ON: u16 = 0x0400;
const SYNC1: u16 = SYNC0 | SYNC1_ON;
/// Bits that activate a signal.
const ON: u16 = 0x0600;

/// SYNC signals of a SubDevice.
pub(super) fn of_subdevice(
    eni: &Eni,
    index: usize,
    registers: &Registers,
    complete: bool,
    notices: &mut Notices,
) -> Option<SyncSignals> {
    let clock = eni.subdevices[index].clock.as_ref();
    if !complete {
        return clock.filter(|clock| clock.cycle_0_ns > 0).map(from_element);
    }
    let assign_activate = registers.word(map::DC_CYCLIC_UNIT_CONTROL).filter(|word| word & ON != 0)?;
    let cycle_0 = registers.double_word(map::DC_SYNC0_CYCLE).unwrap_or_default();
    let register_1 = registers.double_word(map::DC_SYNC1_CYCLE).unwrap_or_default();
    if let Some(clock) = clock
        && clock.cycle_0_ns != cycle_0
    {
        let reason =
            format!("{} ns, but the commands set {cycle_0} ns: the commands take precedence", clock.cycle_0_ns);
        notices.add(Some(clock.place), Some(index), "DC/CycleTime0", reason);
    }
    let shift = clock.map_or(0, |clock| clock.shift_ns);
    Some(signals(assign_activate, cycle_0, register_1, shift))
}

/// The SYNC signals from `DC` alone.
fn from_element(clock: &DistributedClock) -> SyncSignals {
    let assign_activate = if clock.cycle_1_ns > 0 { SYNC1 } else { SYNC0 };
    signals(assign_activate, clock.cycle_0_ns, clock.cycle_1_ns, clock.shift_ns)
}

/// The SYNC1 register counts from SYNC0: whole cycles are its division, the rest is its shift. With less than a cycle
/// SYNC1 has the cycle of SYNC0.
fn signals(assign_activate: u16, cycle_0: u32, register_1: u32, shift: i32) -> SyncSignals {
    let mut signals = SyncSignals::sync0(cycle_0, shift).with_assign_activate(assign_activate);
    if assign_activate & SYNC1_ON != 0 && cycle_0 > 0 {
        let cycles = register_1 / cycle_0;
        signals.sync1_cycle_ns = cycle_0.saturating_add(cycles.saturating_mul(cycle_0));
        signals.sync1_shift_ns = i32::try_from(register_1 % cycle_0).unwrap_or(i32::MAX);
    }
    signals
}

/// The clocks of the segment, if the file uses them.
pub(super) fn of_segment(eni: &Eni, configs: &[SubDeviceConfig], cyclic: &Cyclic) -> Option<ClockConfig> {
    let by_element = eni.subdevices.iter().position(|subdevice| subdevice.clock.as_ref().is_some_and(|c| c.reference));
    let used = cyclic.distributes || by_element.is_some() || configs.iter().any(|config| config.sync.is_some());
    let reference = cyclic
        .reference
        .or(by_element)
        .map_or(ReferenceClock::default(), |index| ReferenceClock::Declared(SubDeviceId(index)));
    used.then(|| ClockConfig::default().with_reference(reference).with_bus_shift(cyclic.bus_shift))
}
