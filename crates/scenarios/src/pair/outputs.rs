//! Outputs as the SubDevices take them: never older than those before, never of a cycle that is long over, and of one
//! cycle in all SubDevices that a frame passes.
//!
//! Each area of outputs has the number of its cycle, by the time of the segment, so values of two MainDevices compare.

use std::collections::BTreeMap;
use std::time::Duration;

use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::controller::LogicalAccess;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;

/// Outputs may be taken this many cycles after the beginning of theirs, unless a scenario says otherwise.
const MAX_AGE: u32 = 3;
/// Frames are remembered for this time.
const REMEMBERED: Duration = Duration::from_millis(50);

/// Marks of a frame: identity of its MainDevice, its number, its Idx.
type Frame = ([u8; 3], u8, u8);

/// What a SubDevice took last.
#[derive(Clone, Debug, Default)]
struct Taken {
    at: Option<SimTime>,
    /// Since the outputs before.
    gap: Duration,
    /// The number of the cycle.
    cycle: Option<u64>,
}

/// How many cycles before the one with number `now` outputs were written that have as much of the number of theirs as
/// fits in; negative for later ones.
fn age(outputs: &[u8], now: u64) -> i64 {
    match outputs {
        [byte] => i64::from((now as u8).wrapping_sub(*byte) as i8),
        [low, high, ..] => i64::from((now as u16).wrapping_sub(u16::from_le_bytes([*low, *high])) as i16),
        [] => 0,
    }
}

/// Checks outputs.
#[derive(Debug)]
pub(super) struct Outputs {
    cycle_ns: u64,
    max_age: u32,
    taken: Vec<Taken>,
    /// The cycle of each frame, and when it was seen first.
    frames: BTreeMap<Frame, (u64, SimTime)>,
    oldest: u32,
    /// Longest time between outputs that a SubDevice took.
    longest_gap: Duration,
    checked: u64,
}

impl Outputs {
    pub(super) fn new(network: &Network, cycle: Duration) -> Outputs {
        Outputs::of(network.devices().len(), cycle)
    }

    fn of(devices: usize, cycle: Duration) -> Outputs {
        let taken = vec![Taken::default(); devices];
        let cycle_ns = cycle.as_nanos() as u64;
        Outputs {
            cycle_ns,
            max_age: MAX_AGE,
            taken,
            frames: BTreeMap::new(),
            oldest: 0,
            longest_gap: Duration::ZERO,
            checked: 0,
        }
    }

    pub(super) fn allow_age(&mut self, cycles: u32) {
        self.max_age = cycles;
    }

    pub(super) fn checked(&self) -> u64 {
        self.checked
    }

    pub(super) fn take_oldest(&mut self) -> Duration {
        Duration::from_nanos(self.cycle_ns * u64::from(std::mem::take(&mut self.oldest)))
    }

    pub(super) fn take_longest_gap(&mut self) -> Duration {
        std::mem::take(&mut self.longest_gap)
    }

    /// How long a SubDevice has been without outputs; before those of the last cycle, if that was longer. `None` if it
    /// never took any.
    pub(super) fn silence(&self, device: usize, now: SimTime) -> Option<Duration> {
        let taken = &self.taken[device];
        let silence = now - taken.at?;
        let is_recent = silence.as_nanos() <= u128::from(2 * self.cycle_ns);
        Some(if is_recent { silence.max(taken.gap) } else { silence })
    }

    /// Checks what the SubDevices have taken since the last call.
    pub(super) fn check(&mut self, network: &Network) {
        let horizon = SimTime(network.now().0.saturating_sub(REMEMBERED.as_nanos() as u64));
        self.frames.retain(|_, (_, seen)| *seen >= horizon);
        for device in (0..self.taken.len()).map(DeviceIndex) {
            let last = self.taken[device.0].at;
            let controller = &network.device(device).controller;
            for access in controller
                .logical_accesses()
                .filter(|access| access.is_valid && last.is_none_or(|last| access.at > last))
            {
                self.check_access(device, access);
            }
        }
    }

