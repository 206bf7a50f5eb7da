//! States of the SubDevices: each stays in OP as long as its watchdog allows, unless an ACTIVE MainDevice starts or
//! stops it.

use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;

use super::board::Phase;
use super::outputs::Outputs;

/// A step of a watchdog's divider.
const WATCHDOG_STEP_NS: u64 = 40;
/// The longest frame: the log has the time of its first bit, and its end triggers the watchdog.
const FRAME_NS: u64 = 125_000;

/// Checks states.
#[derive(Debug)]
pub(super) struct States {
    last: Vec<AlStatus>,
    /// A MainDevice started or stopped SubDevices in the last cycle.
    were_changing: bool,
}

impl States {
    pub(super) fn new(network: &Network) -> States {
        States { last: network.devices().map(Device::al_status).collect(), were_changing: false }
    }

    /// Checks the states of all SubDevices; lines for the log.
    pub(super) fn check(&mut self, network: &Network, outputs: &Outputs, phases: [Phase; 2]) -> Vec<String> {
        let are_changing = phases.contains(&Phase::Starting);
        let may_change = std::mem::replace(&mut self.were_changing, are_changing) || are_changing;
        let op = AlStatus::new(AlState::Op);
        let mut lines = Vec::new();
        for device in (0..self.last.len()).map(DeviceIndex) {
            let is = network.device(device);
            let (from, to) = (std::mem::replace(&mut self.last[device.0], is.al_status()), is.al_status());
            if from == to {
                continue;
            }
            lines.push(format!("  device {}: {from} to {to}, {}", device.0, is.al_status_code()));
            if from != op || may_change || !is.controller.is_powered() {
                continue;
            }
            let silent = outputs.silence(device.0, network.now()).map_or(u64::MAX, |time| time.as_nanos() as u64);
            let allowed = watchdog_ns(is);
            let name = device.0;
            assert!(
                silent.saturating_add(FRAME_NS) >= allowed,
                "device {name} leaves OP for {to} ({}) after {silent} ns without outputs, watchdog {allowed}",
                is.al_status_code()
            );
        }
        lines
    }
}

/// Time of the watchdog for process data.
fn watchdog_ns(device: &Device) -> u64 {
    let word = |address| {
        let bytes = device.controller.register(address, 2);
        u64::from(u16::from_le_bytes([bytes[0], bytes[1]]))
    };
    (word(map::WATCHDOG_DIVIDER) + 2) * WATCHDOG_STEP_NS * word(map::WATCHDOG_TIME_PROCESS_DATA)
}
