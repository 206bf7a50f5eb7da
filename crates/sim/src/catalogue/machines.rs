//! Devices that are not terminals: coupler, junction, servo drive, and a block with much process data.

use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{CoeDetails, DcMode, FmmuUsage, Identity, PdoDirection, SyncManagerKind};

use super::VENDOR_ID;
use super::parts::{
    FIXED_MANDATORY, FLEXIBLE, OUTPUTS_START, coe_mailbox, entry, four_sync_managers, pdo, sync_manager,
};
use crate::application::dictionary::{Access, Object};
use crate::application::{Behaviour, InputSource};
use crate::description::{DcDescription, DeviceDescription, data_type};

/// Bytes in each direction of the block.
pub const BLOCK_BYTES: u16 = 400;
/// Device type of a CiA 402 servo drive.
const SERVO_DEVICE_TYPE: u32 = 0x0002_0192;

fn machine(name: &str, product_code: u32) -> DeviceDescription {
    let identity = Identity { vendor_id: VENDOR_ID, product_code, revision: 0x0010_0000, serial: 0 };
    DeviceDescription::plain(name, identity)
}

/// A bus coupler: MII in, MII out on port 2, E-bus on port 1; no process data, emulated state machine.
pub fn coupler(name: &str) -> DeviceDescription {
    let mut description = machine(name, 0x044C_0001);
    description.group = "System terminals".into();
    description.ports = [PortKind::Mii, PortKind::Ebus, PortKind::Mii, PortKind::NotImplemented];
    description.pdi_type = 0;
    description.emulation = true;
    description.ebus_current_ma = -2000;
    description.dc = Some(DcDescription { wide: true, modes: Vec::new(), minimum_cycle_ns: 0 });
    description.sii_size_bytes = 256;
    description
}

/// Four MII ports to branch cables; no process data, emulated state machine.
pub fn junction(name: &str) -> DeviceDescription {
    let mut description = machine(name, 0x0462_0004);
    description.group = "System terminals".into();
    description.ports = [PortKind::Mii; 4];
    description.pdi_type = 0;
    description.emulation = true;
    description.dc = Some(DcDescription { wide: true, modes: Vec::new(), minimum_cycle_ns: 0 });
    description.sii_size_bytes = 256;
    description
}

/// A CiA 402 servo drive (cyclic synchronous position and velocity). PDOs can be assigned and configured.
pub fn servo(name: &str) -> DeviceDescription {
    let mut description = machine(name, 0x1B96_0402);
    description.group = "Drives".into();
    description.fmmus = vec![FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus];
    let details = CoeDetails::SDO_INFORMATION
        | CoeDetails::PDO_ASSIGN
        | CoeDetails::PDO_CONFIGURATION
        | CoeDetails::COMPLETE_ACCESS;
    description.mailbox = Some(coe_mailbox(details));
    let command = vec![
        entry(0x6040, 0, "Controlword", data_type::U16, 16),
        entry(0x607A, 0, "Target position", data_type::I32, 32),
        entry(0x60FF, 0, "Target velocity", data_type::I32, 32),
        entry(0x6060, 0, "Mode of operation", data_type::I8, 8),
        entry(0, 0, "", 0, 8),
    ];
    let feedback = vec![
        entry(0x6041, 0, "Statusword", data_type::U16, 16),
        entry(0x6064, 0, "Position", data_type::I32, 32),
        entry(0x606C, 0, "Velocity", data_type::I32, 32),
        entry(0x6061, 0, "Mode display", data_type::I8, 8),
        entry(0, 0, "", 0, 8),
        entry(0x603F, 0, "Error code", data_type::U16, 16),
    ];
    description.sync_managers = four_sync_managers(12, 0x64, OUTPUTS_START + 0x100, 14);
    description.pdos = vec![
        pdo(PdoDirection::Rx, 0x1600, "Command", Some(2), FLEXIBLE, command),
        pdo(
            PdoDirection::Rx,
            0x1601,
            "Controlword only",
            None,
            FLEXIBLE,
            vec![entry(0x6040, 0, "Controlword", data_type::U16, 16)],
        ),
        pdo(PdoDirection::Tx, 0x1A00, "Feedback", Some(3), FLEXIBLE, feedback),
        pdo(
            PdoDirection::Tx,
            0x1A01,
            "Statusword only",
            None,
            FLEXIBLE,
            vec![entry(0x6041, 0, "Statusword", data_type::U16, 16)],
        ),
    ];
    description.objects = vec![
        Object::variable(0x1000, "Device type", data_type::U32, Access::ReadOnly, &SERVO_DEVICE_TYPE.to_le_bytes()),
        // Cyclic synchronous position and velocity.
        Object::variable(0x6502, "Modes", data_type::U32, Access::ReadOnly, &0x0000_0180u32.to_le_bytes()),
        Object::variable(0x6065, "Following window", data_type::U32, Access::ReadWrite, &1_000u32.to_le_bytes()),
    ];
    let mode = |assign_activate| DcMode { assign_activate, sync0_cycle_factor: 1, ..DcMode::default() };
    let modes = vec![mode(0x0000), mode(0x0300), mode(0x0700)];
    description.dc = Some(DcDescription { wide: true, modes, minimum_cycle_ns: 125_000 });
    description.watchdog_required = true;
    description.identification = Some(0);
    description.behaviour = Behaviour::Servo;
    description.sii_size_bytes = 1024;
    description
}

/// Several hundred bytes in and out, without mailbox; the inputs are the valid outputs.
pub fn block(name: &str) -> DeviceDescription {
    let mut description = machine(name, 0x0190_0190);
    description.group = "Blocks".into();
    description.fmmus = vec![FmmuUsage::Outputs, FmmuUsage::Inputs];
    let inputs_start = 0x1000 + 0x800;
    description.sync_managers = vec![
        sync_manager(0x1000, BLOCK_BYTES, 0x64, SyncManagerKind::Outputs),
        sync_manager(inputs_start, BLOCK_BYTES, 0x20, SyncManagerKind::Inputs),
    ];
    // One entry holds at most 255 bits; 25 bytes each make few entries.
    let entries = |base: u16, name: &str| {
        let places = 1..=(BLOCK_BYTES / 25) as u8;
        places.map(|sub_index| entry(base, sub_index, name, data_type::OCTET_STRING, 200)).collect::<Vec<_>>()
    };
    let (outputs, inputs) = (entries(0x7000, "Out"), entries(0x6000, "In"));
    description.pdos = vec![
        pdo(PdoDirection::Rx, 0x1600, "Outputs", Some(0), FIXED_MANDATORY, outputs),
        pdo(PdoDirection::Tx, 0x1A00, "Inputs", Some(1), FIXED_MANDATORY, inputs),
    ];
    description.behaviour = Behaviour::Terminal(InputSource::Outputs);
    description.sii_size_bytes = 512;
    description
}
