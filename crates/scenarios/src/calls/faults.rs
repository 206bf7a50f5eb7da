//! Faults of the segment between calls: cables, power, hung applications, refused states, other programs.

use std::time::Duration;

use ringcat_sim::cable::{CableId, DeviceIndex, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::al::{AlControl, AlState, AlStatusCode};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MacAddress};
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::register::map;

use crate::dice::Dice;

/// Address of another program on the wire.
const OTHER: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x77]);
const STATES: [AlState; 4] = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op];
/// Longest frame of another program.
const FRAME: usize = 200;

/// Faults that last.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    cut: Option<CableId>,
    off: Option<DeviceIndex>,
    hung: Option<DeviceIndex>,
}

/// A frame of another program that writes one register.
pub fn foreign_write(command: Command, target: Target, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; FRAME];
    let length = {
        let mut builder = FrameBuilder::ethernet(&mut bytes, MacAddress::ETHERCAT_GROUP, OTHER).expect("there is room");
        let at = builder.datagram(command, 7, target, data.len()).expect("there is room");
        builder.data_mut(at, data.len()).expect("there is room").copy_from_slice(data);
        builder.finish()
    };
    bytes.truncate(length);
    bytes
}

/// A program on the main interface of this host writes a register of the SubDevice at a position.
pub fn write_as_another(network: &mut Network, position: u16, register: RegisterAddress, data: &[u8]) {
    let target = Target::Position(Position(position), register);
    network.send(HostLink::Main, &foreign_write(Command::Apwr, target, data));
}

impl Faults {
    /// Whether a fault lasts.
    pub fn last(&self) -> bool {
        self.cut.is_some() || self.off.is_some() || self.hung.is_some()
    }

    /// The device that hangs.
    pub fn hung(&self) -> Option<DeviceIndex> {
        self.hung
    }

    /// One change, as text.
    pub fn change(&mut self, dice: &mut Dice, network: &mut Network) -> String {
        let (cables, devices) = (network.cables().len() as u64, network.devices().len() as u64);
        let device = DeviceIndex(dice.below(devices) as usize);
        match dice.below(10) {
            0..3 => match self.cut.take() {
                Some(cable) => apply(network, Fault::Heal(cable)),
                None => {
                    let cable = CableId(dice.below(cables) as usize);
                    self.cut = Some(cable);
                    apply(network, Fault::Cut(cable))
                }
            },
            3 | 4 => match self.off.take() {
                Some(device) => apply(network, Fault::PowerOn(device)),
                None => {
                    self.off = Some(device);
                    apply(network, Fault::PowerOff(device))
                }
            },
            5 => match self.hung.take() {
                Some(device) => apply(network, Fault::Hang(device, false)),
                None => {
                    self.hung = Some(device);
                    apply(network, Fault::Hang(device, true))
                }
            },
            6 => {
                let (to, code) = (*dice.pick(&STATES[1..]), AlStatusCode(0x8042));
                apply(network, Fault::RefuseTransition { device, to, code, times: 1 + dice.below(2) as u32 })
            }
            // The link flaps.
            7 => {
                let (cable, at) = (CableId(dice.below(cables) as usize), network.now());
                let back = at + Duration::from_micros(10 + dice.below(40_000));
                if self.cut.is_none() {
                    network.schedule(back, Fault::Heal(cable));
                    network.apply(Fault::Cut(cable));
                }
                format!("cable {} flaps", cable.0)
            }
            8 => {
                let emergency = Emergency { error_code: 0x1000, error_register: 1, data: [1, 2, 3, 4, 5] };
                let sent = (0..1 + dice.below(6)).filter(|_| {
                    network.device_mut(device).controller.is_powered()
                        && network.device_mut(device).application.emergency(&emergency)
                });
                format!("{} emergencies of device {}", sent.count(), device.0)
            }
            _ => foreign(dice, network),
        }
    }

    /// Repairs everything.
    pub fn end(&mut self, network: &mut Network) {
        self.cut.take().into_iter().for_each(|cable| network.apply(Fault::Heal(cable)));
        self.off.take().into_iter().for_each(|device| network.apply(Fault::PowerOn(device)));
        self.hung.take().into_iter().for_each(|device| network.apply(Fault::Hang(device, false)));
        let devices = network.devices().len();
        for device in (0..devices).map(DeviceIndex) {
            for to in STATES {
                network.apply(Fault::RefuseTransition { device, to, code: AlStatusCode(0), times: 0 });
            }
        }
    }
}

fn apply(network: &mut Network, fault: Fault) -> String {
    let text = format!("{fault:?}");
    network.apply(fault);
    text
}

/// Another program changes registers: a state, a station address, a SyncManager, an FMMU, SYNC signals.
fn foreign(dice: &mut Dice, network: &mut Network) -> String {
    let at = dice.below(network.devices().len() as u64) as u16;
    let (register, data): (RegisterAddress, Vec<u8>) = match dice.below(6) {
        0 | 1 => (map::AL_CONTROL, AlControl::new(*dice.pick(&STATES)).encode().to_vec()),
        2 => (map::STATION_ADDRESS, (*dice.pick(&[0u16, 1, 0x1001, 0x1002, 0x4711])).to_le_bytes().to_vec()),
        3 => (map::sync_manager(dice.below(4) as u8), vec![0; 8]),
        4 => (map::fmmu(dice.below(3) as u8), vec![0; 16]),
        _ => (map::DC_ACTIVATION, vec![0]),
    };
    write_as_another(network, at, register, &data);
    format!("another program writes {data:02x?} to {register:?} at position {at}")
}
