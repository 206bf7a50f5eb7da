//! The servo drive: its SII, and its objects by CiA 402 (IEC 61800-7-201) and ETG.6010.
//!
//! This file defines each object of the drive with default and range; [`servo`](crate::application::servo) implements
//! them.

use ringcat_wire::mailbox::coe::AccessRights;
use ringcat_wire::sii::{CoeDetails, DcMode, FmmuUsage, PdoDirection};

use super::machines::machine;
use super::parts::{
    FLEXIBLE, MILLISECONDS, OUTPUTS_START, coe_mailbox, entry, four_sync_managers, pdo, sync_parameters,
};
use crate::application::Behaviour;
use crate::application::dictionary::{Access, Entry, Object};
use crate::application::servo::{HOMING_METHODS, INCREMENTS_PER_REVOLUTION, MODES, PEAK_TORQUE};
use crate::description::data_type::{I8, I16, I32, U8, U16, U32};
use crate::description::{DcDescription, DeviceDescription, data_type};

/// Device type of a CiA 402 servo drive.
const DEVICE_TYPE: u32 = 0x0002_0192;
/// Smallest cycle of process data.
const MINIMUM_CYCLE_NS: u32 = 125_000;
/// Units of ETG.1004 for SDO information, which provides prefix and unit; speeds and accelerations do not fit and are
/// given by 0x60A8 to 0x60AA. Increments (00 B5), milli (FD), ampere (04), second (03) and their positions in 32 bits,
/// with "per second" and "per second squared" (57) as denominators, are those of ESI files of commercial drives.
const INCREMENTS: u16 = 0x00B5;
const THOUSANDTHS: u16 = 0xFD00;
const MILLIAMPERES: u16 = 0xFD04;
/// The units in 32 bits: increments, increments per second, increments per second squared.
const SI_UNITS: [(u16, &str, u32); 3] = [
    (0x60A8, "SI unit position", 0x00B5_0000),
    (0x60A9, "SI unit velocity", 0x00B5_0300),
    (0x60AA, "SI unit acceleration", 0x00B5_5700),
];
/// Bits of 0x6502: profile position, velocity, torque, homing, CSP, CSV, CST.
const SUPPORTED_MODES: i64 = 0x0000_03AD;

/// A CiA 402 servo drive in all profile and cyclic modes. PDOs can be assigned and configured.
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
    description.objects = objects();
    let mode = |assign_activate| DcMode { assign_activate, sync0_cycle_factor: 1, ..DcMode::default() };
    let modes = vec![mode(0x0000), mode(0x0300), mode(0x0700)];
    description.dc = Some(DcDescription { wide: true, modes, minimum_cycle_ns: MINIMUM_CYCLE_NS });
    description.watchdog_required = true;
    description.identification = Some(0);
    description.behaviour = Behaviour::Servo;
    description.sii_size_bytes = 1024;
    description
}

/// A number with the length of its type.
fn number(data_type: u8, access: Access, value: i64) -> Entry {
    let length = match data_type {
        I8 | U8 => 1,
        I16 | U16 => 2,
        _ => 4,
    };
    Entry::new(0, data_type, access, &value.to_le_bytes()[..length])
}

/// Status objects.
fn actual(data_type: u8) -> Entry {
    number(data_type, Access::ReadOnly, 0).allow(AccessRights::TX_MAPPABLE)
}

/// Command objects in the process data.
fn command(data_type: u8, value: i64) -> Entry {
    number(data_type, Access::ReadWrite, value).allow(AccessRights::RX_MAPPABLE)
}

/// Settings.
fn setting(data_type: u8, value: i64) -> Entry {
    number(data_type, Access::ReadWrite, value).allow(AccessRights::SETTING)
}

/// Constant objects.
fn constant(data_type: u8, value: i64) -> Entry {
    number(data_type, Access::ReadOnly, value)
}

fn object(index: u16, name: &str, entry: Entry) -> Object {
    Object { name: name.into(), entries: vec![entry], ..Object::variable(index, name, U8, Access::ReadOnly, &[0]) }
}

fn record<const N: usize>(index: u16, name: &str, entries: [(&str, Entry); N]) -> Object {
    let entries = (1..).zip(entries).map(|(sub_index, (name, entry))| entry.at(sub_index).named(name));
    Object::record(index, name, entries.collect())
}

fn objects() -> Vec<Object> {
    let mut objects = vec![
        object(0x1000, "Device type", constant(U32, DEVICE_TYPE.into())),
        sync_parameters(0x1C32, "SM output parameter", MINIMUM_CYCLE_NS, true),
        sync_parameters(0x1C33, "SM input parameter", MINIMUM_CYCLE_NS, true),
    ];
    objects.extend(SI_UNITS.map(|(index, name, unit)| object(index, name, constant(U32, unit.into()))));
    objects.extend(power_objects());
    objects.extend(position_objects());
    objects.extend(velocity_and_torque_objects());
    objects.extend(homing_objects());
    objects
}

/// States, option codes, modes.
fn power_objects() -> [Object; 14] {
    [
        object(0x6007, "Abort connection option code", setting(I16, 1).within(0, 3)),
        object(0x603F, "Error code", actual(U16)),
        object(0x6040, "Controlword", command(U16, 0)),
        object(0x6041, "Statusword", actual(U16)),
        object(0x605A, "Quick stop option code", setting(I16, 2).one_of(&[0, 1, 2, 3, 5, 6, 7])),
        object(0x605B, "Shutdown option code", setting(I16, 0).within(0, 1)),
        object(0x605C, "Disable operation option code", setting(I16, 1).within(0, 1)),
        object(0x605D, "Halt option code", setting(I16, 1).within(1, 3)),
        object(0x605E, "Fault reaction option code", setting(I16, 2).within(0, 3)),
        object(0x6060, "Modes of operation", command(I8, 0).one_of(MODES)),
        object(0x6061, "Modes of operation display", actual(I8)),
        object(0x60FD, "Digital inputs", actual(U32)),
        record(0x60FE, "Digital outputs", [("Physical outputs", actual(U32))]),
        object(0x6502, "Supported drive modes", constant(U32, SUPPORTED_MODES)),
    ]
}

