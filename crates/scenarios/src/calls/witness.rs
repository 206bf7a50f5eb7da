//! What the simulated SubDevices show of the calls: outputs, SYNC pulses, states, mapped memory.
//!
//! The application fills all its outputs with one number per write. Inside a SubDevice outputs change only while an
//! application is active, to a whole number that was queued since its activation, and never to an older one after a
//! newer one; they may fall to zero at any time. A device that hung takes what its buffer holds when it goes on, also
//! from an application that has ended meanwhile.

use std::fmt::Write;

use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::Network;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::{Fmmu, map};

/// Numbers of writes: a byte without zero.
const NUMBERS: u64 = 255;

/// Outputs and pulses of one device at the last look.
#[derive(Clone, Debug, Default)]
struct Seen {
    outputs: Vec<u8>,
    /// The newest write whose number it showed.
    newest: u64,
    pulses: u64,
}

/// The checker.
#[derive(Clone, Debug, Default)]
pub struct Witness {
    devices: Vec<Seen>,
    /// Counts writes.
    writes: u64,
    /// The write that was queued last with each number.
    queued: Vec<u64>,
    /// The same, before the activation.
    queued_before: Vec<u64>,
    /// An application is active.
    is_active: bool,
    /// Changes of outputs that were compared.
    pub compared: u64,
}

impl Witness {
    /// The next write of the application: the byte for all its outputs.
    pub fn write(&mut self) -> u8 {
        self.writes += 1;
        self.byte()
    }

    fn byte(&self) -> u8 {
        (self.writes % NUMBERS) as u8 + 1
    }

    /// What was written last was queued.
    pub fn queue(&mut self) {
        let byte = usize::from(self.byte());
        if let Some(queued) = self.queued.get_mut(byte) {
            *queued = self.writes;
        }
    }

    /// An application begins: numbers of the previous one must not appear any more.
    pub fn begin(&mut self) {
        self.is_active = true;
        let before = std::mem::replace(&mut self.queued, vec![0; NUMBERS as usize + 1]);
        let newest = |(at, write): (usize, u64)| write.max(self.queued_before.get(at).copied().unwrap_or_default());
        self.queued_before = before.into_iter().enumerate().map(newest).collect();
        self.devices.iter_mut().for_each(|seen| seen.newest = 0);
    }

    /// The application has ended.
    pub fn end(&mut self) {
        self.is_active = false;
    }

    /// A device that hung goes on, and takes at once what its buffer holds: nothing that was never queued.
    ///
    /// # Panics
    /// If it holds anything else.
    pub fn go_on(&mut self, network: &mut Network, device: DeviceIndex) {
        let now = network.now();
        network.device_mut(device).run(now);
        self.devices.resize_with(network.devices().len(), Seen::default);
        let seen = &mut self.devices[device.0];
        let outputs = network.device(device).outputs();
        let Some(byte) = outputs.iter().copied().find(|byte| *byte != 0) else { return };
        let known = [&self.queued, &self.queued_before].map(|queued| queued.get(usize::from(byte)).copied());
        let is_known = outputs.iter().all(|other| *other == byte) && known.into_iter().flatten().any(|write| write > 0);
        assert!(is_known, "device {} goes on with outputs {outputs:02x?}, {}", device.0, describe(network));
        seen.outputs = outputs.to_vec();
    }

    /// Looks into all devices.
    ///
    /// # Panics
    /// If outputs have another value than the ones that may be there, or pulses come without an application.
    pub fn look(&mut self, network: &Network, pulses_may_come: bool) {
        self.devices.resize_with(network.devices().len(), Seen::default);
        let now = network.now();
        for (number, seen) in self.devices.iter_mut().enumerate() {
            let device = network.device(DeviceIndex(number));
            let pulses = device.controller.sync0_pulses(now);
            assert!(
                pulses_may_come || pulses <= seen.pulses,
                "device {number}: SYNC0 pulses without an application, {}",
                describe(network)
            );
            seen.pulses = pulses;
            let outputs = device.outputs();
            if *outputs == seen.outputs[..] {
                continue;
            }
            seen.outputs = outputs.to_vec();
            let Some(byte) = outputs.iter().copied().find(|byte| *byte != 0) else { continue };
            let queued = self.queued.get(usize::from(byte)).copied().unwrap_or_default();
            let is_whole = outputs.iter().all(|other| *other == byte);
            let is_known = self.is_active && queued > 0 && queued >= seen.newest;
            assert!(
                is_whole && is_known,
                "device {number}: outputs {outputs:02x?}, active {}, write {queued} after {}, {}",
                self.is_active,
                seen.newest,
                describe(network)
            );
            seen.newest = queued;
            self.compared += 1;
        }
    }
}

/// States of all devices, as text.
pub fn describe(network: &Network) -> String {
    let mut text = format!("at {}:", network.now());
    for device in network.devices() {
        let (power, code) = (device.controller.is_powered(), device.al_status_code());
        let power = if power { "" } else { ", off" };
        let _ = write!(text, " [{} {}, {code}{power}]", device.name(), device.al_status());
    }
    text
}

/// Why a device is not as without an application: its state, an FMMU, SYNC signals.
///
/// # Errors
/// The first difference.
pub fn is_idle(network: &Network, device: usize) -> Result<(), String> {
    let controller = &network.device(DeviceIndex(device)).controller;
    let status = network.device(DeviceIndex(device)).al_status();
    if status != AlStatus::new(AlState::PreOp) {
        return Err(format!("device {device} is in {status}"));
    }
    let fmmus = Fmmu::LEN * usize::from(controller.config().fmmu_count);
    if controller.register(map::FMMU_BASE, fmmus).iter().any(|byte| *byte != 0) {
        return Err(format!("device {device} has an FMMU"));
    }
    if controller.register(map::DC_ACTIVATION, 1) != [0] {
        return Err(format!("device {device} has SYNC signals"));
    }
    Ok(())
}
