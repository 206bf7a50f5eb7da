//! True instants of SYNC0 pulses, which a MainDevice cannot see.

use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;

/// SYNC0 of some devices, observed after each cycle.
#[derive(Clone, Debug)]
pub struct Pulses {
    devices: Vec<Pulse>,
    cycle_ns: u64,
}

/// SYNC0 of one device.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pulse {
    /// The device.
    pub device: usize,
    /// Pulses since the observation began.
    pub count: u64,
    /// Pulses since its SYNC unit was activated.
    total: u64,
    /// The last one.
    pub last: Option<SimTime>,
    /// The next one, as the clock runs now.
    pub next: Option<SimTime>,
    /// Largest deviation of the time between two pulses from the cycle, in nanoseconds.
    pub worst_ns: u64,
}

impl Pulses {
    /// Observes these devices, with this cycle of SYNC0, from now on.
    pub fn new(network: &Network, devices: impl IntoIterator<Item = usize>, cycle_ns: u64) -> Pulses {
        let devices = devices.into_iter().map(|device| Pulse { device, ..Pulse::default() }).collect();
        let mut pulses = Pulses { devices, cycle_ns };
        pulses.observe(network);
        pulses
    }

    /// Takes the pulses up to now. To be called at least once per cycle of SYNC0.
    pub fn observe(&mut self, network: &Network) {
        let now = network.now();
        for pulse in &mut self.devices {
            let controller = &network.device(DeviceIndex(pulse.device)).controller;
            let total = controller.sync0_pulses(now);
            // The clock may have been steered since the last prediction.
            for _ in pulse.total..total {
                let Some(at) = pulse.next.map(|next| next.min(now)) else { break };
                if let Some(last) = pulse.last {
                    pulse.worst_ns = pulse.worst_ns.max((at - last).as_nanos().abs_diff(self.cycle_ns.into()) as u64);
                }
                (pulse.count, pulse.last) = (pulse.count + 1, Some(at));
                pulse.next = Some(SimTime(at.0 + self.cycle_ns));
            }
            (pulse.total, pulse.next) = (total, controller.next_sync0(now));
        }
    }

    /// Each device.
    pub fn devices(&self) -> &[Pulse] {
        &self.devices
    }

    /// Largest deviation of the time between two pulses of one device from the cycle, in nanoseconds.
    pub fn worst_ns(&self) -> u64 {
        self.devices.iter().map(|pulse| pulse.worst_ns).max().unwrap_or(0)
    }

    /// Fewest pulses of one device.
    pub fn fewest(&self) -> u64 {
        self.devices.iter().map(|pulse| pulse.count).min().unwrap_or(0)
    }

    /// Most pulses of one device.
    pub fn most(&self) -> u64 {
        self.devices.iter().map(|pulse| pulse.count).max().unwrap_or(0)
    }

    /// From the first to the last device that pulses next, in nanoseconds; `None` if one has no next pulse.
    pub fn apart_ns(&self) -> Option<u64> {
        let phases: Option<Vec<u64>> = self.devices.iter().map(|pulse| Some(pulse.next?.0)).collect();
        let phases = phases?;
        let first = *phases.first()?;
        // One device may pulse before, the other after now.
        let (cycle, half) = (self.cycle_ns as i64, self.cycle_ns as i64 / 2);
        let offset = |at: &u64| (at.wrapping_sub(first) as i64 + half).rem_euclid(cycle) - half;
        let offsets: Vec<i64> = phases.iter().map(offset).collect();
        Some(offsets.iter().max()?.abs_diff(*offsets.iter().min()?))
    }
}