fn position_objects() -> [Object; 21] {
    let (low, high) = (i64::from(i32::MIN), i64::from(i32::MAX));
    let most = i64::from(u32::MAX);
    [
        object(0x6062, "Position demand value", actual(I32).in_unit(INCREMENTS)),
        object(0x6063, "Position actual internal value", actual(I32).in_unit(INCREMENTS)),
        object(0x6064, "Position actual value", actual(I32).in_unit(INCREMENTS)),
        object(0x6065, "Following error window", setting(U32, 1_000).in_unit(INCREMENTS)),
        object(0x6066, "Following error time out", setting(U16, 10).in_unit(MILLISECONDS)),
        object(0x6067, "Position window", setting(U32, 10).in_unit(INCREMENTS)),
        object(0x6068, "Position window time", setting(U16, 0).in_unit(MILLISECONDS)),
        object(0x607A, "Target position", command(I32, 0).in_unit(INCREMENTS)),
        record(
            0x607D,
            "Software position limit",
            [
                ("Min position limit", setting(I32, low).in_unit(INCREMENTS)),
                ("Max position limit", setting(I32, high).in_unit(INCREMENTS)),
            ],
        ),
        object(0x607F, "Max profile velocity", command(U32, 10_000_000).within(0, most)),
        object(0x6080, "Max motor speed", command(U32, 4_500).within(0, 6_000)),
        object(0x6081, "Profile velocity", command(U32, 1_000_000)),
        object(0x6083, "Profile acceleration", command(U32, 10_000_000).within(1, most)),
        object(0x6084, "Profile deceleration", command(U32, 10_000_000).within(1, most)),
        object(0x6085, "Quick stop deceleration", command(U32, 50_000_000).within(1, most)),
        record(
            0x608F,
            "Position encoder resolution",
            [
                ("Encoder increments", constant(U32, INCREMENTS_PER_REVOLUTION.into())),
                ("Motor revolutions", constant(U32, 1)),
            ],
        ),
        object(0x60B0, "Position offset", command(I32, 0).in_unit(INCREMENTS)),
        object(0x60B1, "Velocity offset", command(I32, 0)),
        object(0x60B2, "Torque offset", command(I16, 0).in_unit(THOUSANDTHS)),
        record(
            0x60C2,
            "Interpolation time period",
            [
                ("Interpolation time period value", setting(U8, 1).within(1, 255)),
                ("Interpolation time index", setting(I8, -3).within(-6, 0)),
            ],
        ),
        object(0x60F4, "Following error actual value", actual(I32).in_unit(INCREMENTS)),
    ]
}

fn velocity_and_torque_objects() -> [Object; 17] {
    let peak = PEAK_TORQUE as i64;
    let torque = |entry: Entry| entry.in_unit(THOUSANDTHS);
    [
        object(0x606B, "Velocity demand value", actual(I32)),
        object(0x606C, "Velocity actual value", actual(I32)),
        object(0x606D, "Velocity window", setting(U16, 2_000)),
        object(0x606E, "Velocity window time", setting(U16, 0).in_unit(MILLISECONDS)),
        object(0x606F, "Velocity threshold", setting(U16, 1_000)),
        object(0x6071, "Target torque", torque(command(I16, 0)).within(-peak, peak)),
        object(0x6072, "Max torque", torque(command(U16, peak)).within(0, peak)),
        object(0x6074, "Torque demand", torque(actual(I16))),
        object(0x6075, "Motor rated current", constant(U32, 2_700).in_unit(MILLIAMPERES)),
        object(0x6076, "Motor rated torque", constant(U32, 1_270)),
        object(0x6077, "Torque actual value", torque(actual(I16))),
        object(0x6078, "Current actual value", torque(actual(I16))),
        object(0x6087, "Torque slope", command(U32, 10_000).within(1, i64::from(u32::MAX))),
        object(0x60E0, "Positive torque limit value", torque(command(U16, peak)).within(0, peak)),
        object(0x60E1, "Negative torque limit value", torque(command(U16, peak)).within(0, peak)),
        object(0x60FF, "Target velocity", command(I32, 0)),
        object(0x6402, "Motor type", constant(U16, 3)),
    ]
}

fn homing_objects() -> [Object; 5] {
    let most = i64::from(u32::MAX);
    let methods = HOMING_METHODS.iter().map(|method| ("Supported homing method", constant(I8, *method)));
    let methods = (1..).zip(methods).map(|(sub_index, (name, entry))| entry.at(sub_index).named(name));
    [
        object(0x607C, "Home offset", setting(I32, 0).in_unit(INCREMENTS)),
        object(0x6098, "Homing method", setting(I8, 37).one_of(HOMING_METHODS)),
        record(
            0x6099,
            "Homing speeds",
            [
                ("Speed during search for switch", setting(U32, 500_000).within(1, most)),
                ("Speed during search for zero", setting(U32, 50_000).within(1, most)),
            ],
        ),
        object(0x609A, "Homing acceleration", setting(U32, 10_000_000).within(1, most)),
        Object::record(0x60E3, "Supported homing methods", methods.collect()),
    ]
}
