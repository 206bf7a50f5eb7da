//! Digital and analogue terminals on the E-bus.

use ringcat_wire::sii::{CoeDetails, FmmuUsage, Identity, PdoDirection, SyncManagerKind};

use super::parts::VENDOR_ID;
use super::parts::{
    EBUS_PORTS, FIXED_MANDATORY, FLEXIBLE, OUTPUTS_START, channel_settings, coe_mailbox, entry, four_sync_managers,
    pdo, sync_manager, sync_parameters,
};
use crate::application::behaviours::sawtooth_16;
use crate::application::{Behaviour, InputSource};
use crate::description::{DeviceDescription, data_type};

const DIGITAL_START: u16 = 0x1000;
/// DIGITAL_OUTPUTS, the register of the output pins of a controller without microcontroller.
const DIGITAL_OUTPUT_REGISTER: u16 = 0x0F00;
const PDI_DIGITAL_IO: u8 = 0x04;
const SPI: u8 = 0x05;
/// CoE features of an analogue terminal.
const ANALOGUE_COE: u8 = CoeDetails::SDO_INFORMATION | CoeDetails::PDO_ASSIGN | CoeDetails::COMPLETE_ACCESS;
/// Smallest cycle of an analogue terminal.
const ANALOGUE_CYCLE_NS: u32 = 100_000;

fn terminal(name: &str, kind: u32, channels: u8) -> DeviceDescription {
    let product_code = kind << 16 | u32::from(channels);
    let identity = Identity { vendor_id: VENDOR_ID, product_code, revision: 0x0010_0000, serial: 0 };
    let mut description = DeviceDescription::plain(name, identity);
    description.ports = EBUS_PORTS;
    description.ebus_current_ma = 90;
    description
}

/// Digital inputs of 4, 8 or 16 bits: SyncManager 0, one PDO of one bit per channel.
pub fn digital_input(name: &str, channels: u8) -> DeviceDescription {
    let mut description = terminal(name, 0x03F0, channels);
    description.group = "Digital inputs".into();
    description.fmmus = vec![FmmuUsage::Inputs];
    let length = u16::from(channels.div_ceil(8));
    description.sync_managers = vec![sync_manager(DIGITAL_START, length, 0x20, SyncManagerKind::Inputs)];
    for channel in 0..channels {
        let (mapping, index) = (0x1A00 + u16::from(channel), 0x6000 + 0x10 * u16::from(channel));
        let value = entry(index, 1, "Input", data_type::BOOL, 1);
        let name = format!("Channel {}", channel + 1);
        description.pdos.push(pdo(PdoDirection::Tx, mapping, &name, Some(0), FIXED_MANDATORY, vec![value]));
    }
    description.sii_size_bytes = if channels > 8 { 768 } else { 512 };
    description
}

/// Digital outputs of 4, 8 or 16 bits: SyncManager 0 with watchdog, one PDO of one bit per channel.
pub fn digital_output(name: &str, channels: u8) -> DeviceDescription {
    let mut description = terminal(name, 0x07D8, channels);
    description.group = "Digital outputs".into();
    description.fmmus = vec![FmmuUsage::Outputs];
    let length = u16::from(channels.div_ceil(8));
    description.sync_managers = vec![sync_manager(DIGITAL_START, length, 0x64, SyncManagerKind::Outputs)];
    for channel in 0..channels {
        let (mapping, index) = (0x1600 + u16::from(channel), 0x7000 + 0x10 * u16::from(channel));
        let value = entry(index, 1, "Output", data_type::BOOL, 1);
        let name = format!("Channel {}", channel + 1);
        description.pdos.push(pdo(PdoDirection::Rx, mapping, &name, Some(0), FIXED_MANDATORY, vec![value]));
    }
    description.sii_size_bytes = if channels > 8 { 768 } else { 512 };
    description
}

/// The same terminal without a microcontroller: I/O pins of the controller, emulated state machine, no AL events.
pub fn emulated(mut description: DeviceDescription) -> DeviceDescription {
    description.emulation = true;
    description.pdi_type = PDI_DIGITAL_IO;
    description.identity.revision += 1;
    for entry in &mut description.sync_managers {
        match entry.kind {
            SyncManagerKind::Outputs => (entry.start, entry.control) = (DIGITAL_OUTPUT_REGISTER, 0x44),
            SyncManagerKind::Inputs => entry.control = 0x00,
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => {}
        }
    }
    description
}

/// Analogue inputs of 16 bits, each after a status word, with a sawtooth as default value; a second PDO per channel
/// omits the status and can be assigned instead.
pub fn analog_input(name: &str, channels: u8) -> DeviceDescription {
    let mut description = terminal(name, 0x0BF0, channels);
    description.pdi_type = SPI;
    description.group = "Analogue inputs".into();
    description.fmmus = vec![FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus];
    description.mailbox = Some(coe_mailbox(ANALOGUE_COE));
    let inputs = 4 * u16::from(channels);
    description.sync_managers = four_sync_managers(0, 0x24, OUTPUTS_START + 0x80, inputs);
    for channel in 0..channels {
        let index = 0x6000 + 0x10 * u16::from(channel);
        let mapping = 0x1A00 + 2 * u16::from(channel);
        let status = entry(index, 1, "Status", data_type::U16, 16);
        let value = entry(index, 0x11, "Value", data_type::I16, 16);
        let name = format!("Channel {}", channel + 1);
        let full = vec![status, value.clone()];
        description.pdos.push(pdo(PdoDirection::Tx, mapping, &name, Some(3), FLEXIBLE, full));
        description.pdos.push(pdo(PdoDirection::Tx, mapping + 1, "Compact", None, FLEXIBLE, vec![value]));
        description.objects.push(channel_settings(0x8000 + 0x10 * u16::from(channel)));
    }
    description.objects.push(sync_parameters(0x1C33, "SM input parameter", ANALOGUE_CYCLE_NS, false));
    description.behaviour = Behaviour::Terminal(InputSource::Function(sawtooth_16));
    description.sii_size_bytes = 512;
    description
}

/// Analogue outputs, 16 bits each.
pub fn analog_output(name: &str, channels: u8) -> DeviceDescription {
    let mut description = terminal(name, 0x0FA0, channels);
    description.pdi_type = SPI;
    description.group = "Analogue outputs".into();
    description.fmmus = vec![FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus];
    description.mailbox = Some(coe_mailbox(ANALOGUE_COE));
    let outputs = 2 * u16::from(channels);
    description.sync_managers = four_sync_managers(outputs, 0x64, OUTPUTS_START + 0x80, 0);
    for channel in 0..channels {
        let value = entry(0x7000 + 0x10 * u16::from(channel), 1, "Value", data_type::I16, 16);
        let name = format!("Channel {}", channel + 1);
        let mapping = 0x1600 + u16::from(channel);
        description.pdos.push(pdo(PdoDirection::Rx, mapping, &name, Some(2), FLEXIBLE, vec![value]));
        description.objects.push(channel_settings(0x8000 + 0x10 * u16::from(channel)));
    }
    description.objects.push(sync_parameters(0x1C32, "SM output parameter", ANALOGUE_CYCLE_NS, false));
    description.sii_size_bytes = 512;
    description
}
