//! Faults of the segment and the host in a scenario.

use std::time::Duration;

use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;

use super::World;
use crate::loss::Loss;

impl World {
    /// Loses frames.
    pub fn lose(&mut self, loss: Loss) {
        self.say(format!("{loss:?}"));
        self.application.links_mut().lose(loss);
    }

    /// Lets time pass without a cycle, as if the application is stopped. The acyclic half stops too.
    pub fn stall(&mut self, time: Duration) {
        self.say(format!("the application stops for {} ms", time.as_millis()));
        let network = self.application.links_mut().network_mut();
        network.advance_by(time);
    }

    /// Injects a fault now.
    pub fn fault(&mut self, fault: Fault) {
        self.say(format!("{fault:?}"));
        let network = self.network_mut();
        network.apply(fault);
        network.advance(network.now());
        self.mirror.look_again(self.application.links().network());
    }

    /// Injects a fault after a time.
    pub fn fault_in(&mut self, delay: Duration, fault: Fault) {
        self.say(format!("in {} us: {fault:?}", delay.as_micros()));
        let at = self.network().now() + delay;
        self.network_mut().schedule(at, fault);
    }

    /// Cuts a cable.
    pub fn cut(&mut self, cable: CableId) {
        self.fault(Fault::Cut(cable));
    }

    /// Repairs a cable.
    pub fn heal(&mut self, cable: CableId) {
        self.fault(Fault::Heal(cable));
    }

    /// Switches a device off.
    pub fn power_off(&mut self, device: DeviceIndex) {
        self.fault(Fault::PowerOff(device));
    }

    /// Switches a device on.
    pub fn power_on(&mut self, device: DeviceIndex) {
        self.fault(Fault::PowerOn(device));
    }

    /// Lets a device's application hang or continue.
    pub fn hang(&mut self, device: DeviceIndex, hanging: bool) {
        self.fault(Fault::Hang(device, hanging));
    }

    /// Corrupts the next frames on a cable, in both directions.
    pub fn corrupt(&mut self, cable: CableId, count: u32) {
        self.fault(Fault::Corrupt { cable, direction: None, count });
    }

    /// Drops the next frames on a cable, in both directions.
    pub fn drop(&mut self, cable: CableId, count: u32) {
        self.fault(Fault::Drop { cable, direction: None, count });
    }
}
