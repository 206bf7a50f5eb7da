//! Injects faults, at once or at a scheduled time.

use super::{Event, Network};
use crate::cable::{CableId, DeviceIndex, Direction, Endpoint, LegFaults};
use crate::fault::Fault;
use crate::queue::Lane;
use crate::time::SimTime;

impl Network {
    /// Injects a fault at a time, or at once if that has passed.
    ///
    /// # Panics
    /// If the device, the cable or the byte of the EEPROM does not exist.
    pub fn schedule(&mut self, at: SimTime, fault: Fault) {
        self.check(&fault);
        let free = self.scheduled.iter().position(Option::is_none).unwrap_or(self.scheduled.len());
        if free == self.scheduled.len() {
            self.scheduled.push(None);
        }
        self.scheduled[free] = Some(fault);
        self.queue.push(Lane::Any, at.max(self.now), Event::Fault { number: free as u32 });
    }

    /// Injects a fault now.
    ///
    /// # Panics
    /// If the device, the cable or the byte of the EEPROM does not exist.
    pub fn apply(&mut self, fault: Fault) {
        self.check(&fault);
        match fault {
            Fault::Cut(cable) => self.cut(cable),
            Fault::Heal(cable) => self.heal(cable),
            Fault::HealUnevenly { cable, direction, by } => self.heal_unevenly(cable, direction, by),
            Fault::Drop { cable, direction, count } => self.set_faults(cable, direction, |faults| faults.drop = count),
            Fault::Duplicate { cable, direction, count } => {
                self.set_faults(cable, direction, |faults| faults.duplicate = count);
            }
            Fault::Corrupt { cable, direction, count } => {
                self.set_faults(cable, direction, |faults| faults.corrupt = count);
            }
            Fault::SymbolErrors { cable, direction, count } => {
                self.set_faults(cable, direction, |faults| faults.symbol_errors = count);
            }
            Fault::IdleSymbolErrors { cable, direction, count } => self.disturb_idle(cable, direction, count),
            Fault::Delay { cable, direction, count, by } => self.set_faults(cable, direction, |faults| {
                faults.delay = count;
                faults.delay_by = by;
            }),
            Fault::OneWay { cable, direction, blocked } => {
                self.set_faults(cable, Some(direction), |faults| faults.blocked = blocked);
            }
            Fault::StopHost(host, stop) => self.stop_host(host, stop),
            Fault::PowerHostOff(host) => self.power_host_off(host),
            Fault::PowerHostOn(host) => self.power_host_on(host),
            Fault::PowerOff(device) => self.power_off(device),
            Fault::PowerOn(device) => self.power_on(device),
            Fault::Hang(device, hanging) => {
                let now = self.now;
                self.device_mut(device).hang(hanging, now);
            }
            Fault::CorruptSii { device, offset, mask } => {
                if let Some(byte) = self.device_mut(device).controller.sii_image_mut().get_mut(offset) {
                    *byte ^= mask;
                }
            }
            Fault::Mail(device, fault) => {
                let now = self.now;
                self.device_mut(device).disturb_mail(fault, now);
            }
            Fault::SpoilSiiWrites { device, how, times } => {
                self.device_mut(device).controller.spoil_sii_writes(how, times);
            }
            Fault::SlowSii { device, busy, times } => self.device_mut(device).controller.slow_sii(busy, times),
            Fault::PdiErrors { device, code, count } => {
                let controller = &mut self.device_mut(device).controller;
                (0..count.min(u8::MAX.into())).for_each(|_| controller.count_pdi_error(code));
            }
            Fault::RefuseTransition { device, to, code, times } => {
                self.device_mut(device).refuse_transition(to, code, times);
            }
        }
    }

    /// Applies a due scheduled fault.
    pub(super) fn apply_scheduled(&mut self, number: usize) {
        if let Some(fault) = self.scheduled.get_mut(number).and_then(Option::take) {
            self.apply(fault);
        }
    }

    fn set_faults(&mut self, cable: CableId, direction: Option<Direction>, change: impl Fn(&mut LegFaults)) {
        self.wiring_changed();
        for candidate in Direction::ALL {
            if direction.is_none_or(|wanted| wanted == candidate) {
                self.leg_mut(cable, candidate).set_faults(&change);
            }
        }
    }

    /// The receiving ends of a cable detect invalid symbols.
    fn disturb_idle(&mut self, cable: CableId, direction: Option<Direction>, count: u32) {
        for candidate in Direction::ALL {
            let leg = self.leg_mut(cable, candidate);
            let receives = leg.signal() && leg.detected && direction.is_none_or(|wanted| wanted == candidate);
            let Endpoint::Device(device, port) = leg.to else { continue };
            if receives {
                (0..count).for_each(|_| self.device_mut(device).controller.count_symbol_error(port));
            }
        }
    }

    /// A fault on a missing cable or device is an error of the test, which must be reported.
    fn check(&self, fault: &Fault) {
        match *fault {
            Fault::Cut(cable)
            | Fault::Heal(cable)
            | Fault::HealUnevenly { cable, .. }
            | Fault::Drop { cable, .. }
            | Fault::Duplicate { cable, .. }
            | Fault::Corrupt { cable, .. }
            | Fault::SymbolErrors { cable, .. }
            | Fault::IdleSymbolErrors { cable, .. }
            | Fault::Delay { cable, .. }
            | Fault::OneWay { cable, .. } => {
                assert!(cable.0 < self.cables.len(), "no cable {} among {}", cable.0, self.cables.len());
            }
            Fault::StopHost(..) | Fault::PowerHostOff(_) | Fault::PowerHostOn(_) => {}
            Fault::PowerOff(device)
            | Fault::PowerOn(device)
            | Fault::Hang(device, _)
            | Fault::Mail(device, _)
            | Fault::SlowSii { device, .. }
            | Fault::SpoilSiiWrites { device, .. }
            | Fault::PdiErrors { device, .. }
            | Fault::RefuseTransition { device, .. } => self.check_device(device),
            Fault::CorruptSii { device, offset, .. } => {
                self.check_device(device);
                let size = self.nodes[device.0].device.controller.sii_image().len();
                assert!(offset < size, "no byte {offset} among {size} of the EEPROM of device {}", device.0);
            }
        }
    }

    fn check_device(&self, device: DeviceIndex) {
        assert!(device.0 < self.nodes.len(), "no device {} among {}", device.0, self.nodes.len());
    }
}
