//! Times between outputs, as each simulated SubDevice takes them, and from which MainDevice: the order `gaps`.

use std::fmt::Write as _;
use std::time::Duration;

use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::controller::LogicalAccess;
use ringcat::sim::network::Network;
use ringcat::sim::time::SimTime;

/// What a SubDevice has taken since the last answer.
#[derive(Clone, Copy, Debug, Default)]
struct Taken {
    /// When it took outputs last.
    at: Option<SimTime>,
    /// The MainDevice that sent them, and the number of its frame.
    last: Option<([u8; 3], u8)>,
    count: u64,
    longest: Duration,
    /// How often the outputs before came from another MainDevice.
    changes: u32,
    /// Outputs of a frame that the same MainDevice sent before the one whose outputs were taken last.
    back: u32,
}

impl Taken {
    fn take(&mut self, access: &LogicalAccess) {
        let gap = self.at.replace(access.at).map_or(Duration::ZERO, |before| access.at - before);
        let number = access.frame.0;
        match self.last.replace((access.identity, number)) {
            Some((identity, before)) if identity == access.identity => {
                self.back += u32::from((number.wrapping_sub(before) as i8) < 0);
            }
            Some(_) => self.changes += 1,
            None => {}
        }
        self.count += 1;
        self.longest = self.longest.max(gap);
    }
}

/// Outputs of all SubDevices.
#[derive(Debug)]
pub struct Gaps(Vec<Taken>);

impl Gaps {
    /// From now on.
    pub fn begin(network: &mut Network) -> Gaps {
        let count = network.devices().len();
        (0..count).for_each(|device| network.device_mut(DeviceIndex(device)).controller.log_logical());
        Gaps(vec![Taken::default(); count])
    }

    /// Takes what has happened since the last call.
    pub fn note(&mut self, network: &Network) {
        for (device, taken) in network.devices().zip(&mut self.0) {
            let newest = taken.at;
            let is_new = |access: &&LogicalAccess| newest.is_none_or(|newest| access.at > newest);
            let outputs = device.controller.logical_accesses().filter(is_new);
            outputs.filter(|access| access.written && access.is_valid).for_each(|access| taken.take(access));
        }
    }

    /// A line for each SubDevice that has taken outputs; then it begins anew.
    pub fn lines(&mut self, network: &Network) -> String {
        let mut text = String::new();
        for (number, (device, taken)) in network.devices().zip(&mut self.0).enumerate() {
            let Some(at) = taken.at else { continue };
            let longest = taken.longest.max(network.now() - at).as_secs_f64() * 1e3;
            let Taken { count, changes, back, .. } = *taken;
            // Writing into a String cannot fail.
            let _ = writeln!(
                text,
                "{number} \"{}\": {count} outputs, {longest:.3} ms at most between two, {changes} changes of the \
                 MainDevice, {back} older than those before",
                device.name()
            );
            *taken = Taken { at: taken.at, last: taken.last, ..Taken::default() };
        }
        text.truncate(text.trim_end().len());
        text
    }
}

#[cfg(test)]
mod tests {
    use ringcat::wire::command::Command;

    use super::*;

    fn access(ms: u64, identity: u8, number: u8) -> LogicalAccess {
        LogicalAccess {
            at: SimTime(ms * 1_000_000),
            identity: [0, 0, identity],
            frame: (number, 0),
            command: Command::Lwr,
            address: 0,
            read: false,
            written: true,
            is_valid: true,
            data: vec![0],
            moved: Vec::new(),
        }
    }

    // covers: sim-interfaces
    #[test]
    fn gaps_changes_of_the_sender_and_older_outputs_are_counted() {
        let mut taken = Taken::default();
        for (ms, identity, number) in [(10, 1, 254), (11, 1, 255), (12, 1, 1), (16, 2, 7), (17, 1, 2), (18, 1, 1)] {
            taken.take(&access(ms, identity, number));
        }
        let Taken { count, longest, changes, back, .. } = taken;
        assert_eq!((count, longest, changes, back), (6, Duration::from_millis(4), 2, 1));
    }
}