    fn check_access(&mut self, device: DeviceIndex, access: &LogicalAccess) {
        let (at, now) = (access.at, access.at.0 / self.cycle_ns);
        for moved in access.moved.iter().filter(|moved| moved.write) {
            let outputs = access.data.get(moved.at..moved.at + moved.len).unwrap_or_default();
            let taken = &mut self.taken[device.0];
            let before = taken.at.replace(at);
            taken.gap = before.map_or(Duration::ZERO, |before| at - before);
            // Those of an application that has not written any yet, or does not any more.
            if outputs.iter().all(|byte| *byte == 0) {
                continue;
            }
            self.longest_gap = self.longest_gap.max(taken.gap);
            let (age, name) = (age(outputs, now), device.0);
            let frame = (access.identity, access.frame.0, access.frame.1);
            let is_recent = u32::try_from(age).is_ok_and(|age| age <= self.max_age);
            assert!(is_recent, "device {name} takes outputs of {age} cycles ago at {at} from {frame:02x?}");
            let cycle = now.saturating_add_signed(-age);
            let before = taken.cycle.replace(cycle).unwrap_or(0);
            assert!(cycle >= before, "device {name} goes back from cycle {before} to {cycle} at {at} by {frame:02x?}");
            let (first, _) = *self.frames.entry(frame).or_insert((cycle, at));
            assert_eq!(cycle, first, "device {name} takes outputs of another cycle at {at} from {frame:02x?}");
            self.oldest = self.oldest.max(age as u32);
            self.checked += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use ringcat_sim::controller::Moved;
    use ringcat_wire::command::Command;

    use super::*;

    const CYCLE: u64 = 1_000_000;

    /// Outputs of this cycle, taken by a device in another one.
    fn taken(outputs: &mut Outputs, device: usize, of_cycle: u8, in_cycle: u64, frame_id: u8) {
        let moved = vec![Moved { at: 0, len: 2, write: true }];
        let access = LogicalAccess {
            at: SimTime(in_cycle * CYCLE + 100),
            identity: [0, 0x53, 1],
            frame: (frame_id, 0),
            command: Command::Lwr,
            address: 0,
            read: false,
            written: true,
            is_valid: true,
            data: vec![of_cycle, 0],
            moved,
        };
        outputs.check_access(DeviceIndex(device), &access);
    }

    fn outputs() -> Outputs {
        Outputs::of(2, Duration::from_nanos(CYCLE))
    }

    #[test]
    fn outputs_of_later_cycles_in_each_device_pass() {
        let mut outputs = outputs();
        for (device, of, at, frame) in [(0, 5, 5, 1), (1, 5, 5, 1), (0, 6, 7, 2), (1, 7, 7, 3)] {
            taken(&mut outputs, device, of, at, frame);
        }
        assert_eq!((outputs.checked(), outputs.take_oldest()), (4, Duration::from_millis(1)));
    }

    #[test]
    #[should_panic(expected = "goes back from cycle 6 to 5")]
    fn outputs_that_go_back_are_found() {
        let mut outputs = outputs();
        taken(&mut outputs, 0, 6, 6, 1);
        taken(&mut outputs, 0, 5, 6, 2);
    }

    #[test]
    #[should_panic(expected = "takes outputs of 4 cycles ago")]
    fn outputs_that_are_too_old_are_found() {
        taken(&mut outputs(), 0, 5, 9, 1);
    }

    #[test]
    #[should_panic(expected = "takes outputs of another cycle")]
    fn a_frame_with_outputs_of_two_cycles_is_found() {
        let mut outputs = outputs();
        taken(&mut outputs, 0, 6, 6, 1);
        taken(&mut outputs, 1, 5, 6, 1);
    }

    #[test]
    fn an_age_follows_from_what_fits_into_outputs() {
        assert_eq!(age(&[0xFE], 0x101), 3);
        assert_eq!(age(&[0xFF, 0x00, 0xFF], 0x1_0102), 3);
        assert_eq!(age(&[0x04, 0x01], 0x1_0102), -2);
    }
}
