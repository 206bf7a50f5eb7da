//! Devices that are not terminals: coupler, junction, and a block with much process data.

use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{FmmuUsage, Identity, PdoDirection, SyncManagerKind};

use super::parts::VENDOR_ID;
use super::parts::{FIXED_MANDATORY, entry, pdo, sync_manager};
use crate::application::{Behaviour, InputSource};
use crate::description::{DcDescription, DeviceDescription, data_type};

/// Bytes of the block in each direction.
pub const BLOCK_BYTES: u16 = 400;

/// A device of the simulator without process data, mailbox and clock.
pub(super) fn machine(name: &str, product_code: u32) -> DeviceDescription {
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

/// Four MII ports for branch cables; no process data, emulated state machine.
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

/// Several hundred bytes of inputs and outputs, without mailbox; the inputs are the valid outputs.
pub fn block(name: &str) -> DeviceDescription {
    let mut description = machine(name, 0x0190_0190);
    description.group = "Blocks".into();
    description.fmmus = vec![FmmuUsage::Outputs, FmmuUsage::Inputs];
    let inputs_start = 0x1000 + 0x800;
    description.sync_managers = vec![
        sync_manager(0x1000, BLOCK_BYTES, 0x64, SyncManagerKind::Outputs),
        sync_manager(inputs_start, BLOCK_BYTES, 0x20, SyncManagerKind::Inputs),
    ];
    // One entry holds at most 255 bits; entries of 25 bytes keep their number small.
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
